"""What faults do to robots: to clocks, to what they see and sense, to their oscillators, and to rings and wheels."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.faults import (
    CAMERA_BLIND,
    CAMERA_MISSES,
    CLOCK_DRIFT,
    CLOCK_JITTER,
    INFRARED_DEAD,
    OSCILLATOR_FROZEN,
    RING_DEAD,
    RING_STUCK_ON,
    WHEELS_DEAD,
    Faults,
    has_fault,
)
from epuck_sim.embodied.variation import RobotClocks
from epuck_sim.util.jit import jit_no_alloc
from epuck_sim.util.rng import uniform

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
"""Constants of splitmix64 (Steele, Lea and Flood 2014)."""


class Oscillators(NamedTuple):
    """The phases and the rings of a group's oscillators; of no robots for a group without oscillators."""

    phase_ms: npt.NDArray[np.int64] | FloatArray
    """(group,) field of the memories of its controllers."""
    period_s: FloatArray
    """(group,) parameter of its controllers."""
    actuators: npt.NDArray[np.void]
    """(group,) records that controllers set."""
    held_phase_ms: npt.NDArray[np.int64] | FloatArray
    """(group,) phases before controllers run."""
    held_ring_on: IntArray
    """(group,) commands to rings before controllers run."""
    first_robot: int
    """Number of the group's first robot."""


@jit_no_alloc
def start_anew_and_hold(faults: Faults, group: Oscillators) -> None:
    """Start the oscillators anew whose turn it is, and hold phases and rings, before controllers run."""
    for row in range(len(group.phase_ms)):
        share = faults.starts_anew_at[group.first_robot + row]
        if share >= 0.0:
            group.phase_ms[row] = int(share * group.period_s[row] * 1000.0)
            group.actuators[row].ring_on = 0
        group.held_phase_ms[row] = group.phase_ms[row]
        group.held_ring_on[row] = group.actuators[row].ring_on


@jit_no_alloc
def freeze_oscillators(faults: Faults, group: Oscillators) -> None:
    """Set the phases and rings of frozen oscillators back to what they were before controllers ran."""
    for row in range(len(group.phase_ms)):
        if has_fault(faults, OSCILLATOR_FROZEN, group.first_robot + row):
            group.phase_ms[row] = group.held_phase_ms[row]
            group.actuators[row].ring_on = group.held_ring_on[row]


@jit_no_alloc
def blank_infrared(faults: Faults, first_robot: int, infrared: FloatArray, distance_mm: IntArray) -> None:
    """Write the readings of dead proximity sensors, 0, and their distances."""
    for row in range(len(infrared)):
        if has_fault(faults, INFRARED_DEAD, first_robot + row):
            infrared[row, :] = 0.0
            distance_mm[row, :] = epuck.OUT_OF_RANGE_MM


@jit_no_alloc
def hides_flashes(faults: Faults, robot: int, poses: FloatArray, ring_on: BoolArray, visible: BoolArray) -> bool:
    """Find the lit rings that faults do not keep a robot from seeing.

    Args:
        faults: The faults.
        robot: The robot that looks.
        poses: (robots, 3) cm, cm, rad: x, y, heading.
        ring_on: (robots,) whether each ring is lit.
        visible: (robots,) whether it is lit and not hidden; written.

    Returns:
        Whether any lit ring is hidden.
    """
    is_blind = has_fault(faults, CAMERA_BLIND, robot)
    any_hidden = False
    for sender in range(len(ring_on)):
        hidden = ring_on[sender] and (is_blind or misses(faults, robot, sender, poses))
        visible[sender] = ring_on[sender] and not hidden
        any_hidden = any_hidden or hidden
    return any_hidden


@jit_no_alloc
def misses(faults: Faults, robot: int, sender: int, poses: FloatArray) -> bool:
    """Return whether a robot misses the present flash of another one."""
    for fault in range(len(faults.kinds)):
        if faults.kinds[fault] != CAMERA_MISSES or not faults.is_active[fault, robot]:
            continue
        dx, dy = poses[sender, 0] - poses[robot, 0], poses[sender, 1] - poses[robot, 1]
        distance_cm = np.sqrt(dx * dx + dy * dy)
        concerned = distance_cm < faults.nearer_cm[fault] or distance_cm > faults.farther_cm[fault]
        chance = random_share(faults.keys[fault, robot], sender, faults.flash_numbers[sender])
        if concerned and chance < faults.strengths[fault]:
            return True
    return False


@jit_no_alloc
def random_share(key: np.uint64, sender: int, flash: int) -> float:
    """Return a random number from [0, 1) that belongs to a key and a flash, the same whenever it is asked for."""
    word = _mixed(_mixed(key + _GOLDEN * np.uint64(sender + 1)) + _GOLDEN * np.uint64(flash))
    return (word >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@jit_no_alloc
def _mixed(word: np.uint64) -> np.uint64:
    """Return a word each of whose bits depends on all bits of another one (splitmix64)."""
    word = (word ^ (word >> np.uint64(30))) * _MIX_1
    word = (word ^ (word >> np.uint64(27))) * _MIX_2
    mixed: np.uint64 = word ^ (word >> np.uint64(31))
    return mixed


@jit_no_alloc
def fail_rings_and_wheels(faults: Faults, ring_commands: BoolArray, ring_on: BoolArray, velocities: FloatArray) -> None:
    """Light the rings that are commanded and work, and stop the robots whose wheels are dead.

    Args:
        faults: The faults.
        ring_commands: (robots,) whether each ring is commanded to be lit.
        ring_on: (robots,) whether it is lit; written.
        velocities: (robots, 3) cm/s, cm/s, rad/s; written for robots with dead wheels.
    """
    for robot in range(len(ring_on)):
        is_on = ring_commands[robot] or has_fault(faults, RING_STUCK_ON, robot)
        ring_on[robot] = is_on and not has_fault(faults, RING_DEAD, robot)
        if has_fault(faults, WHEELS_DEAD, robot):
            velocities[robot, :] = 0.0


@jit_no_alloc
def count_flashes(faults: Faults, ring_on: BoolArray, ring_before: BoolArray) -> None:
    """Give numbers to the flashes that begin in this control step."""
    for robot in range(len(ring_on)):
        if ring_on[robot] and not ring_before[robot]:
            faults.flash_numbers[robot] += 1


@jit_no_alloc
def tick_faulty_clocks(faults: Faults, clocks: RobotClocks, step_ms: int) -> None:
    """Write the ms until the next control step by clocks that may be faulty; fractions carry over."""
    for robot in range(len(faults.left_over_ms)):
        may_fail, is_faulty, rate = False, False, 1.0
        for fault in range(len(faults.kinds)):
            kind = faults.kinds[fault]
            if kind not in (CLOCK_DRIFT, CLOCK_JITTER) or not faults.is_member[fault, robot]:
                continue
            may_fail = True
            if not faults.is_active[fault, robot]:
                continue
            is_faulty = True
            if kind == CLOCK_DRIFT:
                rate *= faults.strengths[fault]
            else:
                rate *= 1.0 + faults.strengths[fault] * (2.0 * uniform(faults.streams[fault, robot]) - 1.0)
        if is_faulty:
            own_ms = clocks.step_ms[robot] if len(clocks.step_ms) else float(step_ms)
            counted = own_ms * rate + faults.left_over_ms[robot]
            clocks.elapsed_ms[robot] = math.floor(counted)
            faults.left_over_ms[robot] = counted - math.floor(counted)
        elif may_fail and not len(clocks.step_ms):
            clocks.elapsed_ms[robot] = step_ms
