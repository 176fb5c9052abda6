"""What a control step calls besides controllers, in order: sensing, faults, and robots that come and go."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from epuck_sim.embodied.attendance import AbsentSwarm, blank, rest
from epuck_sim.embodied.coming_and_going import absent_group
from epuck_sim.embodied.control_loop import ControlLoop
from epuck_sim.embodied.faults import Faults
from epuck_sim.embodied.faulty_swarm import (
    FaultySwarm,
    begin_step,
    fail,
    freeze,
    hold_oscillators,
    make_faulty_group,
    sense_of_faulty,
)
from epuck_sim.embodied.group import RobotGroupState
from epuck_sim.embodied.group_sensing import GroupSensing, sensing_of


class Call(NamedTuple):
    """A function of an address, and the value that it finds there."""

    function: Callable[[int], None]
    value: Any


class Calls(NamedTuple):
    """What a control step calls, in order."""

    before_controllers: list[Call]
    after_controllers: list[Call]
    late: list[Call]
    """When commands have been carried out."""


def plan_calls(
    loop: ControlLoop, groups: Sequence[RobotGroupState], faults: Faults | None, absent: AbsentSwarm | None
) -> Calls:
    """Return what a control step calls, besides controllers.

    Args:
        loop: The loop.
        groups: All groups.
        faults: Those of the scenario, if it has any.
        absent: Robots that are not in the arena, if robots come and go.
    """
    calls = _plan_all_present(loop, groups, faults)
    if absent is not None:
        calls.before_controllers.extend(Call(blank, absent_group(group)) for group in groups)
        calls.late.append(Call(rest, absent))
    return calls


def _plan_all_present(loop: ControlLoop, groups: Sequence[RobotGroupState], faults: Faults | None) -> Calls:
    """Return what a control step calls if all robots are in the arena."""
    if faults is None:
        sensing = [GroupSensing(loop.step, group.sensing, group.receiver) for group in groups]
        return Calls([Call(sensing_of(each), each) for each in sensing], [], [])
    drive = loop.drive
    swarm = FaultySwarm(
        step=loop.step,
        step_ms=round(1000 * drive.step_s),
        faults=faults,
        clocks=loop.clocks,
        ring_commands=drive.ring_commands,
        ring_on=drive.ring_on,
        ring_before=drive.ring_before,
        velocities=loop.bodies.velocities,
    )
    faulty = [make_faulty_group(loop.step, faults, group) for group in groups]
    return Calls(
        [
            Call(begin_step, swarm),
            *(Call(hold_oscillators, group) for group in faulty),
            *(Call(sense_of_faulty(group), group) for group in faulty),
        ],
        [Call(freeze, group) for group in faulty],
        [Call(fail, swarm)],
    )
