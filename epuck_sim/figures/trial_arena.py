"""The arena on a trial's page: the last moment at which most rings were lit, and the paths that led there."""

import math
from collections.abc import Iterator

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.patheffects import withStroke

from epuck_sim.arrays import Float32Array, FloatArray, IntArray
from epuck_sim.figures.agent_paths import agent_path
from epuck_sim.recording.layers.arena import UNLABELLED
from epuck_sim.recording.population import Population
from epuck_sim.recording.recorded import Recorded
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario

RED = "#dc2828"
"""Colour of rings that are lit, and of flashes."""

DARK = "#8a8f98"
"""Colour of rings that are dark."""

INNER_SHARE = 0.88
"""Radius of the white line within the coloured edge of a disc, as a share of its radius."""

LEGIBLE_SHARE = 1 / 15
"""Smallest diameter of a disc that has room for a number, as a share of the arena's longer side."""


def draw_arena(axes: Axes, recorded: Recorded, population: Population) -> None:
    """Draw the last moment at which most rings were lit, and the paths that led there."""
    rings = recorded.ring_on.sum(axis=1)
    moment = int(np.flatnonzero(rings == rings.max())[-1])
    begin = int(np.searchsorted(recorded.time_s, recorded.time_s[moment] - population.path_s))
    draw = _draw_floor if population.arena.height_cm > 0 else _draw_segment
    draw(axes, recorded, population, slice(begin, moment + 1))
    duration_s = recorded.time_s[moment] - recorded.time_s[begin]
    digits = max(0, 1 - math.floor(math.log10(population.path_s)))
    when = f"at {recorded.time_s[moment]:.{digits + 1}f} s, with the paths of {duration_s:.{digits}f} s"
    what = "a cube seen from above: x and y of three dimensions\n" if _is_cube(recorded.scenario) else ""
    axes.set_title(what + when, fontsize="medium")
    axes.set(xlabel="x [cm]")


def _is_cube(scenario: Scenario) -> bool:
    return isinstance(scenario, ParticleScenario) and scenario.space.dimensions == 3


def _paths(recorded: Recorded, population: Population, rows: slice) -> Iterator[FloatArray]:
    """Yield the path of each robot or agent, (points, 3) s, cm, cm: time, x, y; NaN where it has a gap.

    Robots, and agents in a cube, of whose headings only the horizontal part is known, are drawn from row to row.
    """
    scenario, time_s = recorded.scenario, recorded.time_s[rows]
    for number in range(population.size):
        positions, headings = recorded.positions[rows, number], recorded.headings[rows, number]
        if isinstance(scenario, ParticleScenario) and not _is_cube(scenario):
            side_cm = scenario.space.side_cm
            yield agent_path(time_s, positions, headings, side_cm, is_cyclic=population.is_cyclic)
        else:
            path = np.column_stack([time_s, positions])
            yield np.insert(path, _jumps(positions, population), np.nan, axis=0)


def _draw_floor(axes: Axes, recorded: Recorded, population: Population, rows: slice) -> None:
    arena, radius_cm = recorded.arena_at(rows.stop - 1), population.radius_cm
    axes.add_patch(Rectangle((0, 0), arena.width_cm, arena.height_cm, fill=False, linewidth=1.5))
    for x, y, radius in arena.circles:
        axes.add_patch(Circle((x, y), radius, facecolor="0.85"))
    for corners in arena.polygons:
        axes.add_patch(Polygon(corners, facecolor="0.85"))
    for number, (colour, path) in enumerate(
        zip(robot_colours(population), _paths(recorded, population, rows), strict=True)
    ):
        axes.plot(path[:, 1], path[:, 2], color=colour, linewidth=0.8, alpha=0.6)
        x, y = recorded.positions[rows, number][-1]
        if math.isnan(x):  # the robot is not in the arena
            continue
        heading = recorded.headings[rows, number][-1]
        face = RED if recorded.ring_on[rows, number][-1] else DARK
        axes.add_patch(Circle((x, y), radius_cm, facecolor=face, edgecolor=colour, linewidth=1.5, zorder=3))
        # a white line keeps colours apart that the colour-blind confuse
        axes.add_patch(Circle((x, y), INNER_SHARE * radius_cm, fill=False, edgecolor="white", linewidth=1, zorder=3.5))
        front = (x + radius_cm * math.cos(heading), y + radius_cm * math.sin(heading))
        axes.plot([x, front[0]], [y, front[1]], color="white", zorder=4)
        if population.size < UNLABELLED:
            _write_number(axes, number, (x, y), heading, population)
    axes.set(aspect="equal", ylabel="y [cm]")
    axes.margins(0.02)


def _write_number(axes: Axes, number: int, middle: tuple[float, float], heading: float, population: Population) -> None:
    """Write the number of a robot or agent behind its front: on its disc, or beside it if that is small."""
    span_cm = max(population.arena.width_cm, population.arena.height_cm)
    share = -0.45 if 2 * population.radius_cm >= LEGIBLE_SHARE * span_cm else -1.9
    behind = share * population.radius_cm
    axes.text(
        middle[0] + behind * math.cos(heading),
        middle[1] + behind * math.sin(heading),
        str(number),
        fontsize=8,
        ha="center",
        va="center",
        zorder=5,
        path_effects=[withStroke(linewidth=2, foreground="white")],
    )


def _draw_segment(axes: Axes, recorded: Recorded, population: Population, rows: slice) -> None:
    """Draw a segment, which has no y, with time as the vertical axis of its paths."""
    for wall in (0, population.arena.width_cm):
        axes.axvline(wall, color="black", linewidth=1.5)
    for number, (colour, path) in enumerate(
        zip(robot_colours(population), _paths(recorded, population, rows), strict=True)
    ):
        axes.plot(path[:, 1], path[:, 0], color=colour, linewidth=0.8)
        face = RED if recorded.ring_on[rows, number][-1] else DARK
        axes.plot(path[-1, 1], path[-1, 0], "o", color=face, markeredgecolor=colour, markersize=10)
        if population.size < UNLABELLED:
            axes.text(path[-1, 1], path[-1, 0], str(number), color="white", fontsize=6, ha="center", va="center")
    axes.set(ylabel="simulated time [s]")
    axes.margins(0.03)


def _jumps(path: Float32Array, population: Population) -> IntArray:
    """Return the rows, (jumps,), of a path, (rows, 2) cm, before which it leaves a cyclic space and re-enters it."""
    far_cm = population.arena.width_cm / 2 if population.is_cyclic else math.inf
    return 1 + np.flatnonzero((np.abs(np.diff(path, axis=0)) > far_cm).any(axis=1))


def robot_colours(population: Population) -> FloatArray:
    """Return a colour for each robot or agent, (size, 4)."""
    colours: FloatArray = colormaps["viridis"](np.linspace(0, 0.95, population.size))
    return colours
