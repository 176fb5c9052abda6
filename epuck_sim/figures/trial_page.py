"""A recorded trial on one page: the arena with paths, flashes, phases, the order parameter, and how the trial ended."""

import math
from collections.abc import Iterator
from textwrap import shorten, wrap
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from epuck_sim.arena import floor_levels
from epuck_sim.arrays import FloatArray
from epuck_sim.display.arena_svg import LAMP, MOST_NUMBERED
from epuck_sim.display.table import leaves
from epuck_sim.errors import RecordingError
from epuck_sim.figures.labels import format_axis_values, group_labels, short_files
from epuck_sim.recording import Level
from epuck_sim.recording.layers import FLOOR_PX, LEGIBLE_SHARE
from epuck_sim.recording.reader import Recorded
from epuck_sim.recording.rows import Population, population_of
from epuck_sim.recording.series import phase_lead
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.util.builtin import ARENAS, builtin_files

RED = "#dc2828"  # colour of rings that are lit, and of flashes
DARK = "#8a8f98"  # colour of rings that are dark
INNER_SHARE = 0.88  # radius of the white line within the coloured edge of a disc, as a share of its radius
MAX_VECTOR_MARKS = 5_000  # largest number of marks that an SVG holds one by one; more are embedded as a picture

MARGINS = {"left": 0.08, "right": 0.985, "bottom": 0.14}  # where the panels begin and end, as shares of the page
TOP = 0.89  # where the panels end below a title of one line, as a share of the page
LINE_HEIGHT = 0.035  # height of each further line of the title, as a share of the page
HEIGHTS = (1.3, 1.1, 1)  # relative heights of the flashes, the phases and the order parameter
MAX_CHANGES = 8  # most changed keys that a title names
MAX_VALUE = 40  # most characters of a changed value that a title shows
LINE_LENGTH = 120  # most characters in a line of the title


def check_drawable(recorded: Recorded, origin: str) -> None:
    """Raise RecordingError for a recording without poses or without steps; `origin` is its name in the message."""
    if recorded.level is Level.SUMMARY:
        said = "holds no poses, so that trajectories cannot be drawn"
        raise RecordingError(f"{origin}: {said}; record the trial again with --record-level poses or full")
    if not len(recorded.time_s):
        raise RecordingError(f"{origin}: holds no steps")


def draw_page(recorded: Recorded, title: str | None = None) -> Figure:
    """Draw the arena at the last moment when most rings were lit, on the left, and courses over time, on the right.

    Without flashes and oscillators there are no courses, and the arena fills the page.
    """
    population = population_of(recorded.scenario)
    has_oscillators = not np.isnan(population.period_ms).all()
    figure = Figure(figsize=(12, 5.6), dpi=300)
    title = title or page_title(recorded, has_oscillators=has_oscillators)
    figure.suptitle(title, y=0.985, fontsize="medium", parse_math=False)
    courses = [_draw_flashes] if has_oscillators or len(recorded.flash_s) else []
    courses += [_draw_phases, _draw_order] if has_oscillators else []
    # matplotlib's own layout solver does not always give the same last digits
    top = TOP - LINE_HEIGHT * title.count("\n")
    widths = [1, 1.25] if courses else [1]
    sides = figure.add_gridspec(1, len(widths), **MARGINS, top=top, width_ratios=widths, wspace=0.2)
    draw_arena(figure.add_subplot(sides[0]), recorded, population)
    if not courses:
        return figure
    grid = sides[1].subgridspec(len(courses), 1, height_ratios=HEIGHTS[: len(courses)], hspace=0.12)
    for row, draw in enumerate(courses):
        axes = figure.add_subplot(grid[row])
        draw(axes, recorded, population)
        axes.set_xlim(0, 1.01 * recorded.time_s[-1] + 1 / population.rows_per_s)
        axes.tick_params(labelbottom=row == len(courses) - 1)
    axes.set_xlabel("simulated time (s)")
    return figure


def _draw_flashes(axes: Axes, recorded: Recorded, population: Population) -> None:
    low, high = recorded.flash_robot - 0.4, recorded.flash_robot + 0.4
    is_picture = len(recorded.flash_s) > MAX_VECTOR_MARKS
    axes.vlines(recorded.flash_s, low, high, colors=RED, linewidth=0.5 if is_picture else 1.5, rasterized=is_picture)
    axes.set(ylabel=f"flashes\nof {population.noun}", ylim=(-0.7, population.size - 0.3))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def _draw_phases(axes: Axes, recorded: Recorded, population: Population) -> None:
    """Draw the phases relative to that of the reference at its firings; those of a synchronised swarm are 0."""
    ahead = phase_lead(recorded.phase_ms[np.searchsorted(recorded.time_s, recorded.firing_s)], population)
    is_picture = ahead.size > MAX_VECTOR_MARKS
    for lead, colour in zip(ahead.T, robot_colours(population), strict=True):
        axes.plot(recorded.firing_s, lead, ".", color=colour, markersize=4, rasterized=is_picture)
    axes.set(ylabel="phase ahead of\nreference (cycles)", ylim=(-0.53, 0.53))


def _draw_order(axes: Axes, recorded: Recorded, population: Population) -> None:
    style: dict[str, Any] = {"rasterized": len(recorded.time_s) > MAX_VECTOR_MARKS}
    steps = f"at each {population.moment}"
    axes.plot(recorded.time_s, recorded.order_parameter, color="0.75", linewidth=0.8, label=steps, **style)
    firings = "at firings of the reference"
    axes.plot(recorded.firing_s, recorded.firing_order, "ko-", markersize=3, linewidth=1, label=firings, **style)
    threshold = recorded.scenario.stop.order_parameter
    if threshold is not None:
        axes.axhline(threshold, color=RED, linewidth=0.8, linestyle="--", label=f"threshold {threshold:.12g}")
    axes.set(ylabel="order\nparameter", ylim=(min(0.0, np.nanmin(recorded.order_parameter, initial=0.0)), 1.04))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.36), ncols=3, fontsize="small", frameon=False)


def draw_arena(axes: Axes, recorded: Recorded, population: Population) -> None:
    """Draw the last moment at which most rings were lit, and the paths that led there."""
    moment = recorded.brightest_row
    begin = int(np.searchsorted(recorded.time_s, recorded.time_s[moment] - population.path_s))
    draw = _draw_floor if population.arena.height_cm > 0 else _draw_segment
    draw(axes, recorded, population, slice(begin, moment + 1))
    duration_s = recorded.time_s[moment] - recorded.time_s[begin]
    digits = max(0, 1 - math.floor(math.log10(population.path_s)))
    when = f"at {recorded.time_s[moment]:.{digits + 1}f} s, with the paths of {duration_s:.{digits}f} s"
    what = "a cube seen from above: x and y of three dimensions\n" if population.is_cube else ""
    axes.set_title(what + when, fontsize="medium")
    axes.set_xlabel("x (cm)")


def _robots(
    recorded: Recorded, population: Population, rows: slice
) -> Iterator[tuple[int, FloatArray, FloatArray, str]]:
    """Yield for each robot or agent its number, path, (points, 3) s, cm, cm: time, x, y, colour and its ring's colour.

    Paths go straight from row to row, and are NaN where they have gaps.
    """
    time_s = recorded.time_s[rows]
    far_cm = population.arena.width_cm / 2 if population.is_cyclic else math.inf
    for number, colour in enumerate(robot_colours(population)):
        positions = recorded.positions[rows, number]
        jumps = 1 + np.flatnonzero((np.abs(np.diff(positions, axis=0)) > far_cm).any(axis=1))
        path = np.insert(np.column_stack([time_s, positions]), jumps, np.nan, axis=0)
        yield number, path, colour, RED if recorded.ring_on[rows, number][-1] else DARK


def _draw_floor(axes: Axes, recorded: Recorded, population: Population, rows: slice) -> None:
    arena = recorded.arena_at(rows.stop - 1)
    if not arena.floor.is_white:
        levels, extent = floor_levels(arena, FLOOR_PX), (0, arena.width_cm, 0, arena.height_cm)
        axes.imshow(levels, cmap="gray", vmin=0, vmax=255, extent=extent)
    for x, y, *_ in arena.lamps:
        axes.add_patch(Circle((x, y), arena.lamp_cm, color=LAMP))
    axes.add_patch(Rectangle((0, 0), arena.width_cm, arena.height_cm, fill=False, linewidth=1.5))
    for x, y, radius in arena.circles:
        axes.add_patch(Circle((x, y), radius, facecolor="0.85"))
    for corners in arena.polygons:
        axes.add_patch(Polygon(corners, facecolor="0.85"))
    for number, path, colour, face in _robots(recorded, population, rows):
        axes.plot(path[:, 1], path[:, 2], color=colour, linewidth=0.8, alpha=0.6)
        x, y = recorded.positions[rows, number][-1]
        if math.isnan(x):  # the robot is not in the arena
            continue
        heading, radius_cm = recorded.headings[rows, number][-1], population.radii_cm[number]
        axes.add_patch(Circle((x, y), radius_cm, facecolor=face, edgecolor=colour, linewidth=1.5, zorder=3))
        # a white line keeps colours apart that the colour-blind confuse
        axes.add_patch(Circle((x, y), INNER_SHARE * radius_cm, fill=False, edgecolor="white", linewidth=1, zorder=3.5))
        ahead_x, ahead_y = radius_cm * math.cos(heading), radius_cm * math.sin(heading)
        axes.plot([x, x + ahead_x], [y, y + ahead_y], color="white", zorder=4)
        if population.size < MOST_NUMBERED:  # on its disc, behind its front, or beside it if that is small
            span_cm = max(population.arena.width_cm, population.arena.height_cm)
            behind = 0.45 if 2 * radius_cm >= LEGIBLE_SHARE * span_cm else 1.9
            outline = [withStroke(linewidth=2, foreground="white")]
            looks: dict[str, Any] = {"fontsize": 8, "zorder": 5, "path_effects": outline}
            axes.text(x - behind * ahead_x, y - behind * ahead_y, str(number), ha="center", va="center", **looks)
    axes.set(aspect="equal", ylabel="y (cm)")
    axes.margins(0.02)


def _draw_segment(axes: Axes, recorded: Recorded, population: Population, rows: slice) -> None:
    """Draw a segment, which has no y, with time as the vertical axis of its paths."""
    for wall in (0, population.arena.width_cm):
        axes.axvline(wall, color="black", linewidth=1.5)
    for number, path, colour, face in _robots(recorded, population, rows):
        axes.plot(path[:, 1], path[:, 0], color=colour, linewidth=0.8)
        axes.plot(path[-1, 1], path[-1, 0], "o", color=face, markeredgecolor=colour, markersize=10)
        if population.size < MOST_NUMBERED:
            axes.text(path[-1, 1], path[-1, 0], str(number), color="white", fontsize=6, ha="center", va="center")
    axes.set(ylabel="simulated time (s)")
    axes.margins(0.03)


def robot_colours(population: Population) -> FloatArray:
    """Return a colour for each robot or agent, (size, 4)."""
    return np.asarray(colormaps["viridis"](np.linspace(0, 0.95, population.size)))


def page_title(recorded: Recorded, *, has_oscillators: bool) -> str:
    """Return the title: scenario, seed and outcome, and further lines on how the scenario was changed, if it was."""
    if recorded.synchronised:
        outcome = f"synchronised after {recorded.cycles} cycles"
    elif recorded.scenario.stop.order_parameter is None and has_oscillators:
        outcome = f"{recorded.cycles} cycles"
    else:
        outcome = "not synchronised" if has_oscillators else "without oscillators"
    head = f"{recorded.scenario.name}, seed {recorded.seed}: {outcome}"
    return "\n".join([head, *wrap(describe_changes(recorded.scenario), LINE_LENGTH)])


def describe_changes(scenario: Scenario) -> str:
    """Return the values, but of things drawn, that differ from the shipped scenario's of this name, or the model's.

    >>> describe_changes(load_scenario("thesis", ["robots.0.parameters.speed_cm_s=3", "stop.max_cycles=7"]))
    'with max cycles = 7, V = 3 cm/s'
    """
    name = scenario.name
    known = load_scenario(name if name in builtin_files(ARENAS) else {"model": scenario.model})
    irrelevant = dict.fromkeys(WITHOUT_EFFECT | {"model", "seed", "sweep"}, True) | {"arena": {"obstacles", "movables"}}
    before, values = (dict(leaves(each.model_dump(mode="json", exclude=irrelevant))) for each in (known, scenario))
    changes = {
        key: f"{value:g}" if isinstance(value, float) else value
        for key, value in values.items()
        if key not in before or before[key] != value
    }
    own = group_labels(scenario)
    texts = [format_axis_values({key: value}, changes, own) for key, value in short_files([changes])[0].items()]
    shown = [shorten(text, len(text.partition(" = ")[0]) + MAX_VALUE, placeholder=" …") for text in texts[:MAX_CHANGES]]
    rest = [f"and {len(texts) - len(shown)} more"] * (len(texts) > len(shown))
    return f"with {', '.join([*shown, *rest])}" if texts else ""
