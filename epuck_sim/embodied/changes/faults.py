"""Effects of faults on robots (thesis 4.4); `epuck_sim.faults` has who has them, from when to when.

A control step calls `change_faults` first of all, `hold` before robots sense, `blank_readings` afterwards, `freeze`
when controllers have run, and `fail_actuators` when commands have been carried out; sensors of flashes call
`hide_flashes`.
"""

import math
from itertools import groupby
from typing import Any

import numpy as np

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied import start
from epuck_sim.embodied.sensors.infrared import read_nothing
from epuck_sim.embodied.swarm import FLOAT64, INT64, SENSED_BYTES, Swarm, copy_array, open_block, swarm_at
from epuck_sim.faults import (
    CAMERA_BLIND,
    CLOCK_DRIFT,
    CLOCK_JITTER,
    INFRARED_DEAD,
    OSCILLATOR_FROZEN,
    RING_DEAD,
    RING_STUCK_ON,
    SENSOR_DEAD,
    WHEELS_DEAD,
    change_until,
    fault_event,
    misses,
    restart_faults,
)
from epuck_sim.scenario.changes import TrialEvent
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import array_at
from epuck_sim.util.rng import uniform

LOGGED_STEPS = 16
"""Number of control steps for which `Swarm.log` has room, if all faults change in each: then call `take_events`."""


def begin_faults(block: ByteArray, scenario: EmbodiedScenario, seed: int) -> None:
    """Begin a trial with the faults that its seed draws."""
    swarm = open_block(block)
    restart_faults(swarm.faults, swarm.affected, scenario.drawn_faults, seed, start.FAULTS)
    swarm.robots.flash_number, swarm.robots.left_over_ms, swarm.robots.starts_anew_at = 0, 0.0, -1.0
    swarm.scene[0].changes = 0


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
            phase = change_until(swarm.faults[fault], affected, time_ms)
            if phase >= 0.0:
                swarm.robots[number].starts_anew_at = phase
            if affected.is_active != was_active or phase >= 0.0:
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
        step, kind = int(time_ms) // int(scene.step_ms), int(swarm.faults[fault].kind)
        robots = [robot for *_, robot in several]
        events.append(fault_event(step, time_ms / 1000, fault, kind, begins, robots))
    return events


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
    robots, here = len(swarm.robots), swarm.robots[robot]
    for sender in range(robots):
        to = swarm.robots[sender]
        is_seen = to.ring_on and not has_fault(here, CAMERA_BLIND)
        if is_seen:
            dx, dy = to.x - here.x, to.y - here.y
            distance_cm = np.sqrt(dx * dx + dy * dy)
            is_seen = not misses(swarm.faults, swarm.affected, robot, distance_cm, sender, to.flash_number)
        swarm.numbers[robots + sender] = int(is_seen)
