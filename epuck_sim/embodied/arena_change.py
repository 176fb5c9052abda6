"""Walls and obstacles that change while a trial of robots runs."""

import numpy as np

from epuck_sim import epuck
from epuck_sim.arena import Arena, clearance_cm, without_movables
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.cell_list import CellList
from epuck_sim.embodied.contact_candidates import MARGIN_CM
from epuck_sim.embodied.group import RobotGroupState
from epuck_sim.errors import ScenarioError

DEEPEST_CM = 2 * MARGIN_CM
"""How far a body may reach into new walls and obstacles, cm: as far as bodies may overlap that press on each other."""


def check_bodies_outside(arena: Arena, poses: FloatArray, present: BoolArray, origin: str) -> None:
    """Raise ScenarioError if a robot or a movable would be in a wall or an obstacle, or beyond the walls.

    Args:
        arena: The new arena, with its movables where they are now.
        poses: (robots, 3) cm, cm, rad: x, y, heading.
        present: (robots,) whether each robot is in the arena.
        origin: Begins the message: what changes the arena, and when.
    """
    fixed = without_movables(arena)
    bodies = [(f"robot {robot}", *poses[robot, :2].tolist(), epuck.RADIUS_CM) for robot in np.flatnonzero(present)]
    movables = arena.circles[arena.first_movable :].tolist()
    bodies += [(f"movable {number}", x, y, radius) for number, (x, y, radius) in enumerate(movables)]
    for name, x, y, radius in bodies:
        overlap_cm = radius - clearance_cm(fixed, x, y)
        if overlap_cm > DEEPEST_CM:
            raise ScenarioError(
                f"{origin}: {name} at [{x:.4g}, {y:.4g}] would be {overlap_cm:.3g} cm into a wall or an obstacle; "
                "change the arena where, and when, no body is"
            )


def in_arena(group: RobotGroupState, arena: Arena, cells: CellList) -> RobotGroupState:
    """Return a group that senses in another arena; cells: its cell list."""
    sensing = group.sensing._replace(
        width_cm=arena.width_cm,
        height_cm=arena.height_cm,
        circles=arena.circles,
        edges=arena.edges,
        cells=cells,
    )
    return group._replace(sensing=sensing)
