"""Who has which fault, from when to when, in swarms of robots and of point agents (thesis 4.4).

A fault changes one reading, actuator or clock of its members. Its state in each robot or agent is a record `AFFECTED`;
`embodied.changes.faults` and `particles.faults` have what it does to robots and to agents.

Times are in milliseconds. Each fault draws from streams of its own, one for each member. So it does not depend on other
faults or on further members, and all other draws of a trial stay the same.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from epuck_sim.arrays import IntArray, RecordArray
from epuck_sim.scenario.changes import FAULTS, FaultSection, ScheduleEntry, SensorDead, TrialEvent
from epuck_sim.util.elementary import log
from epuck_sim.util.jit import jit_no_alloc
from epuck_sim.util.native import record_type
from epuck_sim.util.rng import next_word, share_of, uniform
from epuck_sim.util.seeds import robot_streams

KINDS = tuple(FAULTS)  # names of the kinds, by their numbers

RING_DEAD, RING_STUCK_ON, OSCILLATOR_FROZEN, CLOCK_DRIFT, CLOCK_JITTER = range(5)
CAMERA_BLIND, CAMERA_MISSES, INFRARED_DEAD, WHEELS_DEAD, RESTART, SENSOR_DEAD = range(5, 11)

FAULT = record_type(
    [
        ("kind", "i8"),  # see `KINDS`
        ("strength", "f8"),  # rate of a clock, its jitter, or the share of flashes that is missed; 0 for others
        ("sensor", "i8"),  # number of the name of the sensor, in a file of its own, that is dead
        ("nearer_cm", "f8"),  # flashes from nearer than this are missed ...
        ("farther_cm", "f8"),  # ... or from farther than this
        ("begin_ms", "f8"),  # when it begins, or may begin; infinity for those that are scheduled
        ("end_ms", "f8"),
        ("mean_free_ms", "f8"),  # mean time without it; 0 for those that begin once
        ("mean_faulty_ms", "f8"),  # mean time with it; infinity for those that last
    ]
)
"""A fault that robots or agents may have."""

AFFECTED = record_type(
    [
        ("random", "u8", 4),
        ("key", "u8"),  # decides, with a flash's sender and number, whether it is missed
        ("is_member", "?"),  # whether the member may have the fault in this trial
        ("is_active", "?"),  # whether it has
        ("change_ms", "f8"),  # when the fault begins or ends next
    ]
)
"""State of a fault in a robot or agent; that of number r and fault f has index f * population + r."""


def set_faults(faults: RecordArray, sections: Sequence[FaultSection], sensor_names: Sequence[str] = ()) -> None:
    """Write a scenario's faults to records; nobody has them before `restart_faults` has begun a trial."""
    for fault, section in zip(faults, sections, strict=True):
        fault.kind = KINDS.index(section.kind)
        for key in ("rate", "jitter", "missed"):
            fault.strength = getattr(section, key, fault.strength)
        if isinstance(section, SensorDead):
            fault.sensor = sensor_names.index(section.sensor)
        nearer, farther = (getattr(section, key, None) for key in ("nearer_than_cm", "farther_than_cm"))
        at_any = math.inf if farther is None else 0.0  # distance: the default of nearer_cm, unless farther_cm is given
        fault.nearer_cm, fault.farther_cm = _or(nearer, at_any), _or(farther, math.inf)
        fault.begin_ms = math.inf if section.scheduled else _in_ms(section.at_s or 0.0)
        fault.end_ms = _in_ms(_or(section.until_s, math.inf))
        fault.mean_free_ms = 3.6e6 / section.per_hour if section.per_hour else 0.0
        fault.mean_faulty_ms = 1000 * _or(section.mean_s, math.inf)


def _or(given: float | None, default: float) -> float:
    return default if given is None else given


def _in_ms(time_s: float) -> float:
    """Return ms, to a millionth: a fault at 2.3 s begins in the control step at 2300 ms, not at 2299.9999999999995."""
    return round(time_s * 1000, 6)


def restart_faults(
    faults: RecordArray, affected: RecordArray, sections: Sequence[FaultSection], seed: int, child: int
) -> None:
    """Begin a trial: draw, by a child of its seed, who may have each fault, and when random ones begin first."""
    states = affected.reshape(len(sections), -1)
    population = states.shape[1]
    for fault, section in enumerate(sections):
        own, whom = np.random.SeedSequence(seed, spawn_key=(child, fault)).spawn(2)
        states.random[fault] = robot_streams(own, population)
        states.is_member[fault] = np.isin(np.arange(population), _members(section, population, whom))
    states.is_active = False
    draw_first_changes(faults, affected)


def _members(section: FaultSection, population: int, sequence: np.random.SeedSequence) -> IntArray:
    among = np.arange(population) if section.whom is None else np.array(section.whom)
    count = math.floor(_or(section.share, 1.0) * len(among) + 0.5) if section.count is None else section.count
    return np.random.Generator(np.random.SFC64(sequence)).permutation(among)[:count]


@jit_no_alloc
def draw_first_changes(faults: RecordArray, affected: RecordArray) -> None:
    """Draw the keys that decide which flashes are missed, and the time at which each fault first begins."""
    population = len(affected) // len(faults)
    for place in range(len(affected)):
        section, state = faults[place // population], affected[place]
        state.key = next_word(state.random)
        state.change_ms = section.begin_ms if state.is_member else math.inf
        if state.is_member and section.mean_free_ms > 0.0:
            _await_next(section, state)


@jit_no_alloc
def _await_next(section: Any, state: Any) -> None:
    """Set the time at which a fault begins next: drawn for a random fault, if that is before its end; else never."""
    time_ms = math.inf
    if section.mean_free_ms > 0.0:
        time_ms = state.change_ms - section.mean_free_ms * log(1.0 - uniform(state.random))
    state.change_ms = time_ms if time_ms < section.end_ms else math.inf


@jit_no_alloc
def change_until(section: Any, state: Any, time_ms: float) -> float:
    """Begin and end a fault as often as is due by a time; return the phase at which a restart sets in, else -1."""
    phase = -1.0
    while state.change_ms <= time_ms:
        if section.kind == RESTART:
            phase = uniform(state.random)
        else:
            state.is_active = not state.is_active
        if state.is_active:
            end_ms = section.end_ms
            if section.mean_faulty_ms < math.inf:
                lasting_ms = -section.mean_faulty_ms * log(1.0 - uniform(state.random))
                end_ms = min(end_ms, state.change_ms + lasting_ms)
            state.change_ms = end_ms
        else:
            _await_next(section, state)
    return phase


def begin_or_end(affected: RecordArray, population: int, entry: ScheduleEntry, time_ms: float) -> None:
    """Let the faults of a schedule's entry begin or end at this time in all members that may have them."""
    for faults, begins in ((entry.begin, True), (entry.end, False)):
        for fault in faults:
            state = affected[fault * population : (fault + 1) * population]
            is_active = state.is_active
            will_be = is_active ^ (state.change_ms <= time_ms)  # after entries before this one
            concerned = state.is_member & (will_be != begins)
            state.change_ms[concerned] = np.where(is_active[concerned] != begins, time_ms, math.inf)


def fault_event(step: int, time_s: float, fault: int, kind: int, begins: bool, whom: Sequence[int]) -> TrialEvent:
    """Return the event of a fault, of this number and kind, that began or ended in some robots or agents at once."""
    what = KINDS[kind] if kind == RESTART else f"{KINDS[kind]} {'begins' if begins else 'ends'}"
    return TrialEvent(step, time_s, f"faults.{fault}", what, tuple(whom))


@jit_no_alloc
def misses(
    faults: RecordArray, affected: RecordArray, member: int, distance_cm: float, sender: int, flash: int
) -> bool:
    """Return whether faults make a member miss a flash, of this number, of a sender at a distance."""
    population = len(affected) // len(faults)
    for fault in range(len(faults)):
        section, state = faults[fault], affected[fault * population + member]
        if section.kind == CAMERA_MISSES and state.is_active:
            concerned = distance_cm < section.nearer_cm or distance_cm > section.farther_cm
            if concerned and random_share(state.key, sender, flash) < section.strength:
                return True
    return False


@jit_no_alloc
def random_share(key: np.uint64, sender: int, flash: int) -> float:
    """Return a random number from [0, 1) that is determined by a key and by a flash's sender and number."""
    word = key
    for number in (sender + 1, flash):  # splitmix64 (Steele, Lea and Flood 2014), twice
        word += np.uint64(0x9E3779B97F4A7C15) * np.uint64(number)
        word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        word ^= word >> np.uint64(31)
    return share_of(word)
