"""A recorded trial on one page: flashes, phases, the order parameter, and where the robots went."""

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.ticker import MaxNLocator

from epuck_sim import epuck
from epuck_sim.drawing import check_stem, save_drawing
from epuck_sim.errors import RecordingError
from epuck_sim.recording.level import Level
from epuck_sim.recording.reader import Recorded

PATH_S = 10.0
"""So long before the moment at which the robots are drawn do their paths begin."""

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
    files = check_stem(stem, ".png", ".svg")
    save_drawing(draw_page(recorded), *files)
    return files


def draw_page(recorded: Recorded) -> Figure:
    """Return the page: on the left the arena when most rings were lit for the last time, on the right time runs."""
    figure = Figure(figsize=(12, 5.6), layout="constrained")
    outcome = f"synchronised after {recorded.cycles} cycles" if recorded.synchronised else "not synchronised"
    figure.suptitle(f"{recorded.scenario.name}, seed {recorded.seed}: {outcome}", parse_math=False)
    grid = figure.add_gridspec(3, 2, width_ratios=[1, 1.25], height_ratios=[1.5, 1, 1])
    _draw_arena(figure.add_subplot(grid[:, 0]), recorded)
    for row, draw in enumerate((_draw_flashes, _draw_phases, _draw_order)):
        axes = figure.add_subplot(grid[row, 1])
        draw(axes, recorded)
        axes.set_xlim(0, 1.01 * recorded.time_s[-1] + recorded.scenario.timing.step_ms / 1000)
        axes.tick_params(labelbottom=row == 2)
    axes.set_xlabel("simulated time [s]")
    return figure


def _draw_arena(axes: Axes, recorded: Recorded) -> None:
    arena = recorded.scenario.arena.build()
    rings = recorded.ring_on.sum(axis=1)
    moment = int(np.flatnonzero(rings == rings.max())[-1])
    begin = int(np.searchsorted(recorded.time_s, recorded.time_s[moment] - PATH_S))
    axes.add_patch(Rectangle((0, 0), arena.width_cm, arena.height_cm, fill=False, linewidth=1.5))
    for x, y, radius in arena.circles:
        axes.add_patch(Circle((x, y), radius, facecolor="0.85"))
    for corners in arena.polygons:
        axes.add_patch(Polygon(corners, facecolor="0.85"))
    for robot, colour in enumerate(_colours(recorded)):
        path = recorded.positions[begin : moment + 1, robot]
        axes.plot(path[:, 0], path[:, 1], color=colour, linewidth=0.8, alpha=0.6)
        x, y = path[-1]
        heading = recorded.headings[moment, robot]
        face = RED if recorded.ring_on[moment, robot] else DARK
        axes.add_patch(Circle((x, y), epuck.RADIUS_CM, facecolor=face, edgecolor=colour, linewidth=1.5, zorder=3))
        front = (x + epuck.RADIUS_CM * math.cos(heading), y + epuck.RADIUS_CM * math.sin(heading))
        axes.plot([x, front[0]], [y, front[1]], color="white", zorder=4)
    lasted = recorded.time_s[moment] - recorded.time_s[begin]
    axes.set_title(f"at {recorded.time_s[moment]:.1f} s, with the paths of {lasted:.0f} s", fontsize="medium")
    axes.set(aspect="equal", xlabel="x [cm]", ylabel="y [cm]")
    axes.margins(0.02)


def _draw_flashes(axes: Axes, recorded: Recorded) -> None:
    low, high = recorded.flash_robot - 0.4, recorded.flash_robot + 0.4
    many = len(recorded.flash_s) > MANY
    axes.vlines(recorded.flash_s, low, high, colors=RED, linewidth=0.5 if many else 1.5, rasterized=many)
    axes.set(ylabel="flashes\nof robot", ylim=(-0.7, recorded.scenario.robot_count - 0.3))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def _draw_phases(axes: Axes, recorded: Recorded) -> None:
    """Draw the phases relative to the reference robot's, whenever that fires: the swarm falls into step at 0."""
    periods = [1000 * group.parameters.get("period_s", math.nan) for group in recorded.scenario.robots]
    period_ms = np.repeat(periods, [group.count for group in recorded.scenario.robots])
    cycles = recorded.phase_ms[np.searchsorted(recorded.time_s, recorded.firing_s)] / period_ms
    ahead = cycles - cycles[:, [recorded.scenario.stop.reference_robot]]
    ahead -= np.round(ahead)
    for robot, colour in enumerate(_colours(recorded)):
        axes.plot(recorded.firing_s, ahead[:, robot], ".", color=colour, markersize=4, rasterized=ahead.size > MANY)
    axes.set(ylabel="phase ahead of\nthe reference [cycles]", ylim=(-0.53, 0.53))


def _draw_order(axes: Axes, recorded: Recorded) -> None:
    many = len(recorded.time_s) > MANY
    axes.plot(recorded.time_s, recorded.order_parameter, color="0.75", linewidth=0.8, rasterized=many)
    axes.plot(recorded.firing_s, recorded.firing_order, "o-", color="black", markersize=3, linewidth=1, rasterized=many)
    axes.axhline(recorded.scenario.stop.order_parameter, color=RED, linewidth=0.8, linestyle="--")
    axes.set(ylabel="order\nparameter", ylim=(min(0.0, np.nanmin(recorded.order_parameter, initial=0.0)), 1.04))


def _colours(recorded: Recorded) -> npt.NDArray[np.float64]:
    """Return (robots, 4) a colour for each robot."""
    colours: npt.NDArray[np.float64] = colormaps["viridis"](np.linspace(0, 0.95, recorded.scenario.robot_count))
    return colours
