"""Robots that come and go: those that are not in the arena are parked far outside, at rest and in the dark.

There they touch nothing, hide nobody and are not seen; what they would sense there is blanked, and their controllers do
not run.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.util.jit import jit_no_alloc

OUTSIDE_CM = -1e6
"""Coordinates of where robots are parked that are not in the arena, cm: out of the way of all that has a range."""

APART_CM = 1e3
"""Distance of parked robots along each axis, cm."""


def parked_poses(robots: IntArray) -> FloatArray:
    """Return (n, 3) cm, cm, rad: where robots of these numbers are parked."""
    places = OUTSIDE_CM - APART_CM * robots
    return np.column_stack([places, places, np.zeros(len(robots))])


def parked(poses: FloatArray) -> FloatArray:
    """Return (..., robots, 3) poses of steps with robots parked that are not in the arena, for whom they are NaN."""
    outside = np.broadcast_to(parked_poses(np.arange(poses.shape[-2])), poses.shape)
    return np.where(np.isnan(poses), outside, poses)


class AbsentSwarm(NamedTuple):
    """What robots do that are not in the arena."""

    present: BoolArray
    """(robots,) whether each robot is in the arena."""
    ring_commands: BoolArray
    """(robots,) whether each ring is commanded to be lit; written."""
    ring_on: BoolArray
    """(robots,) whether it is lit; written."""
    wheels_cm_s: FloatArray
    """(robots, 2) cm/s: left and right wheel as commanded; written."""
    velocities: FloatArray
    """(robots, 3) cm/s, cm/s, rad/s: what the bodies move with; written."""


class AbsentGroup(NamedTuple):
    """What robots of a group sense that are not in the arena; all but `present` is written."""

    present: BoolArray
    """(group,) whether each robot is in the arena."""
    infrared: FloatArray
    distance_mm: IntArray
    pixels: IntArray
    """(group, pixels) what cameras look at."""
    waiting: IntArray
    """(group, pixels) pictures that have not been delivered yet; those that have been where none have to wait."""
    camera: IntArray
    pulses: IntArray
    messages: IntArray


if TYPE_CHECKING:  # `util.jit.bind` provides it
    value_at: Callable[[int], Any]


@jit_no_alloc
def _blank(group: AbsentGroup) -> None:
    for row in range(len(group.present)):
        if not group.present[row]:
            group.infrared[row, :] = 0.0
            group.distance_mm[row, :] = epuck.OUT_OF_RANGE_MM
            group.pixels[row, :] = 0
            group.waiting[row, :] = 0
            group.camera[row, :] = 0
            group.pulses[row] = 0
            group.messages[row, :] = 0


@jit_no_alloc
def _rest(swarm: AbsentSwarm) -> None:
    for robot in range(len(swarm.present)):
        if not swarm.present[robot]:
            swarm.ring_commands[robot] = False
            swarm.ring_on[robot] = False
            swarm.wheels_cm_s[robot, :] = 0.0
            swarm.velocities[robot, :] = 0.0


def blank(address: int) -> None:
    """Have the robots of a group that are not in the arena sense nothing."""
    _blank(value_at(address))  # noqa: F821 see `bind`


def rest(address: int) -> None:
    """Have all robots that are not in the arena rest in the dark, after commands have been carried out."""
    _rest(value_at(address))  # noqa: F821 see `bind`
