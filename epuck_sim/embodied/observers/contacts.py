"""Contacts: the points where robots are close enough to each other, a wall or an obstacle to push.

The simulated bodies are pymunk's, which resolves contacts several times in a control step.
"""

import math
from typing import Any

import numpy as np

from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.embodied.bodies.lone_contacts import MARGIN_CM
from epuck_sim.embodied.cells import cells_around, members_in_row
from epuck_sim.embodied.observers.scene import Scene, place_robots
from epuck_sim.embodied.swarm import Swarm, swarm_at
from epuck_sim.util.jit import jit

GAP_CM = 2 * MARGIN_CM
"""Largest gap between two surfaces in contact, cm: pymunk, too, has noticed them by then (see `bodies`)."""


def find_contacts(scene: Scene, poses: FloatArray) -> tuple[IntArray, FloatArray]:
    """Find the contacts in some steps.

    Args:
        scene: The arena and its robots.
        poses: (steps, robots, 3) cm, cm, rad: x, y, heading of all robots.

    Returns:
        (contacts, 3) step, robot, and the robot that it touches, or -1: a wall, obstacle or movable; in the
        order of the steps. And (contacts, 2) cm: points of contact. Two robots have one, between their surfaces; on
        other things it is the point nearest to the robot.
    """
    room = len(poses) * poses.shape[1]
    found, points = np.empty((room, 3), np.int64), np.empty((room, 2))
    contacts = write_contacts(scene.block, poses, found, points)
    if contacts > room:
        found, points = np.empty((contacts, 3), np.int64), np.empty((contacts, 2))
        write_contacts(scene.block, poses, found, points)
    return found[:contacts], points[:contacts]


@jit
def write_contacts(block: ByteArray, poses: FloatArray, found: IntArray, points: FloatArray) -> int:
    """Write what `find_contacts` returns, as far as there is room; return the number of contacts."""
    swarm = swarm_at(block)
    scene = swarm.scene[0]
    contacts = 0
    for step in range(len(poses)):
        place_robots(swarm, poses[step])
        for robot in range(len(swarm.robots)):
            x, y, reach = poses[step, robot, 0], poses[step, robot, 1], swarm.robots[robot].radius_cm + GAP_CM
            contacts = _touch_robots(swarm, robot, step, found, points, contacts)
            for wall_x, wall_y in ((0.0, y), (scene.width_cm, y), (x, 0.0), (x, scene.height_cm)):
                if abs(wall_x - x) + abs(wall_y - y) <= reach:
                    contacts = _add(step, robot, -1, wall_x, wall_y, found, points, contacts)
            for place in range(scene.circles):
                circle = swarm.circles[place]
                dx, dy = x - circle.x, y - circle.y
                distance = math.sqrt(dx * dx + dy * dy)
                if 0.0 < distance <= circle.radius + reach:
                    share = circle.radius / distance
                    near_x, near_y = circle.x + share * dx, circle.y + share * dy
                    contacts = _add(step, robot, -1, near_x, near_y, found, points, contacts)
            edge = 0
            while edge < scene.edges:
                near_x, near_y, edge = _nearest_point(swarm.edges, scene.edges, edge, x, y)
                if (near_x - x) ** 2 + (near_y - y) ** 2 <= reach * reach:
                    contacts = _add(step, robot, -1, near_x, near_y, found, points, contacts)
    return contacts


@jit
def _touch_robots(swarm: Swarm, robot: int, step: int, found: IntArray, points: FloatArray, contacts: int) -> int:
    """Write the contacts of a robot with those of higher numbers; return the number of contacts so far."""
    x, y, radius = swarm.robots[robot].x, swarm.robots[robot].y, swarm.robots[robot].radius_cm
    near = cells_around(x, y, swarm.scene[0])
    for row in range(near.first_row, near.end_row):
        start, end = members_in_row(near, row, swarm)
        for place in range(start, end):
            member = swarm.members[place]
            dx, dy, both = member.x - x, member.y - y, radius + member.radius_cm
            if member.robot > robot and dx * dx + dy * dy <= (both + GAP_CM) * (both + GAP_CM):
                share = radius / both
                contacts = _add(step, robot, member.robot, x + share * dx, y + share * dy, found, points, contacts)
    return contacts


@jit
def _nearest_point(edges: Any, count: int, first: int, x: float, y: float) -> tuple[float, float, int]:
    """Return the point of the polygon from edge `first` on that is nearest to (x, y), and the edge after its last."""
    nearest_x, nearest_y, nearest = math.inf, math.inf, math.inf
    polygon, place = edges[first].polygon, first
    while place < count and edges[place].polygon == polygon:
        edge = edges[place]
        along_x, along_y = edge.bx - edge.ax, edge.by - edge.ay
        share = ((x - edge.ax) * along_x + (y - edge.ay) * along_y) / (along_x * along_x + along_y * along_y)
        share = min(max(share, 0.0), 1.0)
        near_x, near_y = edge.ax + share * along_x, edge.ay + share * along_y
        distance = (near_x - x) ** 2 + (near_y - y) ** 2
        if distance < nearest:
            nearest_x, nearest_y, nearest = near_x, near_y, distance
        place += 1
    return nearest_x, nearest_y, place


@jit
def _add(
    step: int, robot: int, other: int, x: float, y: float, found: IntArray, points: FloatArray, contacts: int
) -> int:
    """Write a contact if there is room; return the number of contacts so far."""
    if contacts < len(found):
        found[contacts, 0], found[contacts, 1], found[contacts, 2] = step, robot, other
        points[contacts, 0], points[contacts, 1] = x, y
    return contacts + 1
