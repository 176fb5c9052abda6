"""Contacts: the points where robots are close enough to each other, a wall or an obstacle to push.

For observers only. The simulated bodies are pymunk's, which resolves contacts several times in a control step.
"""

import math

import numpy as np

from epuck_sim import epuck
from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.embodied.cell_list import CellList, cells_around, members_in_row, sort_into_cells
from epuck_sim.embodied.contact_candidates import MARGIN_CM
from epuck_sim.util.jit import jit

GAP_CM = 2 * MARGIN_CM
"""Largest gap between two surfaces in contact, cm: pymunk, too, has noticed them by then (see `rigid_bodies`)."""

_RADIUS = epuck.RADIUS_CM


def find_contacts(poses: FloatArray, arena: Arena, cells: CellList) -> tuple[IntArray, FloatArray]:
    """Find the contacts in some steps.

    Args:
        poses: (steps, robots, 3) cm, cm, rad: x, y, heading.
        arena: Walls and obstacles.
        cells: A cell list of the arena, which is overwritten.

    Returns:
        (contacts,) steps, in their order, and (contacts, 2) cm: points of contact. Two robots have one, midway between
        them; on walls and obstacles it is the point nearest to the robot.
    """
    corners = np.cumsum([0, *map(len, arena.polygons)])
    surfaces = (float(arena.width_cm), float(arena.height_cm), arena.circles, arena.edges, corners)
    room = len(poses) * poses.shape[1]
    steps, points = np.empty(room, np.int64), np.empty((room, 2))
    contacts = _write_contacts(poses, *surfaces, cells, steps, points)
    if contacts > room:
        steps, points = np.empty(contacts, np.int64), np.empty((contacts, 2))
        _write_contacts(poses, *surfaces, cells, steps, points)
    return steps[:contacts], points[:contacts]


@jit
def _write_contacts(
    poses: FloatArray,
    width_cm: float,
    height_cm: float,
    circles: FloatArray,
    edges: FloatArray,
    corners: IntArray,
    cells: CellList,
    steps: IntArray,
    points: FloatArray,
) -> int:
    """Write what `find_contacts` returns, as far as there is room; return the number of contacts.

    corners: (polygons + 1,) index in `edges` of each polygon's first edge.
    """
    reach = _RADIUS + GAP_CM
    contacts = 0
    for step in range(len(poses)):
        sort_into_cells(poses[step], cells)
        for robot in range(poses.shape[1]):
            x, y = poses[step, robot, 0], poses[step, robot, 1]
            contacts = _find_robot_contacts(poses[step], robot, cells, step, steps, points, contacts)
            for wall_x, wall_y in ((0.0, y), (width_cm, y), (x, 0.0), (x, height_cm)):
                if abs(wall_x - x) + abs(wall_y - y) <= reach:
                    contacts = _add_contact(step, wall_x, wall_y, steps, points, contacts)
            for circle in circles:
                dx, dy = x - circle[0], y - circle[1]
                distance = math.sqrt(dx * dx + dy * dy)
                if 0.0 < distance <= circle[2] + reach:
                    share = circle[2] / distance
                    contacts = _add_contact(
                        step, circle[0] + share * dx, circle[1] + share * dy, steps, points, contacts
                    )
            for polygon in range(len(corners) - 1):
                near_x, near_y = _nearest_point(edges[corners[polygon] : corners[polygon + 1]], x, y)
                if (near_x - x) ** 2 + (near_y - y) ** 2 <= reach * reach:
                    contacts = _add_contact(step, near_x, near_y, steps, points, contacts)
    return contacts


@jit
def _find_robot_contacts(
    poses: FloatArray, robot: int, cells: CellList, step: int, steps: IntArray, points: FloatArray, contacts: int
) -> int:
    """Write the contacts of a robot with those of higher numbers; return the number of contacts so far."""
    x, y = poses[robot, 0], poses[robot, 1]
    apart = 2.0 * _RADIUS + GAP_CM
    block = cells_around(x, y, cells)
    for row in range(block.first_row, block.end_row):
        start, end = members_in_row(block, row, cells)
        for other in cells.members[start:end]:
            dx, dy = poses[other, 0] - x, poses[other, 1] - y
            if other > robot and dx * dx + dy * dy <= apart * apart:
                contacts = _add_contact(step, x + 0.5 * dx, y + 0.5 * dy, steps, points, contacts)
    return contacts


@jit
def _nearest_point(edges: FloatArray, x: float, y: float) -> tuple[float, float]:
    """Return the point on a polygon's (m, 4) edges that is nearest to (x, y)."""
    nearest_x, nearest_y, nearest = math.inf, math.inf, math.inf
    for edge in edges:
        along_x, along_y = edge[2] - edge[0], edge[3] - edge[1]
        share = ((x - edge[0]) * along_x + (y - edge[1]) * along_y) / (along_x * along_x + along_y * along_y)
        share = min(max(share, 0.0), 1.0)
        near_x, near_y = edge[0] + share * along_x, edge[1] + share * along_y
        distance = (near_x - x) ** 2 + (near_y - y) ** 2
        if distance < nearest:
            nearest_x, nearest_y, nearest = near_x, near_y, distance
    return nearest_x, nearest_y


@jit
def _add_contact(step: int, x: float, y: float, steps: IntArray, points: FloatArray, contacts: int) -> int:
    """Write a contact if there is room; return the number of contacts so far."""
    if contacts < len(steps):
        steps[contacts] = step
        points[contacts] = x, y
    return contacts + 1
