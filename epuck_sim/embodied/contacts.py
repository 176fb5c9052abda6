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
        (contacts, 3) step, robot, and the robot that it touches, or -1: a wall, obstacle or movable; in the
        order of the steps. And (contacts, 2) cm: points of contact. Two robots have one, midway between them; on other
        things it is the point nearest to the robot.
    """
    room = len(poses) * poses.shape[1]
    found, points = np.empty((room, 3), np.int64), np.empty((room, 2))
    contacts = write_contacts(poses, *surfaces_of(arena), cells, found, points)
    if contacts > room:
        found, points = np.empty((contacts, 3), np.int64), np.empty((contacts, 2))
        write_contacts(poses, *surfaces_of(arena), cells, found, points)
    return found[:contacts], points[:contacts]


def surfaces_of(arena: Arena) -> tuple[float, float, FloatArray, FloatArray, IntArray]:
    """Return width and height, cm, of an arena, its circles and edges, and where each polygon begins in the edges."""
    corners = np.cumsum([0, *map(len, arena.polygons)])
    return float(arena.width_cm), float(arena.height_cm), arena.circles, arena.edges, corners


@jit
def write_contacts(
    poses: FloatArray,
    width_cm: float,
    height_cm: float,
    circles: FloatArray,
    edges: FloatArray,
    corners: IntArray,
    cells: CellList,
    found: IntArray,
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
            contacts = _find_robot_contacts(poses[step], robot, cells, step, found, points, contacts)
            for wall_x, wall_y in ((0.0, y), (width_cm, y), (x, 0.0), (x, height_cm)):
                if abs(wall_x - x) + abs(wall_y - y) <= reach:
                    contacts = _add_contact(step, robot, -1, wall_x, wall_y, found, points, contacts)
            for circle in circles:
                dx, dy = x - circle[0], y - circle[1]
                distance = math.sqrt(dx * dx + dy * dy)
                if 0.0 < distance <= circle[2] + reach:
                    share = circle[2] / distance
                    near_x, near_y = circle[0] + share * dx, circle[1] + share * dy
                    contacts = _add_contact(step, robot, -1, near_x, near_y, found, points, contacts)
            for polygon in range(len(corners) - 1):
                near_x, near_y = _nearest_point(edges[corners[polygon] : corners[polygon + 1]], x, y)
                if (near_x - x) ** 2 + (near_y - y) ** 2 <= reach * reach:
                    contacts = _add_contact(step, robot, -1, near_x, near_y, found, points, contacts)
    return contacts


@jit
def _find_robot_contacts(
    poses: FloatArray, robot: int, cells: CellList, step: int, found: IntArray, points: FloatArray, contacts: int
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
                middle_x, middle_y = x + 0.5 * dx, y + 0.5 * dy
                contacts = _add_contact(step, robot, other, middle_x, middle_y, found, points, contacts)
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
def _add_contact(
    step: int, robot: int, other: int, x: float, y: float, found: IntArray, points: FloatArray, contacts: int
) -> int:
    """Write a contact if there is room; return the number of contacts so far."""
    if contacts < len(found):
        found[contacts] = step, robot, other
        points[contacts] = x, y
    return contacts + 1
