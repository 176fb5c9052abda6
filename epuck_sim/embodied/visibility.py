"""Visibility: which robots are in each camera's field of view, or cone, lit or not, taking occlusion into account.

For observers only. Robots themselves see red pixels, and cannot tell which robot a pixel shows.
"""

from collections.abc import Callable

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.embodied.camera_pixels import Camera
from epuck_sim.embodied.cell_list import CellList, sort_into_cells
from epuck_sim.embodied.flash_cone import LitRingSensor, Obstruction, make_lit_ring_sensor, perceives
from epuck_sim.embodied.line_camera import see
from epuck_sim.embodied.sensing import build_camera
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.scenario.signals import ConeSignal
from epuck_sim.util.jit import jit

View = Camera | LitRingSensor
"""What the robots of a group see rings with."""


def view_of(group: RobotGroup) -> View | None:
    """Return what the robots of a group see rings with; None for robots that hear pulses."""
    if isinstance(group.signal, ConeSignal):
        return make_lit_ring_sensor(group.signal)
    return build_camera(group.camera) if group.signal.kind == "camera" else None


def find_sightings(
    poses: FloatArray, arena: Arena, cells: CellList, view: View | None, first: int, observers: int
) -> IntArray:
    """Find the robots that others see in some steps.

    A camera sees a robot if a pixel of the central window shows it; one that shows on both sides of an obstacle counts
    once. The ideal sensor sees those whose rings it would perceive.

    Args:
        poses: (steps, robots, 3) cm, cm, rad: x, y, heading.
        arena: Its obstacles hide robots.
        cells: A cell list of the arena, which is overwritten.
        view: What the observers see with; None if they see nothing.
        first: Number of the first observer.
        observers: Number of observers, which are numbered consecutively.

    Returns:
        (sightings, 3) step, observer, robot seen: in the order of steps and observers, and from left to right; the
        ideal sensor's in that of the robots' numbers.
    """
    if view is None:
        return np.empty((0, 3), np.int64)
    numbers = np.arange(1, poses.shape[1] + 1)  # 0 is what a dark pixel holds
    given = (numbers, arena.circles, arena.edges, cells, view, first, observers)
    found = np.empty((2 * len(poses) * observers, 3), np.int64)  # most robots see no more than two
    write = SIGHTING_WRITERS[type(view)]
    sightings = write(poses, *given, found)
    if sightings > len(found):
        found = np.empty((sightings, 3), np.int64)
        write(poses, *given, found)
    return found[:sightings]


@jit
def write_sightings(
    poses: FloatArray,
    labels: IntArray,
    circles: FloatArray,
    edges: FloatArray,
    cells: CellList,
    camera: Camera,
    first: int,
    observers: int,
    found: IntArray,
) -> int:
    """Write what `find_sightings` returns, as far as there is room; return the number of sightings.

    labels: (robots,) number of each robot, counted from 1; 0 for one that is not to be listed.
    """
    rows = np.empty((observers, len(camera.cos)), np.int64)
    listed = np.zeros(poses.shape[1] + 1, np.int64)  # the last row, counted over all steps, that listed each robot
    sightings = 0
    for step in range(len(poses)):
        sort_into_cells(poses[step], cells)
        see(poses[step], labels, circles, edges, cells, camera, first, rows)
        for observer in range(observers):
            row = step * observers + observer + 1
            for pixel in range(camera.first, camera.end):
                number = rows[observer, pixel]
                if number == 0 or listed[number] == row:
                    continue
                listed[number] = row
                if sightings < len(found):
                    found[sightings] = step, first + observer, number - 1
                sightings += 1
    return sightings


@jit
def write_cone_sightings(
    poses: FloatArray,
    labels: IntArray,
    circles: FloatArray,
    edges: FloatArray,
    cells: CellList,
    sensor: LitRingSensor,
    first: int,
    observers: int,
    found: IntArray,
) -> int:
    """Do what `write_sightings` does for robots with the ideal sensor."""
    sightings = 0
    for step in range(len(poses)):
        sort_into_cells(poses[step], cells)
        among = Obstruction(poses[step], circles, edges, cells)
        for observer in range(first, first + observers):
            for robot in range(len(labels)):
                if labels[robot] > 0 and perceives(sensor.cone, sensor.occlusion, among, observer, robot):
                    if sightings < len(found):
                        found[sightings] = step, observer, robot
                    sightings += 1
    return sightings


SIGHTING_WRITERS: dict[type, Callable[..., int]] = {Camera: write_sightings, LitRingSensor: write_cone_sightings}
"""What writes sightings, by what robots see with."""
