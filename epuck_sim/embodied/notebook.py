"""How simulations of robots and their steps show themselves in notebooks."""

from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.display.arena_svg import DARK, LIT, draw_arena
from epuck_sim.display.html import element, table, to_html
from epuck_sim.scenario.embodied import EmbodiedScenario

if TYPE_CHECKING:  # a step shows itself by this module
    from epuck_sim.embodied.step import Step

MOST_ROBOTS = 50
"""Maximum number of robots in a table."""

PIXEL_PX, ROW_PX = 2, 12
"""Width and height of a camera's pixel in a table, in pixels of the screen."""

HEADINGS = ("robot", "x [cm]", "y [cm]", "heading [rad]", "nearest [mm]", "camera", "wheels [cm/s]", "ring")


def show_simulation(scenario: EmbodiedScenario, seed: int, step: "Step") -> str:
    """Return the arena with the robots at a step as HTML; before the first step, where they were placed."""
    when = f"step {step.number}, {step.time_s:.1f} s" if step.number >= 0 else "before its first step"
    radii_cm = [kind.radius_cm for kind in scenario.robot_kinds]
    drawn = draw_arena(step.arena, step.poses, radii_cm, step.ring_on)
    return to_html(element("p", element("b", scenario.name), f", seed {seed}: {when}"), drawn)


def show_step(step: "Step") -> str:
    """Return a table of what robots sensed and command at a step as HTML."""
    head = element("p", element("b", f"Step {step.number}"), f", {step.time_s:.1f} s")
    readings = step.readings
    robots = range(min(len(step.poses), MOST_ROBOTS))
    rows = (
        [
            str(robot),
            *(f"{value:.1f}" for value in step.poses[robot, :2]),
            f"{step.poses[robot, 2]:.2f}",
            _nearest(step.distance_mm[robot]),
            _draw_camera(step.camera[robot]),
            ", ".join(f"{value:.1f}" for value in step.wheels_cm_s[robot]),
            "lit" if step.ring_on[robot] else "dark",
            *(_in_words(values[robot]) for values in readings.values()),
        ]
        for robot in robots
    )
    rest = len(step.poses) - len(robots)
    more = [element("p", f"and {rest} robots more")] * bool(rest)
    return to_html(head, table((*HEADINGS, *readings), rows), *more)


def _in_words(reading: FloatArray) -> str:
    """Return a robot's reading of a sensor in a file of its own, one number or an array."""
    return ", ".join("-" if np.isnan(value) else f"{value:.3g}" for value in reading.ravel().tolist())


def _nearest(distance_mm: IntArray) -> str:
    nearest = int(distance_mm.min())
    return "-" if nearest >= epuck.OUT_OF_RANGE_MM else str(nearest)


def _draw_camera(row: IntArray) -> Element:
    """Return a camera's row, (pixels,), as a strip that is red where a lit ring is seen."""
    red = (
        element("rect", x=PIXEL_PX * pixel, width=PIXEL_PX, height=ROW_PX, fill=LIT)
        for pixel in np.flatnonzero(row).tolist()
    )
    width = PIXEL_PX * len(row)
    return element("svg", element("rect", width=width, height=ROW_PX, fill=DARK), *red, width=width, height=ROW_PX)
