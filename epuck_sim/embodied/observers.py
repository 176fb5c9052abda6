"""Robots as seen from outside: who sees whose ring, and what robots touch, in any step or the present one.

Observers of many steps put poses into a scene with a block of its own; a `Step` looks at the simulation's. Robots
themselves see red pixels, and cannot tell which robot a pixel shows; they do not feel contacts, which pymunk resolves
several times in a control step.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from epuck_sim.embodied.bodies.contacts import SLOP_CM
from epuck_sim.embodied.cells import cells_around, members_in_row, sort_into_cells
from epuck_sim.embodied.layout import furnish, room_for
from epuck_sim.embodied.sensors.camera import list_seen, see
from epuck_sim.embodied.sensors.sight import add_pair, list_labelled
from epuck_sim.embodied.sensors.signals import perceives
from epuck_sim.embodied.swarm import BYTE, Swarm, make_block, open_block, swarm_at
from epuck_sim.scenario.embodied import TimingSection
from epuck_sim.scenario.robot_kind import RobotKind
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import array_at


class Scene(NamedTuple):
    """An arena with groups of robots, and with their sensors of flashes."""

    groups: Sequence[RobotGroup]
    block: ByteArray  # the swarm; observers write poses, cells and scratch numbers
    swarm: Swarm  # the arrays of the block


def make_scene(groups: Sequence[RobotGroup], kinds: Sequence[RobotKind], arena: Arena) -> Scene:
    """Return a scene in a block of its own; its robots, of each group's kind, have no places yet."""
    block = make_block(room_for(groups, kinds, [arena]))
    swarm = open_block(block)
    furnish(swarm, groups, kinds, arena, TimingSection())
    return Scene(groups, block, swarm)


@jit_inline
def place_robots(block: ByteArray, poses: FloatArray) -> None:
    """Put robots at (robots, 3) poses, cm, cm, rad, and sort them into cells."""
    robots = swarm_at(block).robots
    for robot in range(len(robots)):
        record = robots[robot]
        record.x, record.y, record.heading = poses[robot, 0], poses[robot, 1], poses[robot, 2]
    sort_into_cells(block)


def with_room(write: Callable[..., int], *arrays: Any) -> Any:
    """Return arrays up to the rows that a function writes; it writes longer ones if these have too few rows."""
    count = write(*map(np.ravel, arrays))
    if count <= len(arrays[0]):
        return [array[:count] for array in arrays]
    return with_room(write, *(np.empty((count, array.shape[1]), array.dtype) for array in arrays))


MANY_SEEN = 16  # number of robots in view for which there is room at first: hardly any robot sees more on average


def find_sightings(
    scene: Scene, poses: FloatArray, present: BoolArray | None = None, listed: BoolArray | None = None
) -> IntArray:
    """Find the robots that robots see in some steps.

    A camera sees a robot if a pixel of the central window shows it; a robot that shows on both sides of an obstacle
    counts once. The ideal sensor and Enki's camera see robots whose rings they would perceive; a radio sees none.

    Poses are (steps, robots, 3) cm, cm, rad; `present`, (robots,), flags the robots that look, and `listed`, (steps,
    robots), those that can be seen, by default all. Return (sightings, 3) step, observer, robot seen: ordered by step,
    by observer, and from left to right, or, for the ideal sensor and Enki's camera, by the number of the robot seen.
    """
    parts, listed = [np.empty((0, 3), np.int64)], np.ones(poses.shape[:2], np.bool_) if listed is None else listed
    for number, group in enumerate(scene.groups):
        if group.signal.kind != "radio":
            kernel = write_seen if group.signal.kind == "camera" else write_perceived
            write = partial(kernel, scene.block, number, poses, listed)
            room = min(poses.shape[1], MANY_SEEN) * len(poses) * group.count
            parts += with_room(write, np.empty((room, 3), np.int64))
    found: IntArray = np.concatenate(parts)
    if len(scene.groups) > 1:
        found = found[np.argsort(found[:, 0], kind="stable")]
    return found if present is None or present.all() else found[present[found[:, 1]]]


@jit_no_alloc
def write_seen(block: ByteArray, number: int, poses: FloatArray, listed: BoolArray, found: IntArray) -> int:
    """Write whom the cameras of a group see, as far as there is room; return the number of all sightings."""
    swarm = swarm_at(block)
    group, robots, sightings = swarm.groups[number], len(swarm.robots), 0
    row = swarm.numbers[2 * robots : 2 * robots + group.pixels]
    for step in range(len(poses)):
        lit = _show(block, poses, listed, step)
        for observer in range(group.first, group.first + group.count if lit > 0 else 0):
            for pixel in range(group.pixels):
                row[pixel] = 0
            if see(swarm, group, observer, lit, row):
                sightings = list_seen(step, observer, row, found, sightings)
    return sightings


@jit_no_alloc
def write_perceived(block: ByteArray, number: int, poses: FloatArray, listed: BoolArray, found: IntArray) -> int:
    """Write what `write_seen` does, for a group with another sensor of flashes."""
    swarm = swarm_at(block)
    group, sightings = swarm.groups[number], 0
    for step in range(len(poses)):
        lit = _show(block, poses, listed, step)
        for observer in range(group.first, group.first + group.count if lit > 0 else 0):
            for place in range(lit):
                if perceives(swarm, group.cone, observer, swarm.numbers[place]):
                    sightings = add_pair(step, observer, swarm.numbers[place], found, sightings)
    return sightings


@jit_inline
def _show(block: ByteArray, poses: FloatArray, listed: BoolArray, step: int) -> int:
    """Label the robots that can be seen in a step, and put all in their places if there are any; return how many."""
    swarm = swarm_at(block)
    robots = len(swarm.robots)
    for robot in range(robots):
        swarm.numbers[robots + robot] = robot + 1 if listed[step, robot] else 0
    lit = list_labelled(swarm)
    if lit > 0:
        place_robots(block, poses[step])
    return lit


def find_contacts(scene: Scene, poses: FloatArray) -> tuple[IntArray, FloatArray]:
    """Find the contacts in some steps, at (steps, robots, 3) poses, cm, cm, rad.

    Return (contacts, 3) step, robot, and the robot that it touches, or -1 for a wall, obstacle or movable, in the order
    of steps; and (contacts, 2) cm, points of contact: between the two robots' surfaces, or nearest on the other body.
    """
    room, write = len(poses) * poses.shape[1], partial(write_contacts, scene.block, poses)
    found, points = with_room(write, np.empty((room, 3), np.int64), np.empty((room, 2)))
    return found, points


@jit_no_alloc
def write_contacts(block: ByteArray, poses: FloatArray, found: IntArray, points: FloatArray) -> int:
    """Write the contacts that `find_contacts` returns, as far as there is room; return the number of all."""
    swarm = swarm_at(block)
    scene = swarm.scene[0]
    count = 0
    for step in range(len(poses)):
        place_robots(block, poses[step])
        for robot in range(len(swarm.robots)):
            x, y, radius = poses[step, robot, 0], poses[step, robot, 1], swarm.robots[robot].radius_cm
            reach = radius + SLOP_CM  # pymunk, too, has noticed a contact by then (see `bodies`)
            near = cells_around(x, y, scene)
            for row in range(near.first_row, near.end_row):
                start, end = members_in_row(near, row, swarm)
                for place in range(start, end):
                    other = swarm.members[place]
                    dx, dy, both = other.x - x, other.y - y, radius + other.radius_cm
                    if other.robot > robot and dx * dx + dy * dy <= (both + SLOP_CM) * (both + SLOP_CM):
                        share = radius / both
                        touched = x + share * dx, y + share * dy
                        count = _add_contact(step, robot, other.robot, touched, found, points, count)
            for touched in ((0.0, y), (scene.width_cm, y), (x, 0.0), (x, scene.height_cm)):
                if abs(touched[0] - x) + abs(touched[1] - y) <= reach:
                    count = _add_contact(step, robot, -1, touched, found, points, count)
            for place in range(scene.circles):
                circle = swarm.circles[place]
                dx, dy = x - circle.x, y - circle.y
                distance = math.sqrt(dx * dx + dy * dy)
                if 0.0 < distance <= circle.radius + reach:
                    share = circle.radius / distance
                    touched = circle.x + share * dx, circle.y + share * dy
                    count = _add_contact(step, robot, -1, touched, found, points, count)
            edge = 0
            while edge < scene.edges:
                touched, edge = _nearest_point(swarm.edges, scene.edges, edge, x, y)
                if (touched[0] - x) ** 2 + (touched[1] - y) ** 2 <= reach * reach:
                    count = _add_contact(step, robot, -1, touched, found, points, count)
    return count


@jit_no_alloc
def observe_together(
    block: ByteArray,
    places: IntArray,
    agents: IntArray,
    infrared: int,
    wheels: int,
    poses: FloatArray,
    seen: Float32Array,
    contacts: IntArray,
    found: IntArray,
    points: FloatArray,
) -> int:
    """Write what agents of swarms observe, and how many bodies robots touch; for `places` see `loop.act_together`.

    The columns of `seen`, (swarms, agents, columns), are pixels; from `infrared` on, readings as shares of the largest
    one; from `wheels` on, both wheels as shares of their limit, and the ring. `contacts` are those of all robots,
    (swarms, robots), at their `poses`. Return for how many `found` and `points` need room: see `write_contacts`.
    """
    most = 0
    for number in range(len(places)):
        own = array_at(block, places[number, 0], places[number, 0] + len(block), BYTE)
        swarm, place = swarm_at(own), 0
        for agent in range(len(agents)):
            robot, row = swarm.robots[agents[agent]], seen[number, agent]
            while swarm.groups[place].first + swarm.groups[place].count <= agents[agent]:
                place += 1  # agents ascend
            group = swarm.groups[place]
            first = group.row + (agents[agent] - group.first) * group.pixels
            for pixel in range(group.pixels):
                row[pixel] = swarm.pixels[first + pixel]
            for sensor in range(group.infrared.count):
                share = robot.sensors.infrared[sensor] / group.infrared.peak_counts
                row[infrared + sensor] = min(max(share, 0.0), 1.0)
            limit = robot.wheel_limit_cm_s
            row[wheels], row[wheels + 1] = robot.left_cm_s / limit, robot.right_cm_s / limit
            row[wheels + 2] = robot.ring_on
        count = write_contacts(own, poses[number : number + 1], found, points)
        for touching in range(len(swarm.robots)):
            contacts[number, touching] = 0
        for word in range(min(3 * count, len(found))):
            if word % 3 > 0 and found[word] >= 0:  # a robot; before each pair stands 0
                contacts[number, found[word]] += 1
        most = max(most, count)
    return most


@jit_no_alloc
def _nearest_point(edges: Any, count: int, first: int, x: float, y: float) -> tuple[tuple[float, float], int]:
    """Return the point of the polygon from edge `first` on that is nearest to (x, y), and the edge after its last."""
    found, nearest = (math.inf, math.inf), math.inf
    polygon, place = edges[first].polygon, first
    while place < count and edges[place].polygon == polygon:
        edge = edges[place]
        along_x, along_y = edge.bx - edge.ax, edge.by - edge.ay
        share = ((x - edge.ax) * along_x + (y - edge.ay) * along_y) / (along_x * along_x + along_y * along_y)
        share = min(max(share, 0.0), 1.0)
        near_x, near_y = edge.ax + share * along_x, edge.ay + share * along_y
        distance = (near_x - x) ** 2 + (near_y - y) ** 2
        if distance < nearest:
            found, nearest = (near_x, near_y), distance
        place += 1
    return found, place


@jit_no_alloc
def _add_contact(
    step: int, robot: int, other: int, point: tuple[float, float], found: IntArray, points: FloatArray, count: int
) -> int:
    """Write a contact if there is room; return the number of contacts so far."""
    if 2 * count < len(points):
        points[2 * count], points[2 * count + 1] = point
    return add_pair(step, robot, other, found, count)
