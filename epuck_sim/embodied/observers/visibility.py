"""Visibility: which robots are in each camera's field of view, or cone, lit or not, taking occlusion into account.

Robots themselves see red pixels, and cannot tell which robot a pixel shows.
"""

import numpy as np

from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray
from epuck_sim.embodied.observers.scene import Scene, place_robots
from epuck_sim.embodied.sensors.camera import see
from epuck_sim.embodied.sensors.flash_cone import perceives
from epuck_sim.embodied.sensors.lit_rings import list_labelled
from epuck_sim.embodied.swarm import swarm_at
from epuck_sim.util.jit import jit


def find_sightings(scene: Scene, poses: FloatArray, group: int = 0, *, listed: BoolArray | None = None) -> IntArray:
    """Find the robots that the robots of a group see in some steps.

    A camera sees a robot if a pixel of the central window shows it; one that shows on both sides of an obstacle counts
    once. The ideal sensor, and Enki's camera, see those whose rings they would perceive. Who hears pulses sees nobody.

    Args:
        scene: The arena, whose obstacles hide robots, and the groups.
        poses: (steps, robots, 3) cm, cm, rad: x, y, heading of all robots.
        group: Number of the group in the scene.
        listed: (steps, robots) whether each robot is to be listed, if it is seen; all by default.

    Returns:
        (sightings, 3) step, observer, robot seen: in the order of steps and observers, and from left to right; the
        ideal sensor's in that of the robots' numbers.
    """
    kind = scene.groups[group].signal.kind
    if kind == "radio":
        return np.empty((0, 3), np.int64)
    listed = np.ones(poses.shape[:2], np.bool_) if listed is None else listed
    found = np.empty((2 * len(poses) * scene.groups[group].count, 3), np.int64)  # most robots see no more than two
    sightings = write_sightings(scene.block, group, kind != "camera", poses, listed, found)
    if sightings > len(found):
        found = np.empty((sightings, 3), np.int64)
        write_sightings(scene.block, group, kind != "camera", poses, listed, found)
    return found[:sightings]


def find_all_sightings(scene: Scene, poses: FloatArray, present: BoolArray, listed: BoolArray | None) -> IntArray:
    """Find those of all groups that are present, (robots,), step by step, as `find_sightings` does for one group."""
    groups = range(len(scene.groups))
    found: IntArray = np.concatenate([find_sightings(scene, poses, group, listed=listed) for group in groups])
    if len(groups) > 1:
        found = found[np.argsort(found[:, 0], kind="stable")]
    return found if present.all() else found[present[found[:, 1]]]


@jit
def write_sightings(
    block: ByteArray, number: int, by_cone: bool, poses: FloatArray, listed: BoolArray, found: IntArray
) -> int:
    """Write what `find_sightings` returns, as far as there is room; return the number of sightings.

    Labels are the numbers of robots, counted from 1; 0 for those that are not to be listed.
    """
    swarm = swarm_at(block)
    group, robots = swarm.groups[number], len(swarm.robots)
    row = np.zeros(group.pixels, np.int64)
    last_row = np.zeros(robots + 1, np.int64)  # counted over all steps, in which each robot was listed
    sightings = rows = 0
    for step in range(len(poses)):
        for robot in range(robots):
            swarm.numbers[robots + robot] = robot + 1 if listed[step, robot] else 0
        lit = list_labelled(robots, swarm.numbers)
        if lit == 0:
            continue
        place_robots(swarm, poses[step])
        for observer in range(group.first, group.first + group.count):
            if by_cone:
                for robot in range(robots):
                    if swarm.numbers[robots + robot] > 0 and perceives(swarm, group.cone, observer, robot):
                        sightings = _add(found, sightings, step, observer, robot)
                continue
            rows += 1
            row[:] = 0
            see(swarm, group, observer, lit, row)
            for pixel in range(group.camera.first, group.camera.end):
                seen = row[pixel]
                if seen > 0 and last_row[seen] != rows:
                    last_row[seen] = rows
                    sightings = _add(found, sightings, step, observer, seen - 1)
    return sightings


@jit
def _add(found: IntArray, sightings: int, step: int, observer: int, seen: int) -> int:
    """Write a sighting if there is room; return the number of sightings so far."""
    if sightings < len(found):
        found[sightings, 0], found[sightings, 1], found[sightings, 2] = step, observer, seen
    return sightings + 1
