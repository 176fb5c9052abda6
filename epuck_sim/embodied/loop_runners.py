"""Runs the control loop: compiled together with the controllers of a swarm, or with interpreted controllers."""

from collections.abc import Callable, Sequence

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.embodied.attendance import AbsentSwarm
from epuck_sim.embodied.chipmunk import move_bodies
from epuck_sim.embodied.control_loop import ControlLoop, take_steps
from epuck_sim.embodied.faults import Faults
from epuck_sim.embodied.group import RobotGroupState
from epuck_sim.embodied.step_calls import Call, plan_calls
from epuck_sim.util.addresses import compiled_for, function_address
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import bind


class InterpretedLoop:
    """`take_steps` of a loop as a function of its other arguments, as plain Python."""

    def __init__(
        self,
        loop: ControlLoop,
        groups: Sequence[RobotGroupState],
        faults: Faults | None,
        absent: AbsentSwarm | None,
    ) -> None:
        self._faults, self._absent = faults, absent
        self.begin(loop, groups)
        for function in self._before:  # now, so that compiling it belongs to no trial's time
            function(0)
        move_bodies(loop.bodies, 0)
        self._take_steps = bind(take_steps, value_at=lambda _: self._loop, run_calls=self.run_calls)

    def begin(self, loop: ControlLoop, groups: Sequence[RobotGroupState]) -> None:
        """Take this loop of these groups from the next step on."""
        self._loop = loop
        self.call_controllers(groups)

    def call_controllers(self, groups: Sequence[RobotGroupState]) -> None:
        """Call what runs on the robots of these groups from the next step on."""
        plan = plan_calls(self._loop, groups, self._faults, self._absent)
        self._before, after, self._late = ([_interpreted(call) for call in calls] for calls in plan)
        controllers = [lambda _, runner=group.runner: runner.step_all(runner.address) for group in groups]
        self._early = [*self._before, *controllers, *after]

    def run_calls(self, calls: IntArray) -> None:
        """Call all functions: those of `ControlLoop.calls`, or `late_calls`."""
        for function in self._early if calls is self._loop.calls else self._late:
            function(0)

    def __call__(self, steps: int, until_lit: int) -> int:
        """Carry out `take_steps`."""
        return int(self._take_steps(0, steps, until_lit))


def _interpreted(call: Call) -> Callable[[int], None]:
    function: Callable[[int], None] = bind(call.function, value_at=lambda _: call.value)
    return function


class CompiledLoop:
    """`take_steps` of a loop as a function of its other arguments, compiled."""

    def __init__(
        self,
        loop: ControlLoop,
        groups: Sequence[RobotGroupState],
        faults: Faults | None,
        absent: AbsentSwarm | None,
    ) -> None:
        self._faults, self._absent = faults, absent
        self.begin(loop, groups)

    def begin(self, loop: ControlLoop, groups: Sequence[RobotGroupState]) -> None:
        """Take this loop of these groups from the next step on."""
        self._loop = loop
        self._take_steps = compiled_for(take_steps, loop)
        self._owner, self._address = hold(loop)
        self.call_controllers(groups)

    def call_controllers(self, groups: Sequence[RobotGroupState]) -> None:
        """Call what runs on the robots of these groups from the next step on."""
        self._owners: list[object] = []
        plan = plan_calls(self._loop, groups, self._faults, self._absent)
        before, after, late = ([self._addresses(call) for call in calls] for calls in plan)
        controllers = [(group.runner.step_address, group.runner.address) for group in groups]
        self._loop.calls[:] = [*before, *controllers, *after]
        self._loop.late_calls[:] = np.reshape(late, (-1, 2))

    def _addresses(self, call: Call) -> tuple[int, int]:
        owner, address = hold(call.value)
        self._owners.append(owner)
        return function_address(compiled_for(call.function, call.value)), address

    def __call__(self, steps: int, until_lit: int) -> int:
        """Carry out `take_steps`."""
        return int(self._take_steps(self._address, steps, until_lit))
