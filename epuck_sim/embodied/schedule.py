"""Carries out the schedule of a scenario: changes that are made while a trial of robots runs."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from epuck_sim.embodied.faults import Faults
from epuck_sim.embodied.group import RobotGroupState
from epuck_sim.scenario.robot_schedule import RobotDisplacement, RobotScheduleEntry
from epuck_sim.scenario.schedule import TimedEntries

NEVER = 2**62
"""Number of a control step that no simulation takes."""


def timed_entries(schedule: Sequence[RobotScheduleEntry], step_ms: int) -> TimedEntries[int]:
    """Return the entries that have a time, by the control steps, `step_ms` long, before which they are carried out."""
    steps = [
        (math.ceil(round(entry.at_s * 1000, 6) / step_ms), number)
        for number, entry in enumerate(schedule)
        if entry.at_s is not None
    ]
    return TimedEntries(sorted(steps), NEVER)


def displace_phases(groups: Sequence[RobotGroupState], displacement: RobotDisplacement, sequence: Any) -> None:
    """Displace the phases of oscillators, and command their rings dark.

    Args:
        groups: All groups.
        displacement: Whose phases, and by how much.
        sequence: Seed sequence from which random phases are drawn.
    """
    robots = groups[-1].robots.stop
    drawn = np.random.Generator(np.random.SFC64(sequence)).random(robots)
    for group in groups:
        if not group.controller.is_oscillator:
            continue
        numbers = np.arange(robots)[group.robots]
        rows = np.isin(numbers, numbers if displacement.robots is None else displacement.robots)
        memory = group.runner.memory.view(np.ndarray)
        by_cycles = displacement.by_cycles
        if isinstance(by_cycles, str):
            phase = drawn[group.robots] * group.period_ms
        else:
            ahead_ms = np.round(by_cycles * group.period_ms, 6)  # 1450 ms, not 1449.9999999999998, for whole phases
            phase = (memory["phase_ms"] + ahead_ms) % group.period_ms
        memory["phase_ms"][rows] = phase[rows]
        group.runner.arrays.actuators.view(np.ndarray)["ring_on"][rows] = 0


def begin_or_end(faults: Faults, fault: int, *, begins: bool, time_ms: float) -> None:
    """Have a scheduled fault begin, or end, in the control step at this time, in all robots that may have it."""
    is_active = faults.is_active[fault]
    will_be = is_active ^ (faults.change_ms[fault] <= time_ms)  # where an entry before has had it begin, or end
    concerned = faults.is_member[fault] & (will_be != begins)
    faults.change_ms[fault, concerned] = np.where(is_active[concerned] != begins, time_ms, math.inf)


def carry_out(
    entry: RobotScheduleEntry,
    groups: Sequence[RobotGroupState],
    faults: Faults | None,
    set_parameters: Callable[[int, dict[str, Any]], None],
    sequence: Any,
    time_ms: float,
) -> None:
    """Make the changes of an entry.

    Args:
        entry: The entry.
        groups: All groups.
        faults: The scenario's faults, if it has any.
        set_parameters: Sets parameters of the group of a number.
        sequence: Seed sequence from which random phases are drawn.
        time_ms: Time of the control step from which on the changes act.
    """
    for group, values in entry.parameters().items():
        set_parameters(group, values)
    if entry.displace is not None:
        displace_phases(groups, entry.displace, sequence)
    for numbers, begins in ((entry.begin, True), (entry.end, False)):
        for fault in numbers:
            assert faults is not None
            begin_or_end(faults, fault, begins=begins, time_ms=time_ms)
