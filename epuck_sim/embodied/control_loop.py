"""The control loop: move, sense, control, act, many steps in one call of compiled code (thesis 3.1.4.1).

The loop is compiled together with the controllers of a swarm; with interpreted controllers, the same functions run as
plain Python.
"""

from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.control.runner import ControllerRunner
from epuck_sim.embodied.bodies import Bodies
from epuck_sim.embodied.camera_clock import CameraClock, take_pictures
from epuck_sim.embodied.chipmunk import move_bodies
from epuck_sim.embodied.differential_drive import apply_commands
from epuck_sim.embodied.group import NOISE_STEPS
from epuck_sim.embodied.sensing import SensingArrays, sense
from epuck_sim.embodied.variation import RobotClocks, Stoppages, stop_and_release, tick
from epuck_sim.util.addresses import call_at, compile_at, function_address, hold, layout
from epuck_sim.util.jit import bind, jit, kernel_digest


class GroupSensing(NamedTuple):
    """How a group of robots senses."""

    step: IntArray
    """(1,) number of the control step."""
    sensing: SensingArrays
    camera_clock: CameraClock


class Drive(NamedTuple):
    """How all robots carry out what their controllers command; see `apply_commands`."""

    actuators: npt.NDArray[np.void]
    wheels_cm_s: FloatArray
    ring_on: BoolArray
    wheel_gain: FloatArray
    slip: float
    step_s: float
    wheel_noise: FloatArray


class ControlLoop(NamedTuple):
    """All that changes while a swarm's time runs."""

    step: IntArray
    """(1,) number of the last control step; -1 before the first."""
    physics_steps: int
    """Physics steps in a control step."""
    bodies: Bodies
    calls: IntArray
    """(calls, 2) addresses of functions, and of what they take: all groups sense, then all controllers run."""
    clocks: RobotClocks
    stoppages: Stoppages
    drive: Drive


if TYPE_CHECKING:  # `bind` provides it
    value_at: Callable[[int], Any]


def _sense(address: int) -> None:
    """Have the robots of a group sense."""
    group = value_at(address)  # noqa: F821 see `bind`
    sense(group.sensing, group.step[0] % NOISE_STEPS)
    take_pictures(group.camera_clock, group.step[0])


@jit
def run_calls(calls: IntArray) -> None:
    """Call all functions."""
    for call in range(len(calls)):
        call_at(calls[call, 0], calls[call, 1])


def _take_steps(address: int, steps: int, until_lit: int) -> int:
    """Take a number of control steps, or as many as it takes until the ring of robot `until_lit` is lit, if not -1.

    Bodies move before each step but the first. All robots sense the same instant, as rings and wheels take effect after
    all controllers have run.

    Returns:
        The first robot whose controller set a wheel speed that is not a number, which ends the loop; or -1.
    """
    loop = value_at(address)  # noqa: F821 see `bind`
    drive = loop.drive
    for _ in range(steps):
        loop.step[0] += 1
        step = loop.step[0]
        if step > 0:
            move_bodies(loop.bodies, loop.physics_steps)
        tick(loop.clocks, step)
        stop_and_release(loop.stoppages, step * drive.step_s)
        run_calls(loop.calls)
        invalid = apply_commands(
            drive.actuators,
            drive.wheels_cm_s,
            drive.ring_on,
            loop.bodies.poses,
            drive.wheel_gain,
            drive.slip,
            drive.step_s,
            loop.bodies.velocities,
            drive.wheel_noise,
            step % NOISE_STEPS,
        )
        if invalid >= 0:
            return invalid
        if until_lit >= 0 and drive.ring_on[until_lit]:
            break
    return -1


def interpreted_loop(
    loop: ControlLoop, groups: Sequence[GroupSensing], runners: Sequence[ControllerRunner]
) -> Callable[[int, int], int]:
    """Return `_take_steps` of this loop as a function of its other arguments, as plain Python."""
    sensing = [bind(_sense, value_at=lambda _, group=group: group) for group in groups]

    def run_calls(_: IntArray) -> None:
        for sense_group in sensing:
            sense_group(0)
        for runner in runners:
            runner.step_all(runner.address)

    return partial(bind(_take_steps, value_at=lambda _: loop, run_calls=run_calls), 0)


class CompiledLoop:
    """`_take_steps` of a loop as a function of its other arguments, compiled."""

    def __init__(self, loop: ControlLoop, groups: Sequence[GroupSensing], runners: Sequence[ControllerRunner]) -> None:
        self._take_steps = _compiled_for(_take_steps, loop)
        self._owners = []
        sense_groups = []
        for group in groups:
            owner, address = hold(group)
            self._owners.append(owner)
            sense_groups.append((function_address(_compiled_for(_sense, group)), address))
        loop.calls[:] = [*sense_groups, *((runner.step_address, runner.address) for runner in runners)]
        owner, self._address = hold(loop)
        self._owners.append(owner)

    def __call__(self, steps: int, until_lit: int) -> int:
        """Carry out `_take_steps`."""
        return int(self._take_steps(self._address, steps, until_lit))


_compiled: dict[Hashable, Any] = {}


def _compiled_for(function: Any, value: ControlLoop | GroupSensing) -> Any:
    """Return a function compiled for addresses of such values."""
    key = function, layout(value)
    if key not in _compiled:
        _compiled[key] = compile_at(function, value, kernel_digest(), careful=False)
    return _compiled[key]
