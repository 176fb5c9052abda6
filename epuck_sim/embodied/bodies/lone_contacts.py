"""Contacts of one robot with walls alone, or of two robots with each other alone, without friction.

They are the arithmetic that Chipmunk itself does for them, with equal outcomes but for rounding, and without the time
that its space takes. In each physics step bodies move; then those that touch lose the speed at which they approach,
shared by their masses; and what they overlap beyond `SLOP_CM` is moved apart in the next physics step.
"""

import math
from typing import Any, NamedTuple

from epuck_sim.embodied.swarm import Swarm
from epuck_sim.util.jit import jit_inline, jit_no_alloc

MARGIN_CM = 0.08
"""Margin in cm by which bodies are enlarged; overlaps of up to twice the margin are not corrected.

pymunk detects a contact only after bodies overlap, and two e-pucks that meet head-on at full speed approach by 2.56 mm
in a physics step. Margins make it detect contacts 1.6 mm earlier, so that real bodies overlap by less than 1 mm, and
robots that press on something come to rest where their real surfaces touch. Scenarios refuse wheels that are too fast
for this.
"""

SLOP_CM = 2 * MARGIN_CM
"""Overlap of enlarged bodies that is not corrected."""

_ROUNDING_CM = 1e-9


class Motion(NamedTuple):
    """Where a robot is, and the only other one that it may touch, and how fast, cm and cm/s."""

    x: float
    y: float
    vx: float
    vy: float
    other_x: float
    other_y: float
    other_vx: float
    other_vy: float
    is_exact: bool
    """Whether Chipmunk would have moved them there, and would have nothing left to correct."""


@jit_no_alloc
def lone_motion(swarm: Swarm, number: int, steps: int, reach_cm: float) -> Motion:
    """Return where some physics steps take a robot and its partner.

    Neither may come farther than `reach_cm`, or else touches what nobody has looked for.
    """
    scene, robot = swarm.scene[0], swarm.robots[number]
    if robot.partner != number:
        return _push(robot, swarm.robots[robot.partner], steps, scene.physics_s, reach_cm)
    x, vx, x_exact = _slide(robot.x, robot.vx, robot.radius_cm, scene.width_cm, steps, scene.physics_s)
    y, vy, y_exact = _slide(robot.y, robot.vy, robot.radius_cm, scene.height_cm, steps, scene.physics_s)
    return Motion(x, y, vx, vy, x, y, vx, vy, x_exact and y_exact)


@jit_inline
def _slide(
    place: float, speed: float, radius_cm: float, length_cm: float, steps: int, step_s: float
) -> tuple[float, float, bool]:
    """Return place and speed along an axis after some physics steps between two walls, and whether they are exact."""
    back, end = 0.0, length_cm - radius_cm
    is_exact = radius_cm - _ROUNDING_CM <= place <= end + _ROUNDING_CM
    for _ in range(steps):
        place += (speed + back) * step_s
        back = 0.0
        if place <= radius_cm + SLOP_CM:
            speed, back = max(speed, 0.0), max(radius_cm - place, 0.0) / step_s
        elif place >= end - SLOP_CM:
            speed, back = min(speed, 0.0), min(end - place, 0.0) / step_s
    return place, speed, is_exact and abs(back) * step_s <= _ROUNDING_CM


@jit_inline
def _push(one: Any, other: Any, steps: int, step_s: float, reach_cm: float) -> Motion:
    """Return where two robots are after some physics steps."""
    together_cm = one.radius_cm + other.radius_cm
    share = other.mass_g / (one.mass_g + other.mass_g)  # of a change of speed that the first one takes
    x, y, vx, vy = one.x, one.y, one.vx, one.vy
    other_x, other_y, other_vx, other_vy = other.x, other.y, other.vx, other.vy
    dx, dy, apart_s = other_x - x, other_y - y, 0.0
    farthest = 0.0
    is_exact = math.sqrt(dx * dx + dy * dy) >= together_cm - _ROUNDING_CM
    for _ in range(steps):
        # apart_s: velocity, as a share of (dx, dy), with which the two are moved apart
        x += (vx - share * apart_s * dx) * step_s
        y += (vy - share * apart_s * dy) * step_s
        other_x += (other_vx + (1.0 - share) * apart_s * dx) * step_s
        other_y += (other_vy + (1.0 - share) * apart_s * dy) * step_s
        farthest = max(
            farthest, (x - one.x) ** 2 + (y - one.y) ** 2, (other_x - other.x) ** 2 + (other_y - other.y) ** 2
        )
        dx, dy, apart_s = other_x - x, other_y - y, 0.0
        square = dx * dx + dy * dy
        if square >= (together_cm + SLOP_CM) ** 2:
            continue
        approach_s = max(-((other_vx - vx) * dx + (other_vy - vy) * dy) / square, 0.0)
        vx, vy = vx - share * approach_s * dx, vy - share * approach_s * dy
        other_vx, other_vy = other_vx + (1.0 - share) * approach_s * dx, other_vy + (1.0 - share) * approach_s * dy
        distance = math.sqrt(square)
        apart_s = max(together_cm - distance, 0.0) / (step_s * distance)
    left_cm = apart_s * step_s * math.sqrt(dx * dx + dy * dy)
    is_exact = is_exact and farthest <= reach_cm * reach_cm and left_cm <= _ROUNDING_CM
    return Motion(x, y, vx, vy, other_x, other_y, other_vx, other_vy, is_exact)


@jit_no_alloc
def move_lone(swarm: Swarm, number: int, steps: int) -> None:
    """Move a robot and its partner by some physics steps."""
    robot = swarm.robots[number]
    other, time_s = swarm.robots[robot.partner], steps * swarm.scene[0].physics_s
    moved = lone_motion(swarm, number, steps, math.inf)
    other.x, other.y = moved.other_x, moved.other_y
    robot.x, robot.y = moved.x, moved.y
    robot.heading += robot.spin * time_s
    if robot.partner != number:
        other.heading += other.spin * time_s
