"""Faults of robots: who has them, from when to when, and what they change (thesis 4.4).

A fault changes one reading, actuator or clock, which its section of a scenario names. A control step calls
`change_faults` first of all, `hold` before robots sense, `blank_readings` afterwards, `freeze` when controllers have
run, and `fail_actuators` when commands have been carried out; sensors of flashes call `hide_flashes`.

Times are in milliseconds. Each fault draws from streams of its own, one for each robot. So it does not depend on other
faults or on further robots, and all other draws of robots stay the same.
"""

import math
from itertools import groupby
from typing import Any

import numpy as np

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied import start
from epuck_sim.embodied.sensors.infrared import read_nothing
from epuck_sim.embodied.swarm import FLOAT64, INT64, SENSED_BYTES, Swarm, copy_array, open_block, swarm_at
from epuck_sim.scenario.changes import FAULTS, FaultSection, SensorDead, TrialEvent
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.util.elementary import log
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import array_at
from epuck_sim.util.rng import next_word, share_of, uniform
from epuck_sim.util.seeds import robot_streams

KINDS = tuple(FAULTS)  # names of the kinds, by their numbers

RING_DEAD, RING_STUCK_ON, OSCILLATOR_FROZEN, CLOCK_DRIFT, CLOCK_JITTER = range(5)
CAMERA_BLIND, CAMERA_MISSES, INFRARED_DEAD, WHEELS_DEAD, RESTART, SENSOR_DEAD = range(5, 11)

LOGGED_STEPS = 16
"""Number of control steps for which `Swarm.log` has room, if all faults change in each: then call `take_events`."""


# --- who has which fault, from when to when ---------------------------------------------------------


def set_faults(swarm: Swarm, scenario: EmbodiedScenario) -> None:
    """Write a scenario's faults to a swarm; nobody has them before `restart_faults` has begun a trial."""
    for fault, section in zip(swarm.faults, scenario.faults, strict=True):
        fault.kind = KINDS.index(section.kind)
        for key in ("rate", "jitter", "missed"):
            fault.strength = getattr(section, key, fault.strength)
        if isinstance(section, SensorDead):
            fault.sensor = scenario.sensor_names.index(section.sensor)
        nearer, farther = (getattr(section, key, None) for key in ("nearer_than_cm", "farther_than_cm"))
        at_any = math.inf if farther is None else 0.0  # distance: the default of nearer_cm, unless farther_cm is given
        fault.nearer_cm, fault.farther_cm = _or(nearer, at_any), _or(farther, math.inf)
        fault.begin_ms = math.inf if section.scheduled else _in_ms(section.at_s or 0.0)
        fault.end_ms = _in_ms(_or(section.until_s, math.inf))
        fault.mean_free_ms = 3.6e6 / section.per_hour if section.per_hour else 0.0
        fault.mean_faulty_ms = 1000 * _or(section.mean_s, math.inf)
    swarm.scene[0].hides_flashes = any(section.changes == "flashes" for section in scenario.faults)


def _or(given: float | None, default: float) -> float:
    return default if given is None else given


def _in_ms(time_s: float) -> float:
    """Return ms, to a millionth: a fault at 2.3 s begins in the control step at 2300 ms, not at 2299.9999999999995."""
    return round(time_s * 1000, 6)


def restart_faults(block: ByteArray, scenario: EmbodiedScenario, seed: int) -> None:
    """Begin a trial: draw, by its seed, who may have each fault, and when random ones begin first."""
    swarm = open_block(block)
    robots = len(swarm.robots)
    affected = swarm.affected.reshape(len(scenario.faults), robots)
    for fault, section in enumerate(scenario.faults):
        own, whom = np.random.SeedSequence(seed, spawn_key=(start.FAULTS, fault)).spawn(2)
        affected.random[fault] = robot_streams(own, robots)
        affected.is_member[fault] = np.isin(np.arange(robots), _members(section, robots, whom))
    swarm.affected.is_active = False
    swarm.robots.flash_number, swarm.robots.left_over_ms, swarm.robots.starts_anew_at = 0, 0.0, -1.0
    swarm.scene[0].changes = 0
    draw_first_changes(block)


def _members(section: FaultSection, robots: int, sequence: np.random.SeedSequence) -> IntArray:
    among = np.arange(robots) if section.robots is None else np.array(section.robots)
    count = math.floor(_or(section.share, 1.0) * len(among) + 0.5) if section.count is None else section.count
    return np.random.Generator(np.random.SFC64(sequence)).permutation(among)[:count]


@jit_no_alloc
def draw_first_changes(block: ByteArray) -> None:
    """Draw the keys that decide which flashes are missed, and the time at which each fault first begins."""
    swarm = swarm_at(block)
    for fault in range(len(swarm.faults)):
        for robot in range(len(swarm.robots)):
            affected = swarm.affected[fault * len(swarm.robots) + robot]
            affected.key = next_word(affected.random)
            affected.change_ms = swarm.faults[fault].begin_ms if affected.is_member else math.inf
            if affected.is_member and swarm.faults[fault].mean_free_ms > 0.0:
                _await_next(swarm, fault, robot)


@jit_no_alloc
def _await_next(swarm: Swarm, fault: int, robot: int) -> None:
    """Set the time at which a fault begins next: drawn for a random fault, if that is before its end; else never."""
    section, affected = swarm.faults[fault], swarm.affected[fault * len(swarm.robots) + robot]
    time_ms = math.inf
    if section.mean_free_ms > 0.0:
        time_ms = affected.change_ms - section.mean_free_ms * log(1.0 - uniform(affected.random))
    affected.change_ms = time_ms if time_ms < section.end_ms else math.inf


@jit_no_alloc
def _change(swarm: Swarm, fault: int, robot: int) -> None:
    section, affected = swarm.faults[fault], swarm.affected[fault * len(swarm.robots) + robot]
    if section.kind == RESTART:
        swarm.robots[robot].starts_anew_at = uniform(affected.random)
    else:
        affected.is_active = not affected.is_active
    if affected.is_active:
        end_ms = section.end_ms
        if section.mean_faulty_ms < math.inf:
            lasting_ms = -section.mean_faulty_ms * log(1.0 - uniform(affected.random))
            end_ms = min(end_ms, affected.change_ms + lasting_ms)
        affected.change_ms = end_ms
    else:
        _await_next(swarm, fault, robot)


@jit_no_alloc
def change_faults(block: ByteArray, _addresses: IntArray, _number: int) -> None:
    """Begin and end the faults whose time has come, and log them; number the flashes that begin, and tick clocks."""
    swarm = swarm_at(block)
    scene = swarm.scene[0]
    time_ms = float(scene.step * scene.step_ms)
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        robot.starts_anew_at, robot.faults = -1.0, 0
        if robot.ring_on and not robot.ring_before:
            robot.flash_number += 1
    for fault in range(len(swarm.faults)):
        for number in range(len(swarm.robots)):
            affected = swarm.affected[fault * len(swarm.robots) + number]
            was_active = affected.is_active
            is_due = affected.change_ms <= time_ms
            while affected.change_ms <= time_ms:
                _change(swarm, fault, number)
            if affected.is_active != was_active or (is_due and swarm.faults[fault].kind == RESTART):
                change = swarm.log[scene.changes]
                change.time_ms, change.fault, change.robot, change.begins = time_ms, fault, number, not was_active
                scene.changes += 1
            if affected.is_active:
                swarm.robots[number].faults |= 1 << swarm.faults[fault].kind
    for number in range(len(swarm.robots)):
        _tick(swarm, number)


@jit_inline
def _tick(swarm: Swarm, number: int) -> None:
    """Write the ms until the next control step by a clock that may be faulty; fractions carry over."""
    scene, robot = swarm.scene[0], swarm.robots[number]
    if not (has_fault(robot, CLOCK_DRIFT) or has_fault(robot, CLOCK_JITTER)):
        if not scene.clocks_differ:
            robot.sensors.step_ms = scene.step_ms
        return
    rate = 1.0
    for fault in range(len(swarm.faults)):
        section, affected = swarm.faults[fault], swarm.affected[fault * len(swarm.robots) + number]
        if affected.is_active and section.kind == CLOCK_DRIFT:
            rate *= section.strength
        elif affected.is_active and section.kind == CLOCK_JITTER:
            rate *= 1.0 + section.strength * (2.0 * uniform(affected.random) - 1.0)
    counted = robot.own_step_ms * rate + robot.left_over_ms
    robot.sensors.step_ms = math.floor(counted)
    robot.left_over_ms = counted - math.floor(counted)


@jit_inline
def has_fault(robot: Any, kind: int) -> bool:
    """Return whether a robot has a fault of a kind."""
    return bool((robot.faults >> kind) & 1)


def take_events(swarm: Swarm) -> list[TrialEvent]:
    """Return the faults that began or ended since the last call; robots in which one did so at once share an event."""
    scene = swarm.scene[0]
    order = ("time_ms", "fault", "begins", "robot")
    changes = np.sort(swarm.log[: scene.changes], order=order)[list(order)].tolist()
    scene.changes = 0
    events = []
    for (time_ms, fault, begins), several in groupby(changes, lambda each: each[:3]):
        kind = KINDS[swarm.faults[fault].kind]
        what = kind if kind == "restart" else f"{kind} {'begins' if begins else 'ends'}"
        robots = tuple(robot for *_, robot in several)
        events.append(TrialEvent(int(time_ms) // int(scene.step_ms), time_ms / 1000, f"faults.{fault}", what, robots))
    return events


# --- effects of faults ------------------------------------------------------------------------------


@jit_no_alloc
def hold(block: ByteArray, _addresses: IntArray, number: int) -> None:
    """Restart the oscillators of a group that are due, and save phases and rings for `freeze`, before robots sense.

    Restore the readings of sensors in files of their own to the values sensed, dead or not: some count on from them.
    """
    swarm = swarm_at(block)
    group = swarm.groups[number]
    for index in range(len(swarm.senses)):
        own = swarm.senses[index]
        if own.first == group.first:
            copy_array(swarm.sensed[own.kept :], swarm.sensed[own.readings : own.random])
    if group.phase < 0:
        return
    period = group.parameters + group.period
    period_s = array_at(block, period, period + 8, FLOAT64)[0]
    for row in range(group.count):
        robot = swarm.robots[group.first + row]
        at = group.memory + row * group.memory_bytes + group.phase
        phase = array_at(block, at, at + 8, INT64)
        if robot.starts_anew_at >= 0.0:
            phase_ms = int(robot.starts_anew_at * period_s * 1000.0)
            if group.phase_is_float:
                array_at(block, at, at + 8, FLOAT64)[0] = phase_ms
            else:
                phase[0] = phase_ms
            robot.actuators.ring_on = 0
        robot.held_phase = phase[0]
        robot.held_ring = robot.actuators.ring_on


@jit_no_alloc
def blank_readings(block: ByteArray, _addresses: IntArray, number: int) -> None:
    """Set the readings of a group's dead sensors to 0, and their distances to none."""
    swarm = swarm_at(block)
    at, group = swarm.scene[0].at[SENSED_BYTES], swarm.groups[number]
    for member in range(group.count):
        robot = swarm.robots[group.first + member]
        if has_fault(robot, INFRARED_DEAD):
            read_nothing(robot.sensors)
    for index in range(len(swarm.senses)):
        own = swarm.senses[index]
        if own.first != group.first:
            continue
        readings = swarm.sensed[own.readings : own.random]
        copy_array(readings, swarm.sensed[own.kept : own.kept + len(readings)])
        size = len(readings) // max(own.count, 1)
        for member in range(own.count):
            for fault in range(len(swarm.faults)):
                is_active = swarm.affected[fault * len(swarm.robots) + own.first + member].is_active
                if is_active and swarm.faults[fault].kind == SENSOR_DEAD and swarm.faults[fault].sensor == own.name:
                    first = at + own.readings + member * size
                    array_at(block, first, first + size, INT64)[:] = 0


@jit_no_alloc
def freeze(block: ByteArray, _addresses: IntArray, number: int) -> None:
    """Set the phases and rings of a group's frozen oscillators back to what they were before controllers ran."""
    swarm = swarm_at(block)
    group = swarm.groups[number]
    if group.phase < 0:
        return
    for row in range(group.count):
        robot = swarm.robots[group.first + row]
        if has_fault(robot, OSCILLATOR_FROZEN):
            at = group.memory + row * group.memory_bytes + group.phase
            array_at(block, at, at + 8, INT64)[0] = robot.held_phase
            robot.actuators.ring_on = robot.held_ring


@jit_no_alloc
def fail_actuators(block: ByteArray, _addresses: IntArray, _number: int) -> None:
    """Light rings that are commanded to be lit, or stuck on, unless dead; stop dead wheels, whose commands stay."""
    swarm = swarm_at(block)
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        is_on = robot.ring_command or has_fault(robot, RING_STUCK_ON)
        robot.ring_on = is_on and not has_fault(robot, RING_DEAD)
        if has_fault(robot, WHEELS_DEAD):
            robot.vx, robot.vy, robot.spin = 0.0, 0.0, 0.0


@jit_no_alloc
def hide_flashes(block: ByteArray, _addresses: IntArray, robot: int) -> None:
    """Label robots in the scratch numbers: 1 if the ring is lit and no fault hides it from `robot`, 0 for others."""
    swarm = swarm_at(block)
    robots = len(swarm.robots)
    is_blind = has_fault(swarm.robots[robot], CAMERA_BLIND)
    for sender in range(robots):
        is_seen = swarm.robots[sender].ring_on and not is_blind and not _misses(swarm, robot, sender)
        swarm.numbers[robots + sender] = int(is_seen)


@jit_no_alloc
def _misses(swarm: Swarm, robot: int, sender: int) -> bool:
    to, here = swarm.robots[sender], swarm.robots[robot]
    for fault in range(len(swarm.faults)):
        section, affected = swarm.faults[fault], swarm.affected[fault * len(swarm.robots) + robot]
        if section.kind != CAMERA_MISSES or not affected.is_active:
            continue
        dx, dy = to.x - here.x, to.y - here.y
        distance_cm = np.sqrt(dx * dx + dy * dy)
        concerned = distance_cm < section.nearer_cm or distance_cm > section.farther_cm
        if concerned and random_share(affected.key, sender, to.flash_number) < section.strength:
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
