"""Checks whether robots of their kind fit into the arena, and can do what a scenario asks of them."""

import math
from collections.abc import Sequence

from epuck_sim.epuck import GRID_SPACING_CM
from epuck_sim.scenario.arena import ArenaSection
from epuck_sim.scenario.robot_kind import RobotKind
from epuck_sim.scenario.robots import RobotGroup

STEP_CM = 0.13
"""Largest distance in cm that wheels may drive in a physics step: bodies that meet head-on overlap by 1 mm at most."""


def check_robots(robot: RobotKind, groups: Sequence[RobotGroup], arena: ArenaSection, physics_hz: int) -> None:
    """Check the robots of a scenario.

    Args:
        robot: What kind of robots they are.
        groups: The groups of robots.
        arena: The arena.
        physics_hz: Physics steps in a second.

    Raises:
        ValueError: They do not fit into the arena, are too fast, or lack what a group needs.
    """
    _check_room(2 * robot.radius_cm, sum(group.count for group in groups), arena)
    if robot.wheel_limit_cm_s > STEP_CM * physics_hz:
        raise ValueError(
            f"robot.wheel_limit_cm_s is {robot.wheel_limit_cm_s:g}; allowed: up to {STEP_CM * physics_hz:g} at "
            f"timing.physics_hz {physics_hz}: faster robots would overlap before a contact is found; give a higher "
            "physics_hz"
        )
    for number, group in enumerate(groups):
        if robot.camera is None and group.signal.kind == "camera":
            raise ValueError(
                f"robots.{number}.signal.kind is 'camera', and the robot {robot.kind!r} has none; allowed: cone or "
                "radio, as in signal: {kind: radio, range_cm: 10}"
            )
        if group.placement == "grid" and 2 * robot.radius_cm > GRID_SPACING_CM:
            raise ValueError(
                f"robots.{number}.placement is 'grid', whose points are {GRID_SPACING_CM:g} cm apart, and robots "
                f"are {2 * robot.radius_cm:g} cm wide; allowed: random or poses"
            )


def _check_room(diameter_cm: float, robots: int, arena: ArenaSection) -> None:
    """Raise ValueError if so many robots of a diameter do not fit into the arena."""
    for key, side_cm in (("width_cm", arena.width_cm), ("height_cm", arena.height_cm)):
        if side_cm < diameter_cm:
            raise ValueError(f"arena.{key}: is {side_cm:g}; allowed: at least {diameter_cm:g}")
    densest = math.pi / math.sqrt(12)  # of equal discs in the plane
    if robots * math.pi * (diameter_cm / 2) ** 2 > densest * arena.width_cm * arena.height_cm:
        raise ValueError(
            f"{robots} robots of {diameter_cm:g} cm do not fit into the arena of "
            f"{arena.width_cm:g} x {arena.height_cm:g} cm; give fewer robots or a larger arena"
        )
