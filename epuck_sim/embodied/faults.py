"""Faults of robots: which robots have which, from when to when (thesis 4.4).

Times are in milliseconds. Each fault draws from streams of its own, one for each robot, so that neither other faults
nor further robots change it; what robots draw without faults stays as it is.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.embodied.swarm_arrays import NOISE_STEPS
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.faults import CameraMisses, ClockDrift, ClockJitter, FaultSection
from epuck_sim.util.jit import jit_no_alloc
from epuck_sim.util.rng import next_word, uniform
from epuck_sim.util.seeds import robot_streams

RING_DEAD, RING_STUCK_ON, OSCILLATOR_FROZEN, CLOCK_DRIFT, CLOCK_JITTER = range(5)
CAMERA_BLIND, CAMERA_MISSES, INFRARED_DEAD, WHEELS_DEAD, RESTART = range(5, 10)

KINDS = {
    "ring_dead": RING_DEAD,
    "ring_stuck_on": RING_STUCK_ON,
    "oscillator_frozen": OSCILLATOR_FROZEN,
    "clock_drift": CLOCK_DRIFT,
    "clock_jitter": CLOCK_JITTER,
    "camera_blind": CAMERA_BLIND,
    "camera_misses": CAMERA_MISSES,
    "infrared_dead": INFRARED_DEAD,
    "wheels_dead": WHEELS_DEAD,
    "restart": RESTART,
}
"""Numbers of the kinds of faults in compiled code; here, as a change in a file without kernels compiles none anew."""


ENDED, BEGUN = range(2)
"""What a fault did, in its log."""


class Faults(NamedTuple):
    """The faults of a scenario, and who has them."""

    kinds: IntArray
    """(faults,) kind of each, see `KINDS`."""
    strengths: FloatArray
    """(faults,) rate of a clock, its jitter, or the share of flashes that is missed; 0 for other faults."""
    nearer_cm: FloatArray
    """(faults,) flashes from nearer than this are missed ..."""
    farther_cm: FloatArray
    """(faults,) ... or from farther than this."""
    begin_ms: FloatArray
    """(faults,) when each begins, or may begin; infinity for those that are scheduled."""
    end_ms: FloatArray
    """(faults,) when each ends."""
    mean_free_ms: FloatArray
    """(faults,) mean time without it; 0 for those that begin once."""
    mean_faulty_ms: FloatArray
    """(faults,) mean time with it; infinity for those that last."""
    streams: StreamArray
    """(faults, robots, 4) random streams."""
    keys: StreamArray
    """(faults, robots) random words which decide, with a flash's sender and number, whether it is missed."""
    is_member: BoolArray
    """(faults, robots) whether a robot may have a fault in this trial."""
    change_ms: FloatArray
    """(faults, robots) time at which a fault begins or ends next."""
    is_active: BoolArray
    """(faults, robots) whether a robot has a fault."""
    starts_anew_at: FloatArray
    """(robots,) share of its period at which an oscillator starts anew in this control step; -1 for none."""
    flash_numbers: IntArray
    """(robots,) number of flashes that a robot has begun."""
    left_over_ms: FloatArray
    """(robots,) fraction of a millisecond that a faulty clock has not counted yet."""
    log: FloatArray
    """(n, 4) time in ms, fault, robot, and `ENDED` or `BEGUN`, of each change; n of a whole block of noise."""
    log_length: IntArray
    """(1,) number of changes that `fault_events.take_events` has not taken yet."""


def make_faults(scenario: EmbodiedScenario) -> Faults:
    """Return the faults of a scenario, which nobody has yet; `restart_faults` begins a trial."""
    sections = scenario.faults
    shape = len(sections), scenario.robot_count
    misses = [section if isinstance(section, CameraMisses) else None for section in sections]
    return Faults(
        kinds=np.array([KINDS[section.kind] for section in sections], np.int64),
        strengths=np.array([_strength(section) for section in sections], float),
        nearer_cm=np.array([_nearer_cm(section) for section in misses], float),
        farther_cm=np.array([_or_infinity(section.farther_than_cm if section else None) for section in misses]),
        begin_ms=np.array([math.inf if each.scheduled else _in_ms(each.at_s or 0.0) for each in sections]),
        end_ms=np.array([_in_ms(_or_infinity(section.until_s)) for section in sections]),
        mean_free_ms=np.array([3.6e6 / section.per_hour if section.per_hour else 0.0 for section in sections]),
        mean_faulty_ms=np.array([1000 * _or_infinity(section.mean_s) for section in sections]),
        streams=np.zeros((*shape, 4), np.uint64),
        keys=np.zeros(shape, np.uint64),
        is_member=np.zeros(shape, np.bool_),
        change_ms=np.zeros(shape),
        is_active=np.zeros(shape, np.bool_),
        starts_anew_at=np.zeros(shape[1]),
        flash_numbers=np.zeros(shape[1], np.int64),
        left_over_ms=np.zeros(shape[1]),
        log=np.zeros((NOISE_STEPS * shape[0] * shape[1], 4)),
        log_length=np.zeros(1, np.int64),
    )


def _strength(section: FaultSection) -> float:
    if isinstance(section, ClockDrift):
        return section.rate
    if isinstance(section, ClockJitter):
        return section.jitter
    return section.missed if isinstance(section, CameraMisses) else 0.0


def _nearer_cm(section: CameraMisses | None) -> float:
    """Return the distance below which flashes are missed: any, if no distance is given."""
    if section is None or (section.nearer_than_cm is None and section.farther_than_cm is None):
        return math.inf
    return section.nearer_than_cm or 0.0


def _or_infinity(given: float | None) -> float:
    return math.inf if given is None else given


def _in_ms(time_s: float) -> float:
    """Return ms, to a millionth: a fault at 2.3 s begins in the control step at 2300 ms, not at 2299.9999999999995."""
    return round(time_s * 1000, 6)


def restart_faults(faults: Faults, scenario: EmbodiedScenario, sequence: np.random.SeedSequence) -> None:
    """Begin a trial: draw who may have each fault, and when random ones begin first."""
    robots = scenario.robot_count
    for fault, section in enumerate(scenario.faults):
        own, whom = np.random.SeedSequence(sequence.entropy, spawn_key=(*sequence.spawn_key, fault)).spawn(2)
        faults.streams[fault] = robot_streams(own, robots)
        faults.is_member[fault] = False
        faults.is_member[fault, _members(section, robots, whom)] = True
    faults.is_active[:] = False
    faults.flash_numbers[:] = 0
    faults.left_over_ms[:] = 0.0
    faults.starts_anew_at[:] = -1.0
    faults.log_length[0] = 0
    _draw_first_changes(faults)


def _members(section: FaultSection, robots: int, sequence: np.random.SeedSequence) -> IntArray:
    """Return the numbers of the robots that may have a fault in this trial."""
    if section.robots is not None:
        return np.array(section.robots)
    count = math.floor((section.share or 1.0) * robots + 0.5) if section.count is None else section.count
    return np.random.Generator(np.random.SFC64(sequence)).permutation(robots)[:count]


@jit_no_alloc
def _draw_first_changes(faults: Faults) -> None:
    """Draw the words that decide on flashes, and when each fault begins first."""
    for fault in range(len(faults.kinds)):
        for robot in range(len(faults.left_over_ms)):
            faults.keys[fault, robot] = next_word(faults.streams[fault, robot])
            faults.change_ms[fault, robot] = math.inf
            if faults.is_member[fault, robot]:
                faults.change_ms[fault, robot] = faults.begin_ms[fault]
                if faults.mean_free_ms[fault] > 0.0:
                    faults.change_ms[fault, robot] = _next_begin(faults, fault, robot)


@jit_no_alloc
def _next_begin(faults: Faults, fault: int, robot: int) -> float:
    """Return when a random fault begins, after a change, or its first possible time; infinity if too late."""
    time_ms: float = faults.change_ms[fault, robot]
    time_ms -= faults.mean_free_ms[fault] * math.log(1.0 - uniform(faults.streams[fault, robot]))
    return time_ms if time_ms < faults.end_ms[fault] else math.inf


@jit_no_alloc
def _change(faults: Faults, fault: int, robot: int) -> None:
    """Begin or end a fault of a robot, and set the time of the next change."""
    is_random = faults.mean_free_ms[fault] > 0.0
    stream = faults.streams[fault, robot]
    if faults.kinds[fault] == RESTART:
        faults.starts_anew_at[robot] = uniform(stream)
        faults.change_ms[fault, robot] = _next_begin(faults, fault, robot) if is_random else math.inf
    elif faults.is_active[fault, robot]:
        faults.is_active[fault, robot] = False
        faults.change_ms[fault, robot] = _next_begin(faults, fault, robot) if is_random else math.inf
    else:
        faults.is_active[fault, robot] = True
        end_ms = faults.end_ms[fault]
        if faults.mean_faulty_ms[fault] < math.inf:
            lasting_ms = -faults.mean_faulty_ms[fault] * math.log(1.0 - uniform(stream))
            end_ms = min(end_ms, faults.change_ms[fault, robot] + lasting_ms)
        faults.change_ms[fault, robot] = end_ms


@jit_no_alloc
def change_faults(faults: Faults, time_ms: float) -> None:
    """Begin and end the faults whose time has come, and log those that are not as they were."""
    faults.starts_anew_at[:] = -1.0
    for fault in range(len(faults.kinds)):
        for robot in range(len(faults.left_over_ms)):
            if faults.change_ms[fault, robot] > time_ms:
                continue
            was_active = faults.is_active[fault, robot]
            while faults.change_ms[fault, robot] <= time_ms:
                _change(faults, fault, robot)
            is_active = faults.is_active[fault, robot]
            if faults.kinds[fault] == RESTART or is_active != was_active:
                row = faults.log[faults.log_length[0]]
                row[0], row[1], row[2] = time_ms, fault, robot
                row[3] = ENDED if was_active else BEGUN
                faults.log_length[0] += 1


@jit_no_alloc
def has_fault(faults: Faults, kind: int, robot: int) -> bool:
    """Return whether a robot has a fault of a kind."""
    for fault in range(len(faults.kinds)):  # noqa: SIM110 numba knows no generators
        if faults.kinds[fault] == kind and faults.is_active[fault, robot]:
            return True
    return False
