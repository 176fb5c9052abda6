"""Makes docs/figures/animation.gif: a swarm falls into step, in its arena and in the raster of its flashes.

`make figures` runs it; it takes a minute.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from PIL import Image

from epuck_sim import EmbodiedScenario, Simulation, Step, epuck, load_scenario, run_trial
from epuck_sim.trial.result import TrialState

OUT = Path(__file__).with_suffix(".gif")
SCENARIO, SEED, FURTHER = "thesis", 107, "stop.further_cycles=4"
STEPS_A_FRAME, FRAME_MS, LAST_FRAME_MS = 3, 80, 2000
"""A frame lasts 0.3 s of simulated time and 0.08 s on the screen: 3.75 times as fast as robots."""

NIGHT, FLOOR, LINE, TEXT, DARK, LIT, GLOW = "#101720", "#18212c", "#5b6b7d", "#d7dee6", "#7d8b99", "#ff4632", "#5c2023"
COLOURS = 32


def main() -> None:
    """Simulate the trial and draw it."""
    scenario = load_scenario(SCENARIO, [FURTHER])
    assert isinstance(scenario, EmbodiedScenario)
    steps: list[tuple[Any, ...]] = []

    def take(step: Step, state: TrialState) -> None:
        steps.append((state.time_s, step.poses.copy(), step.ring_on.copy(), state.order_parameter))

    run_trial(Simulation(scenario, SEED), [take])
    drawn = list(draw(scenario, steps))
    ends = Image.new("RGB", (drawn[0].width, 2 * drawn[0].height))
    ends.paste(drawn[0])
    ends.paste(drawn[-1], (0, drawn[0].height))
    palette = ends.quantize(COLOURS)  # one for all frames, or colours would flicker
    pictures = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in drawn]
    durations = [FRAME_MS] * (len(pictures) - 1) + [LAST_FRAME_MS]
    pictures[0].save(OUT, save_all=True, append_images=pictures[1:], duration=durations, loop=0, optimize=True)


def draw(scenario: EmbodiedScenario, steps: list[tuple[Any, ...]]) -> Iterator[Image.Image]:
    """Yield a picture of each frame: robots are lit if they were in any of its steps, as with an open shutter."""
    robots, side_cm, threshold = scenario.population, scenario.arena.width_cm, scenario.stop.order_parameter or 1
    figure = Figure(figsize=(8.6, 3.6), dpi=100, facecolor=NIGHT)
    canvas: Any = FigureCanvasAgg(figure)
    limits: dict[str, Any] = {"facecolor": FLOOR, "xticks": (), "yticks": (), "xlim": (0, steps[-1][0])}
    arena = figure.add_axes((0.035, 0.083, 0.349, 0.833), **{**limits, "xlim": (0, side_cm), "ylim": (0, side_cm)})
    raster = figure.add_axes((0.5, 0.385, 0.465, 0.47), **limits, ylim=(robots, 0))
    curve = figure.add_axes((0.5, 0.09, 0.465, 0.18), **limits, ylim=(0, 1.1))
    for axes in (arena, raster, curve):
        axes.spines[:].set_color(LINE)
    raster.set_title("flashes of ten robots, one row each", color=TEXT, loc="left")
    curve.axhline(threshold, color=LINE)
    (course,) = curve.plot([], [], color=TEXT)
    at: dict[str, Any] = {"units": "xy", "offsets": np.zeros((robots, 2)), "offset_transform": arena.transData}
    widths = [np.full(robots, 2 * size * epuck.RADIUS_CM) for size in (1.45, 1)]
    discs = [EllipseCollection(width, width, [0], linewidths=0, **at) for width in widths]
    headings = LineCollection([], colors=FLOOR, zorder=3)
    for marks in (*discs, headings):
        arena.add_collection(marks)
    firings: list[tuple[float, float]] = []
    was_lit = np.ones(robots, bool)
    for first in range(0, len(steps) - STEPS_A_FRAME + 1, STEPS_A_FRAME):
        shown = steps[first : first + STEPS_A_FRAME]
        time_s, poses, _, order = shown[-1]
        lit = np.any([ring_on for _, _, ring_on, _ in shown], axis=0)
        flashing = np.flatnonzero(lit & ~was_lit)
        raster.vlines(np.full(len(flashing), time_s), flashing + 0.18, flashing + 0.82, colors=LIT, linewidth=2)
        firings += [(time_s, order)] * (order is not None)
        course.set_data(*np.reshape(firings, (-1, 2)).T)
        discs[0].set_facecolor([GLOW if is_lit else FLOOR for is_lit in lit])
        discs[1].set_facecolor([LIT if is_lit else DARK for is_lit in lit])
        for each in discs:
            each.set_offsets(poses[:, :2])
        ahead = epuck.RADIUS_CM * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        headings.set_segments([*np.stack([poses[:, :2], poses[:, :2] + ahead], axis=1)])
        in_step = "in step" if order is not None and order >= threshold else "not yet in step"
        curve.set_title(f"order parameter: {in_step}", color=TEXT, loc="left")
        curve.set_title(f"{time_s:.1f} s", color=TEXT, loc="right")
        canvas.draw()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        was_lit = lit


if __name__ == "__main__":
    main()
