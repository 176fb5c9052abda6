"""The control loop: move, sense, control, act, many steps in one call of compiled code (thesis 3.1.4.1).

The loop is compiled together with the controllers of a swarm; with interpreted controllers, the same functions run as
plain Python.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.embodied.bodies import Bodies
from epuck_sim.embodied.camera_clock import CameraClock, take_pictures
from epuck_sim.embodied.chipmunk import move_bodies
from epuck_sim.embodied.differential_drive import apply_commands
from epuck_sim.embodied.flash_cone import LitRingSensor, Obstruction, perceive_flashes
from epuck_sim.embodied.group import NOISE_STEPS, RobotGroupState, SignalReceiver, SwarmArrays
from epuck_sim.embodied.radio import Radio, receive_pulses
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
from epuck_sim.util.addresses import call_at, compiled_for, function_address, hold
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
    ring_on: BoolArray
    turns_rad: FloatArray
    ring_before: BoolArray
    """(robots,) the rings of the step before, which are those that robots see; written."""
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
    timing, clock_rate = scenario.timing, variation.clock_rate
    rates = clock_rate if scenario.spread.clock_rate > 0 else clock_rate[:0]
    return ControlLoop(
        step=step,
        physics_steps=timing.physics_hz // timing.control_hz,
        bodies=bodies,
        calls=np.zeros((2 * len(scenario.robots), 2), np.int64),
        clocks=RobotClocks(timing.step_ms * rates, swarm.sensors.step_ms),
        stoppages=begin_stoppages(scenario.stuck, variation_streams, variation.wheel_gain),
        drive=Drive(
            actuators=swarm.actuators,
            wheels_cm_s=swarm.wheels_cm_s,
            ring_on=swarm.ring_on,
            turns_rad=swarm.turns_rad,
            ring_before=swarm.ring_before,
            wheel_gain=variation.wheel_gain,
            slip=scenario.noise.wheel_speed,
            step_s=timing.step_ms / 1000,
            wheel_noise=swarm.wheel_noise,
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


def _sense_with_cone(address: int) -> None:
    """Have the robots of a group sense that perceive flashes with the ideal sensor."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays, sensor = group.sensing, group.receiver
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    among = Obstruction(arrays.poses, arrays.circles, arrays.edges, arrays.cells)
    perceive_flashes(sensor.cone, sensor.occlusion, arrays.ring_on, among, arrays.first_robot, arrays.pixels)


def _sense_with_radio(address: int) -> None:
    """Have the robots of a group sense that receive pulses by radio."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays = group.sensing
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    receive_pulses(group.receiver, arrays.poses, arrays.ring_on, arrays.first_robot, group.step[0])


_SENSE = {CameraClock: _sense_with_camera, LitRingSensor: _sense_with_cone, Radio: _sense_with_radio}
"""How a group of robots senses, by what brings flashes to it."""


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

    Bodies move before each step but the first. All robots sense the same instant, as rings and wheels take effect after
    all controllers have run.

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
            drive.ring_on,
            drive.turns_rad,
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


def interpreted_loop(loop: ControlLoop, groups: Sequence[RobotGroupState]) -> Callable[[int, int], int]:
    """Return `_take_steps` of this loop as a function of its other arguments, as plain Python."""
    sensing = [_sensing(loop, group) for group in groups]
    sense_groups = [bind(_SENSE[type(group.receiver)], value_at=lambda _, group=group: group) for group in sensing]
    for sense_group in sense_groups:  # now, so that compiling it belongs to no trial's time
        sense_group(0)
    move_bodies(loop.bodies, 0)

    def run_calls(_: IntArray) -> None:
        for sense_group in sense_groups:
            sense_group(0)
        for group in groups:
            group.runner.step_all(group.runner.address)

    return partial(bind(_take_steps, value_at=lambda _: loop, run_calls=run_calls), 0)


class CompiledLoop:
    """`_take_steps` of a loop as a function of its other arguments, compiled."""

    def __init__(self, loop: ControlLoop, groups: Sequence[RobotGroupState]) -> None:
        self._take_steps = compiled_for(_take_steps, loop)
        self._owner, self._address = hold(loop)
        self._owners = []
        for number, group in enumerate(groups):
            sensing = _sensing(loop, group)
            owner, address = hold(sensing)
            self._owners.append(owner)
            loop.calls[number] = function_address(compiled_for(_SENSE[type(group.receiver)], sensing)), address
            call_controllers(loop, number, group)

    def __call__(self, steps: int, until_lit: int) -> int:
        """Carry out `_take_steps`."""
        return int(self._take_steps(self._address, steps, until_lit))


def call_controllers(loop: ControlLoop, number: int, group: RobotGroupState) -> None:
    """Have a compiled loop call the controllers of group `number` from its next step on."""
    loop.calls[len(loop.calls) // 2 + number] = group.runner.step_address, group.runner.address


def _sensing(loop: ControlLoop, group: RobotGroupState) -> GroupSensing:
    return GroupSensing(loop.step, group.sensing, group.receiver)
