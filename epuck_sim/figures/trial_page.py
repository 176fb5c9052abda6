"""A recorded trial on one page: flashes, phases, the order parameter, and where all went."""

import math
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.ticker import MaxNLocator

from epuck_sim.arrays import Float32Array, FloatArray, IntArray
from epuck_sim.errors import RecordingError
from epuck_sim.figures.style import output_paths, save_drawing
from epuck_sim.recording.level import Level
from epuck_sim.recording.parts import population_of
from epuck_sim.recording.population import Population
from epuck_sim.recording.reader import Recorded

MANY = 5_000
"""Of more marks, an SVG holds a picture and not each by itself."""

RED = "#dc2828"
DARK = "#8a8f98"


def save_page(recorded: Recorded, origin: str, stem: Path) -> list[Path]:
    """Write a page as STEM.png and STEM.svg, and return the files.

    origin: what an error calls the recording. Raises RecordingError where it holds no poses, EpuckSimError where a file
    cannot be written.
    """
    if recorded.level is Level.SUMMARY:
        raise RecordingError(
            f"{origin}: holds no poses, so that trajectories cannot be drawn; record the trial again with "
            "--record-level poses or full"
        )
    if not len(recorded.time_s):
        raise RecordingError(f"{origin}: holds no steps")
    files = output_paths(stem, ".png", ".svg")
    save_drawing(draw_page(recorded), *files)
    return files


def draw_page(recorded: Recorded) -> Figure:
    """Return the page: on the left the arena when most rings were lit for the last time, on the right time runs."""
    subject = population_of(recorded.scenario)
    figure = Figure(figsize=(12, 5.6), layout="constrained")
    outcome = f"synchronised after {recorded.cycles} cycles" if recorded.synchronised else "not synchronised"
    figure.suptitle(f"{recorded.scenario.name}, seed {recorded.seed}: {outcome}", parse_math=False)
    grid = figure.add_gridspec(3, 2, width_ratios=[1, 1.25], height_ratios=[1.5, 1, 1])
    _draw_arena(figure.add_subplot(grid[:, 0]), recorded, subject)
    for row, draw in enumerate((_draw_flashes, _draw_phases, _draw_order)):
        axes = figure.add_subplot(grid[row, 1])
        draw(axes, recorded, subject)
        axes.set_xlim(0, 1.01 * recorded.time_s[-1] + 1 / subject.rows_per_s)
        axes.tick_params(labelbottom=row == 2)
    axes.set_xlabel("simulated time [s]")
    return figure


def _draw_arena(axes: Axes, recorded: Recorded, subject: Population) -> None:
    """Draw the moment at which most rings were lit, the last of several, and the paths that led there."""
    rings = recorded.ring_on.sum(axis=1)
    moment = int(np.flatnonzero(rings == rings.max())[-1])
    begin = int(np.searchsorted(recorded.time_s, recorded.time_s[moment] - subject.path_s))
    draw = _draw_floor if subject.arena.height_cm > 0 else _draw_segment
    draw(axes, recorded, subject, slice(begin, moment + 1))
    lasted = recorded.time_s[moment] - recorded.time_s[begin]
    digits = max(0, 1 - math.floor(math.log10(subject.path_s)))
    at = f"at {recorded.time_s[moment]:.{digits + 1}f} s"
    axes.set_title(f"{at}, with the paths of {lasted:.{digits}f} s", fontsize="medium")
    axes.set(xlabel="x [cm]")


def _draw_floor(axes: Axes, recorded: Recorded, subject: Population, rows: slice) -> None:
    arena, radius_cm = subject.arena, subject.radius_cm
    axes.add_patch(Rectangle((0, 0), arena.width_cm, arena.height_cm, fill=False, linewidth=1.5))
    for x, y, radius in arena.circles:
        axes.add_patch(Circle((x, y), radius, facecolor="0.85"))
    for corners in arena.polygons:
        axes.add_patch(Polygon(corners, facecolor="0.85"))
    for number, colour in enumerate(_colours(subject)):
        path = recorded.positions[rows, number]
        broken = np.insert(path, _jumps(path, subject), np.nan, axis=0)
        axes.plot(broken[:, 0], broken[:, 1], color=colour, linewidth=0.8, alpha=0.6)
        x, y = path[-1]
        heading = recorded.headings[rows, number][-1]
        face = RED if recorded.ring_on[rows, number][-1] else DARK
        axes.add_patch(Circle((x, y), radius_cm, facecolor=face, edgecolor=colour, linewidth=1.5, zorder=3))
        front = (x + radius_cm * math.cos(heading), y + radius_cm * math.sin(heading))
        axes.plot([x, front[0]], [y, front[1]], color="white", zorder=4)
    axes.set(aspect="equal", ylabel="y [cm]")
    axes.margins(0.02)


def _draw_segment(axes: Axes, recorded: Recorded, subject: Population, rows: slice) -> None:
    """Draw a segment, which has no y, with its paths going up in time."""
    for wall in (0, subject.arena.width_cm):
        axes.axvline(wall, color="black", linewidth=1.5)
    for number, colour in enumerate(_colours(subject)):
        path, time_s = recorded.positions[rows, number], recorded.time_s[rows]
        jumps = _jumps(path, subject)
        axes.plot(np.insert(path[:, 0], jumps, np.nan), np.insert(time_s, jumps, np.nan), color=colour, linewidth=0.8)
        face = RED if recorded.ring_on[rows, number][-1] else DARK
        axes.plot(path[-1, 0], time_s[-1], "o", color=face, markeredgecolor=colour, markersize=10)
    axes.set(ylabel="simulated time [s]")
    axes.margins(0.03)


def _jumps(path: Float32Array, subject: Population) -> IntArray:
    """Return (jumps,) the rows of a path, (rows, 2) cm, before which it leaves a cyclic space."""
    far_cm = subject.arena.width_cm / 2 if subject.is_cyclic else math.inf
    return 1 + np.flatnonzero((np.abs(np.diff(path, axis=0)) > far_cm).any(axis=1))


def _draw_flashes(axes: Axes, recorded: Recorded, subject: Population) -> None:
    low, high = recorded.flash_robot - 0.4, recorded.flash_robot + 0.4
    many = len(recorded.flash_s) > MANY
    axes.vlines(recorded.flash_s, low, high, colors=RED, linewidth=0.5 if many else 1.5, rasterized=many)
    axes.set(ylabel=f"flashes\nof {subject.noun}", ylim=(-0.7, subject.size - 0.3))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def _draw_phases(axes: Axes, recorded: Recorded, subject: Population) -> None:
    """Draw the phases relative to the reference's, whenever that fires: the swarm falls into step at 0."""
    cycles = recorded.phase_ms[np.searchsorted(recorded.time_s, recorded.firing_s)] / subject.period_ms
    ahead = cycles - cycles[:, [subject.reference]]
    ahead -= np.round(ahead)
    for number, colour in enumerate(_colours(subject)):
        axes.plot(recorded.firing_s, ahead[:, number], ".", color=colour, markersize=4, rasterized=ahead.size > MANY)
    axes.set(ylabel="phase ahead of\nthe reference [cycles]", ylim=(-0.53, 0.53))


def _draw_order(axes: Axes, recorded: Recorded, _: Population) -> None:
    many = len(recorded.time_s) > MANY
    axes.plot(recorded.time_s, recorded.order_parameter, color="0.75", linewidth=0.8, rasterized=many)
    axes.plot(recorded.firing_s, recorded.firing_order, "o-", color="black", markersize=3, linewidth=1, rasterized=many)
    if recorded.scenario.stop.order_parameter is not None:
        axes.axhline(recorded.scenario.stop.order_parameter, color=RED, linewidth=0.8, linestyle="--")
    axes.set(ylabel="order\nparameter", ylim=(min(0.0, np.nanmin(recorded.order_parameter, initial=0.0)), 1.04))


def _colours(subject: Population) -> FloatArray:
    """Return (count, 4) a colour for each."""
    colours: FloatArray = colormaps["viridis"](np.linspace(0, 0.95, subject.size))
    return colours
