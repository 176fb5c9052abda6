"""A recorded trial on one page: flashes, phases, the order parameter, and paths."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from epuck_sim.errors import RecordingError
from epuck_sim.figures.trial_arena import RED, draw_arena, robot_colours
from epuck_sim.figures.trial_title import page_title
from epuck_sim.recording.layers.time_series import phase_lead
from epuck_sim.recording.level import Level
from epuck_sim.recording.parts import population_of
from epuck_sim.recording.population import Population
from epuck_sim.recording.recorded import Recorded

MAX_VECTOR_MARKS = 5_000
"""Largest number of marks that an SVG holds one by one; more of them are a picture in it."""

MARGINS = {"left": 0.08, "right": 0.985, "bottom": 0.14}
"""Where the panels begin and end, as shares of the page."""

TOP = 0.89
"""Where the panels end below a title of one line, as a share of the page."""

LINE_HEIGHT = 0.035
"""Height of each further line of the title, as a share of the page."""

HEIGHTS = (1.3, 1.1, 1)
"""Relative heights of the flashes, the phases and the order parameter."""


def check_drawable(recorded: Recorded, origin: str) -> None:
    """Raise RecordingError for a recording without poses or without steps; `origin` is what the message calls it."""
    if recorded.level is Level.SUMMARY:
        raise RecordingError(
            f"{origin}: holds no poses, so that trajectories cannot be drawn; record the trial again with "
            "--record-level poses or full"
        )
    if not len(recorded.time_s):
        raise RecordingError(f"{origin}: holds no steps")


def draw_page(recorded: Recorded) -> Figure:
    """Draw the arena when most rings were lit for the last time, on the left, and courses over time, on the right.

    Without flashes and oscillators there are no courses, and the arena has the page for itself.
    """
    population = population_of(recorded.scenario)
    has_oscillators = not np.isnan(population.period_ms).all()
    figure = Figure(figsize=(12, 5.6))
    title = page_title(recorded, has_oscillators=has_oscillators)
    figure.suptitle(title, y=0.985, fontsize="medium", parse_math=False)
    courses = [_draw_flashes] if has_oscillators or len(recorded.flash_s) else []
    courses += [_draw_phases, _draw_order] if has_oscillators else []
    # matplotlib's own solver of layouts gives other last digits from time to time
    top = TOP - LINE_HEIGHT * title.count("\n")
    if not courses:
        draw_arena(figure.add_subplot(figure.add_gridspec(1, 1, **MARGINS, top=top)[0]), recorded, population)
        return figure
    sides = figure.add_gridspec(1, 2, **MARGINS, top=top, width_ratios=[1, 1.25], wspace=0.2)
    draw_arena(figure.add_subplot(sides[0]), recorded, population)
    grid = sides[1].subgridspec(len(courses), 1, height_ratios=HEIGHTS[: len(courses)], hspace=0.12)
    for row, draw in enumerate(courses):
        axes = figure.add_subplot(grid[row])
        draw(axes, recorded, population)
        axes.set_xlim(0, 1.01 * recorded.time_s[-1] + 1 / population.rows_per_s)
        axes.tick_params(labelbottom=row == len(courses) - 1)
    axes.set_xlabel("simulated time [s]")
    return figure


def _draw_flashes(axes: Axes, recorded: Recorded, population: Population) -> None:
    low, high = recorded.flash_robot - 0.4, recorded.flash_robot + 0.4
    is_picture = len(recorded.flash_s) > MAX_VECTOR_MARKS
    axes.vlines(recorded.flash_s, low, high, colors=RED, linewidth=0.5 if is_picture else 1.5, rasterized=is_picture)
    axes.set(ylabel=f"flashes\nof {population.noun}", ylim=(-0.7, population.size - 0.3))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def _draw_phases(axes: Axes, recorded: Recorded, population: Population) -> None:
    """Draw the phases relative to that of the reference whenever this fires; those of a synchronised swarm are 0."""
    ahead = phase_lead(recorded.phase_ms[np.searchsorted(recorded.time_s, recorded.firing_s)], population)
    for number, colour in enumerate(robot_colours(population)):
        axes.plot(
            recorded.firing_s,
            ahead[:, number],
            ".",
            color=colour,
            markersize=4,
            rasterized=ahead.size > MAX_VECTOR_MARKS,
        )
    axes.set(ylabel="phase ahead of\nreference [cycles]", ylim=(-0.53, 0.53))


def _draw_order(axes: Axes, recorded: Recorded, population: Population) -> None:
    style: dict[str, Any] = {"rasterized": len(recorded.time_s) > MAX_VECTOR_MARKS}
    steps = f"at each {population.moment}"
    axes.plot(recorded.time_s, recorded.order_parameter, color="0.75", linewidth=0.8, label=steps, **style)
    firings: dict[str, Any] = {
        "color": "black",
        "markersize": 3,
        "linewidth": 1,
        "label": "at firings of the reference",
    }
    axes.plot(recorded.firing_s, recorded.firing_order, "o-", **firings, **style)
    threshold = recorded.scenario.stop.order_parameter
    if threshold is not None:
        named = f"threshold {threshold:.12g}"
        axes.axhline(threshold, color=RED, linewidth=0.8, linestyle="--", label=named)
    axes.set(ylabel="order\nparameter", ylim=(min(0.0, np.nanmin(recorded.order_parameter, initial=0.0)), 1.04))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.36), ncols=3, fontsize="small", frameon=False)
