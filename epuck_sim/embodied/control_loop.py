"""The control loop: move, sense, control, act, many steps in one call of compiled code (thesis 3.1.4.1).

The loop is compiled together with the controllers of a swarm; with interpreted controllers, the same functions run as
plain Python.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.control.interface import Wheels
from epuck_sim.embodied.attendance import AbsentSwarm, blank, rest
from epuck_sim.embodied.bodies import Bodies
from epuck_sim.embodied.camera_clock import CameraClock, take_pictures
from epuck_sim.embodied.chipmunk import move_bodies
from epuck_sim.embodied.coming_and_going import absent_group
from epuck_sim.embodied.differential_drive import apply_commands
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
from epuck_sim.embodied.flash_cone import LitRingSensor, Obstruction, perceive_flashes
from epuck_sim.embodied.group import NOISE_STEPS, RobotGroupState, SignalReceiver, SwarmArrays
from epuck_sim.embodied.radio import Radio, receive_pulses
from epuck_sim.embodied.reflections import see_with_reflections
from epuck_sim.embodied.sensing import SensingArrays, sense, sense_proximity
from epuck_sim.embodied.variation import (
    RobotClocks,
    RobotVariation,
    Stoppages,
    begin_stoppages,
    restart_stoppages,
    stop_and_release,
    tick,
)
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.util.addresses import call_at, compiled_for, function_address
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import bind, jit, jit_no_alloc


class GroupSensing(NamedTuple):
    """How a group of robots senses."""

    step: IntArray
    """(1,) number of the control step."""
    sensing: SensingArrays
    receiver: SignalReceiver


class Drive(NamedTuple):
    """How all robots carry out what their controllers command; see `apply_commands`."""

    actuators: npt.NDArray[np.void]
    wheels_cm_s: FloatArray
    ring_commands: BoolArray
    ring_on: BoolArray
    turns_rad: FloatArray
    ring_before: BoolArray
    """(robots,) the rings of the step before, which are those that robots see; written."""
    wheel_gain: FloatArray
    slip: float
    step_s: float
    wheel_noise: FloatArray
    wheels: Wheels


class ControlLoop(NamedTuple):
    """All that changes while a swarm's time runs."""

    step: IntArray
    """(1,) number of the last control step; -1 before the first."""
    physics_steps: int
    """Physics steps in a control step."""
    bodies: Bodies
    calls: IntArray
    """(calls, 2) addresses of functions, and of what they take: all groups sense, then all controllers run."""
    late_calls: IntArray
    """(calls, 2) the same, for what follows when commands have been carried out; none without faults, and robots that
    come and go."""
    clocks: RobotClocks
    stoppages: Stoppages
    drive: Drive


def make_control_loop(
    scenario: EmbodiedScenario,
    step: IntArray,
    bodies: Bodies,
    swarm: SwarmArrays,
    variation: RobotVariation,
    variation_streams: StreamArray,
) -> ControlLoop:
    """Return the loop of a swarm before its first step.

    Args:
        scenario: The scenario with timing and noise.
        step: (1,) number of the last control step.
        bodies: The robots' bodies.
        swarm: Arrays of all robots.
        variation: How robots differ.
        variation_streams: (robots, 4) random streams.
    """
    faulty, changing = bool(scenario.faults), scenario.members_change
    calls = len(scenario.robots) * (2 + 2 * faulty + changing) + faulty
    timing, clock_rate = scenario.timing, variation.clock_rate
    rates = clock_rate if scenario.spread.clock_rate > 0 else clock_rate[:0]
    return ControlLoop(
        step=step,
        physics_steps=timing.physics_hz // timing.control_hz,
        bodies=bodies,
        calls=np.zeros((calls, 2), np.int64),
        late_calls=np.zeros((faulty + changing, 2), np.int64),
        clocks=RobotClocks(timing.step_ms * rates, swarm.sensors.step_ms),
        stoppages=begin_stoppages(scenario.stuck, variation_streams, variation.wheel_gain),
        drive=Drive(
            actuators=swarm.actuators,
            wheels_cm_s=swarm.wheels_cm_s,
            ring_commands=swarm.ring_commands,
            ring_on=swarm.ring_on,
            turns_rad=swarm.turns_rad,
            ring_before=swarm.ring_before,
            wheel_gain=variation.wheel_gain,
            slip=scenario.noise.wheel_speed,
            step_s=timing.step_ms / 1000,
            wheel_noise=swarm.wheel_noise,
            wheels=scenario.robot.wheels,
        ),
    )


def restart_loop(loop: ControlLoop, step_ms: int, variation: RobotVariation) -> None:
    """Set a loop to before its first step; step_ms: length of a control step; variation: how robots differ."""
    loop.clocks.step_ms[:] = step_ms * variation.clock_rate[: len(loop.clocks.step_ms)]
    restart_stoppages(loop.stoppages)


if TYPE_CHECKING:  # `bind` provides it
    value_at: Callable[[int], Any]


def _sense_with_camera(address: int) -> None:
    """Have the robots of a group sense that see flashes with their cameras."""
    group = value_at(address)  # noqa: F821 see `bind`
    sense(group.sensing, group.step[0] % NOISE_STEPS)
    take_pictures(group.receiver, group.step[0])


def _sense_with_reflections(address: int) -> None:
    """Have the robots of a group sense whose cameras see mirror images of rings, too."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays = group.sensing
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    see_with_reflections(arrays, arrays.ring_on, arrays.first_robot, arrays.pixels)
    take_pictures(group.receiver, group.step[0])


def _sense_with_cone(address: int) -> None:
    """Have the robots of a group sense that perceive flashes with the ideal sensor."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays, sensor = group.sensing, group.receiver
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    among = Obstruction(arrays.poses, arrays.circles, arrays.edges, arrays.cells, arrays.radius_cm)
    perceive_flashes(sensor.cone, sensor.occlusion, arrays.ring_on, among, arrays.first_robot, arrays.pixels)


def _sense_with_radio(address: int) -> None:
    """Have the robots of a group sense that receive pulses by radio."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays = group.sensing
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    receive_pulses(group.receiver, arrays.poses, arrays.ring_on, arrays.first_robot, group.step[0])


_SENSE = {CameraClock: _sense_with_camera, LitRingSensor: _sense_with_cone, Radio: _sense_with_radio}
"""How a group of robots senses, by what brings flashes to it; with reflections, `_sense_with_reflections`."""


@jit
def run_calls(calls: IntArray) -> None:
    """Call all functions."""
    for call in range(len(calls)):
        call_at(calls[call, 0], calls[call, 1])


@jit_no_alloc
def copy_rings(ring_on: BoolArray, ring_before: BoolArray) -> None:
    """Write which rings are lit to `ring_before`."""
    for robot in range(len(ring_on)):
        ring_before[robot] = ring_on[robot]


def _take_steps(address: int, steps: int, until_lit: int) -> int:
    """Take a number of control steps, or as many as it takes until the ring of robot `until_lit` is lit, if not -1.

    That is as commanded, even if the ring has a fault. Bodies move before each step but the first. All robots sense the
    same instant, as rings and wheels take effect after all controllers have run.

    Returns:
        The first robot whose controller set a speed or a turn that is no number, which ends the loop; or -1.
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
        copy_rings(drive.ring_on, drive.ring_before)
        invalid = apply_commands(
            drive.actuators,
            drive.wheels_cm_s,
            drive.ring_commands,
            drive.turns_rad,
            loop.bodies.poses,
            drive.wheel_gain,
            drive.slip,
            drive.step_s,
            loop.bodies.velocities,
            drive.wheel_noise,
            step % NOISE_STEPS,
            drive.wheels,
        )
        if invalid >= 0:
            return invalid
        run_calls(loop.late_calls)
        if until_lit >= 0 and drive.ring_commands[until_lit]:
            break
    return -1


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


def _sense_of(group: GroupSensing) -> Callable[[int], None]:
    """Return what has a group sense."""
    if group.sensing.camera.reflection_range_cm > 0:
        return _sense_with_reflections
    return _SENSE[type(group.receiver)]


def _plan(
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
        return Calls([Call(_sense_of(each), each) for each in sensing], [], [])
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


class InterpretedLoop:
    """`_take_steps` of a loop as a function of its other arguments, as plain Python."""

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
        self._take_steps = bind(_take_steps, value_at=lambda _: self._loop, run_calls=self.run_calls)

    def begin(self, loop: ControlLoop, groups: Sequence[RobotGroupState]) -> None:
        """Take this loop of these groups from the next step on."""
        self._loop = loop
        self.call_controllers(groups)

    def call_controllers(self, groups: Sequence[RobotGroupState]) -> None:
        """Call what runs on the robots of these groups from the next step on."""
        plan = _plan(self._loop, groups, self._faults, self._absent)
        self._before, after, self._late = ([_interpreted(call) for call in calls] for calls in plan)
        controllers = [lambda _, runner=group.runner: runner.step_all(runner.address) for group in groups]
        self._early = [*self._before, *controllers, *after]

    def run_calls(self, calls: IntArray) -> None:
        """Call all functions: those of `ControlLoop.calls`, or `late_calls`."""
        for function in self._early if calls is self._loop.calls else self._late:
            function(0)

    def __call__(self, steps: int, until_lit: int) -> int:
        """Carry out `_take_steps`."""
        return int(self._take_steps(0, steps, until_lit))


def _interpreted(call: Call) -> Callable[[int], None]:
    function: Callable[[int], None] = bind(call.function, value_at=lambda _: call.value)
    return function


class CompiledLoop:
    """`_take_steps` of a loop as a function of its other arguments, compiled."""

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
        self._take_steps = compiled_for(_take_steps, loop)
        self._owner, self._address = hold(loop)
        self.call_controllers(groups)

    def call_controllers(self, groups: Sequence[RobotGroupState]) -> None:
        """Call what runs on the robots of these groups from the next step on."""
        self._owners: list[object] = []
        plan = _plan(self._loop, groups, self._faults, self._absent)
        before, after, late = ([self._addresses(call) for call in calls] for calls in plan)
        controllers = [(group.runner.step_address, group.runner.address) for group in groups]
        self._loop.calls[:] = [*before, *controllers, *after]
        self._loop.late_calls[:] = np.reshape(late, (-1, 2))

    def _addresses(self, call: Call) -> tuple[int, int]:
        owner, address = hold(call.value)
        self._owners.append(owner)
        return function_address(compiled_for(call.function, call.value)), address

    def __call__(self, steps: int, until_lit: int) -> int:
        """Carry out `_take_steps`."""
        return int(self._take_steps(self._address, steps, until_lit))
