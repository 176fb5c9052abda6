"""A recorded trial on one page: flashes, phases, the order parameter, and paths."""

import math

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.ticker import MaxNLocator

from epuck_sim.arrays import Float32Array, FloatArray, IntArray
from epuck_sim.errors import RecordingError
from epuck_sim.recording.level import Level
from epuck_sim.recording.parts import population_of
from epuck_sim.recording.population import Population
from epuck_sim.recording.reader import Recorded

MAX_VECTOR_MARKS = 5_000
"""Largest number of marks that an SVG holds one by one; more of them are a picture in it."""

RED = "#dc2828"
"""Colour of rings that are lit, and of flashes."""

DARK = "#8a8f98"
"""Colour of rings that are dark."""


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
    """Draw the arena when most rings were lit for the last time, on the left, and courses over time, on the right."""
    population = population_of(recorded.scenario)
    figure = Figure(figsize=(12, 5.6), layout="constrained")
    outcome = f"synchronised after {recorded.cycles} cycles" if recorded.synchronised else "not synchronised"
    figure.suptitle(f"{recorded.scenario.name}, seed {recorded.seed}: {outcome}", parse_math=False)
    grid = figure.add_gridspec(3, 2, width_ratios=[1, 1.25], height_ratios=[1.5, 1, 1])
    _draw_arena(figure.add_subplot(grid[:, 0]), recorded, population)
    for row, draw in enumerate((_draw_flashes, _draw_phases, _draw_order)):
        axes = figure.add_subplot(grid[row, 1])
        draw(axes, recorded, population)
        axes.set_xlim(0, 1.01 * recorded.time_s[-1] + 1 / population.rows_per_s)
        axes.tick_params(labelbottom=row == 2)
    axes.set_xlabel("simulated time [s]")
    return figure


def _draw_arena(axes: Axes, recorded: Recorded, population: Population) -> None:
    """Draw the last moment at which most rings were lit, and the paths that led there."""
    rings = recorded.ring_on.sum(axis=1)
    moment = int(np.flatnonzero(rings == rings.max())[-1])
    begin = int(np.searchsorted(recorded.time_s, recorded.time_s[moment] - population.path_s))
    draw = _draw_floor if population.arena.height_cm > 0 else _draw_segment
    draw(axes, recorded, population, slice(begin, moment + 1))
    duration_s = recorded.time_s[moment] - recorded.time_s[begin]
    digits = max(0, 1 - math.floor(math.log10(population.path_s)))
    axes.set_title(
        f"at {recorded.time_s[moment]:.{digits + 1}f} s, with the paths of {duration_s:.{digits}f} s", fontsize="medium"
    )
    axes.set(xlabel="x [cm]")


def _draw_floor(axes: Axes, recorded: Recorded, population: Population, rows: slice) -> None:
    arena, radius_cm = population.arena, population.radius_cm
    axes.add_patch(Rectangle((0, 0), arena.width_cm, arena.height_cm, fill=False, linewidth=1.5))
    for x, y, radius in arena.circles:
        axes.add_patch(Circle((x, y), radius, facecolor="0.85"))
    for corners in arena.polygons:
        axes.add_patch(Polygon(corners, facecolor="0.85"))
    for number, colour in enumerate(_colours(population)):
        path = recorded.positions[rows, number]
        broken = np.insert(path, _jumps(path, population), np.nan, axis=0)
        axes.plot(broken[:, 0], broken[:, 1], color=colour, linewidth=0.8, alpha=0.6)
        x, y = path[-1]
        heading = recorded.headings[rows, number][-1]
        face = RED if recorded.ring_on[rows, number][-1] else DARK
        axes.add_patch(Circle((x, y), radius_cm, facecolor=face, edgecolor=colour, linewidth=1.5, zorder=3))
        front = (x + radius_cm * math.cos(heading), y + radius_cm * math.sin(heading))
        axes.plot([x, front[0]], [y, front[1]], color="white", zorder=4)
    axes.set(aspect="equal", ylabel="y [cm]")
    axes.margins(0.02)


def _draw_segment(axes: Axes, recorded: Recorded, population: Population, rows: slice) -> None:
    """Draw a segment, which has no y, with time as the vertical axis of its paths."""
    for wall in (0, population.arena.width_cm):
        axes.axvline(wall, color="black", linewidth=1.5)
    for number, colour in enumerate(_colours(population)):
        path, time_s = recorded.positions[rows, number], recorded.time_s[rows]
        jumps = _jumps(path, population)
        axes.plot(np.insert(path[:, 0], jumps, np.nan), np.insert(time_s, jumps, np.nan), color=colour, linewidth=0.8)
        face = RED if recorded.ring_on[rows, number][-1] else DARK
        axes.plot(path[-1, 0], time_s[-1], "o", color=face, markeredgecolor=colour, markersize=10)
    axes.set(ylabel="simulated time [s]")
    axes.margins(0.03)


def _jumps(path: Float32Array, population: Population) -> IntArray:
    """Return the rows, (jumps,), of a path, (rows, 2) cm, before which it leaves a cyclic space and re-enters it."""
    far_cm = population.arena.width_cm / 2 if population.is_cyclic else math.inf
    return 1 + np.flatnonzero((np.abs(np.diff(path, axis=0)) > far_cm).any(axis=1))


def _draw_flashes(axes: Axes, recorded: Recorded, population: Population) -> None:
    low, high = recorded.flash_robot - 0.4, recorded.flash_robot + 0.4
    is_picture = len(recorded.flash_s) > MAX_VECTOR_MARKS
    axes.vlines(recorded.flash_s, low, high, colors=RED, linewidth=0.5 if is_picture else 1.5, rasterized=is_picture)
    axes.set(ylabel=f"flashes\nof {population.noun}", ylim=(-0.7, population.size - 0.3))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def _draw_phases(axes: Axes, recorded: Recorded, population: Population) -> None:
    """Draw the phases relative to that of the reference whenever this fires; those of a synchronised swarm are 0."""
    cycles = recorded.phase_ms[np.searchsorted(recorded.time_s, recorded.firing_s)] / population.period_ms
    ahead = cycles - cycles[:, [population.reference]]
    ahead -= np.round(ahead)
    for number, colour in enumerate(_colours(population)):
        axes.plot(
            recorded.firing_s,
            ahead[:, number],
            ".",
            color=colour,
            markersize=4,
            rasterized=ahead.size > MAX_VECTOR_MARKS,
        )
    axes.set(ylabel="phase ahead of\nthe reference [cycles]", ylim=(-0.53, 0.53))


def _draw_order(axes: Axes, recorded: Recorded, _: Population) -> None:
    is_picture = len(recorded.time_s) > MAX_VECTOR_MARKS
    axes.plot(recorded.time_s, recorded.order_parameter, color="0.75", linewidth=0.8, rasterized=is_picture)
    axes.plot(
        recorded.firing_s, recorded.firing_order, "o-", color="black", markersize=3, linewidth=1, rasterized=is_picture
    )
    if recorded.scenario.stop.order_parameter is not None:
        axes.axhline(recorded.scenario.stop.order_parameter, color=RED, linewidth=0.8, linestyle="--")
    axes.set(ylabel="order\nparameter", ylim=(min(0.0, np.nanmin(recorded.order_parameter, initial=0.0)), 1.04))


def _colours(population: Population) -> FloatArray:
    """Return a colour for each robot or agent, (size, 4)."""
    colours: FloatArray = colormaps["viridis"](np.linspace(0, 0.95, population.size))
    return colours
