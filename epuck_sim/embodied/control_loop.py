"""The control loop: move, sense, control, act, many steps in one call of compiled code (thesis 3.1.4.1).

`step_calls` says what a step calls, and `loop_runners` runs the loop, compiled or as plain Python.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.control.interface import Wheels
from epuck_sim.embodied.bodies_tuple import Bodies
from epuck_sim.embodied.chipmunk import move_bodies
from epuck_sim.embodied.differential_drive import apply_commands
from epuck_sim.embodied.swarm_arrays import NOISE_STEPS, SwarmArrays
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
from epuck_sim.util.addresses import call_at
from epuck_sim.util.jit import jit, jit_no_alloc


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


def take_steps(address: int, steps: int, until_lit: int) -> int:
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
