"""Makes docs/figures/animation.gif: a swarm falls into step, in its arena and in the raster of its flashes.

`make figures` runs it; it takes seconds.
"""

import math
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

from epuck_sim import EmbodiedScenario, Simulation, Step, epuck, load_scenario, run_trial
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.trial.result import TrialState

OUT = Path(__file__).with_suffix(".gif")
SCENARIO, SEED = "thesis", 107
FURTHER = "stop.further_cycles=4"
STEPS_A_FRAME = 3
FRAME_MS = 80
"""A frame lasts 0.3 s of simulated time and 0.08 s on the screen: 3.75 times as fast as robots."""
LAST_FRAME_MS = 2000

WIDTH, HEIGHT, MARGIN = 860, 360, 30
ARENA = 300
RASTER_LEFT, RASTER_TOP, ROW = 430, 52, 17
CURVE_TOP, CURVE_HEIGHT = 262, 66
RISE = 60
"""Height at which the order parameter is 1."""
SMOOTH = 2
"""Pictures are drawn so many times as large, and made smaller."""

NIGHT, FLOOR, LINE, TEXT, DARK, LIT, GLOW = "#101720", "#18212c", "#5b6b7d", "#d7dee6", "#7d8b99", "#ff4632", "#5c2023"
COLOURS = 32


class Frame(NamedTuple):
    """What is shown of the steps of a frame."""

    time_s: float
    poses: FloatArray
    lit: BoolArray
    """(robots,) whether each ring was lit in any of the steps, as with an open shutter."""
    order_parameter: float | None
    """Order parameter at the last firing of the reference; None before the first."""


class Frames:
    """Gathers frames while a trial runs."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self._lit: list[BoolArray] = []

    def __call__(self, step: Step, state: TrialState) -> None:
        """Take a step."""
        self._lit.append(step.ring_on.copy())
        if len(self._lit) == STEPS_A_FRAME:
            lit = np.any(self._lit, axis=0)
            self.frames.append(Frame(state.time_s, step.poses.copy(), lit, state.order_parameter))
            self._lit = []


def main() -> None:
    """Simulate the trial and draw it."""
    scenario = load_scenario(SCENARIO, [FURTHER])
    assert isinstance(scenario, EmbodiedScenario)
    taken = Frames()
    run_trial(Simulation(scenario, SEED), [taken])
    drawn = [draw(scenario, taken.frames[: count + 1], len(taken.frames)) for count in range(len(taken.frames))]
    ends = Image.new("RGB", (WIDTH, 2 * HEIGHT))
    ends.paste(drawn[0])
    ends.paste(drawn[-1], (0, HEIGHT))
    palette = ends.quantize(COLOURS)  # one for all frames, or colours would flicker
    pictures = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in drawn]
    durations = [FRAME_MS] * (len(pictures) - 1) + [LAST_FRAME_MS]
    pictures[0].save(OUT, save_all=True, append_images=pictures[1:], duration=durations, loop=0, optimize=True)


def draw(scenario: EmbodiedScenario, frames: list[Frame], count: int) -> Image.Image:
    """Return the picture of the last of some frames of a trial that has `count` of them."""
    picture = Image.new("RGB", (WIDTH * SMOOTH, HEIGHT * SMOOTH), NIGHT)
    canvas = ImageDraw.Draw(picture)
    draw_robots(canvas, scenario, frames[-1])
    draw_flashes(canvas, frames, count)
    draw_order(canvas, scenario, frames, count)
    return picture.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def draw_robots(canvas: ImageDraw.ImageDraw, scenario: EmbodiedScenario, frame: Frame) -> None:
    """Draw the arena with the robots in it."""
    scale = ARENA / scenario.arena.width_cm
    box(canvas, MARGIN, MARGIN, MARGIN + ARENA, MARGIN + ARENA, fill=FLOOR, outline=LINE)
    radius = epuck.RADIUS_CM * scale
    for (x_cm, y_cm, heading), is_lit in zip(frame.poses, frame.lit, strict=True):
        x, y = MARGIN + x_cm * scale, MARGIN + ARENA - y_cm * scale
        if is_lit:
            disc(canvas, x, y, 1.45 * radius, GLOW)
        disc(canvas, x, y, radius, LIT if is_lit else DARK)
        line(canvas, [(x, y), (x + radius * math.cos(heading), y - radius * math.sin(heading))], FLOOR)


def draw_flashes(canvas: ImageDraw.ImageDraw, frames: list[Frame], count: int) -> None:
    """Draw the raster of flashes: a row for each robot, and a mark for each flash."""
    robots = len(frames[0].lit)
    label(canvas, RASTER_LEFT, RASTER_TOP - 26, "flashes of ten robots, one row each")
    step = (WIDTH - MARGIN - RASTER_LEFT) / count
    box(canvas, RASTER_LEFT, RASTER_TOP, WIDTH - MARGIN, RASTER_TOP + robots * ROW, fill=FLOOR, outline=LINE)
    for number, (before, frame) in enumerate(pairwise(frames), start=1):
        for robot in np.flatnonzero(frame.lit & ~before.lit).tolist():
            x, y = RASTER_LEFT + number * step, RASTER_TOP + robot * ROW
            box(canvas, x - 1, y + 3, x + 2, y + ROW - 3, fill=LIT)


def draw_order(canvas: ImageDraw.ImageDraw, scenario: EmbodiedScenario, frames: list[Frame], count: int) -> None:
    """Draw the order parameter, and the threshold of synchrony."""
    bottom = CURVE_TOP + CURVE_HEIGHT
    threshold = scenario.stop.order_parameter or 1
    values = [
        (number, frame.order_parameter) for number, frame in enumerate(frames) if frame.order_parameter is not None
    ]
    is_reached = bool(values) and values[-1][1] >= threshold
    label(canvas, RASTER_LEFT, CURVE_TOP - 26, f"order parameter: {'in step' if is_reached else 'not yet in step'}")
    label(canvas, WIDTH - MARGIN - 76, CURVE_TOP - 26, f"{frames[-1].time_s:6.1f} s")
    box(canvas, RASTER_LEFT, CURVE_TOP, WIDTH - MARGIN, bottom, fill=FLOOR, outline=LINE)
    y = bottom - threshold * RISE
    line(canvas, [(RASTER_LEFT, y), (WIDTH - MARGIN, y)], LINE)
    step = (WIDTH - MARGIN - RASTER_LEFT) / count
    line(canvas, [(RASTER_LEFT + number * step, bottom - value * RISE) for number, value in values], TEXT)


def box(canvas: ImageDraw.ImageDraw, left: float, top: float, right: float, bottom: float, **colours: str) -> None:
    """Draw a rectangle."""
    canvas.rectangle([SMOOTH * each for each in (left, top, right, bottom)], width=SMOOTH, **colours)


def disc(canvas: ImageDraw.ImageDraw, x: float, y: float, radius: float, colour: str) -> None:
    """Draw a disc."""
    canvas.ellipse([SMOOTH * each for each in (x - radius, y - radius, x + radius, y + radius)], fill=colour)


def line(canvas: ImageDraw.ImageDraw, points: list[tuple[float, float]], colour: str) -> None:
    """Draw a line through points."""
    canvas.line([(SMOOTH * x, SMOOTH * y) for x, y in points], fill=colour, width=2 * SMOOTH)


def label(canvas: ImageDraw.ImageDraw, x: float, y: float, text: str) -> None:
    """Write a line of text."""
    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), 16 * SMOOTH)
    canvas.text((SMOOTH * x, SMOOTH * y), text, fill=TEXT, font=font)


if __name__ == "__main__":
    main()
