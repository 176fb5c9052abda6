"""Where faults act in a control step: functions that the control loop calls only where a scenario has faults."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.camera_clock import CameraClock, take_pictures
from epuck_sim.embodied.fault_effects import (
    Oscillators,
    blank_infrared,
    count_flashes,
    fail_rings_and_wheels,
    freeze_oscillators,
    hides_flashes,
    start_anew_and_hold,
    tick_faulty_clocks,
)
from epuck_sim.embodied.faults import Faults, change_faults
from epuck_sim.embodied.flash_cone import LitRingSensor, Obstruction, perceive_flashes
from epuck_sim.embodied.group import RobotGroupState, SignalReceiver
from epuck_sim.embodied.line_camera import see
from epuck_sim.embodied.radio import Radio, receive_pulses
from epuck_sim.embodied.reflections import see_with_reflections
from epuck_sim.embodied.sensing import SensingArrays, sense, sense_proximity
from epuck_sim.embodied.swarm_arrays import NOISE_STEPS
from epuck_sim.embodied.variation import RobotClocks


class FaultySwarm(NamedTuple):
    """The robots of a scenario with faults."""

    step: IntArray
    """(1,) number of the control step."""
    step_ms: int
    """Length of a control step."""
    faults: Faults
    clocks: RobotClocks
    ring_commands: BoolArray
    """(robots,) whether each ring is commanded to be lit."""
    ring_on: BoolArray
    """(robots,) whether it is lit."""
    ring_before: BoolArray
    """(robots,) whether it was in the step before."""
    velocities: FloatArray
    """(robots, 3) cm/s, cm/s, rad/s: what the bodies move with."""


class FaultyGroup(NamedTuple):
    """A group of them."""

    step: IntArray
    """(1,) number of the control step."""
    faults: Faults
    sensing: SensingArrays
    receiver: SignalReceiver
    oscillators: Oscillators
    visible: BoolArray
    """(robots,) scratch."""


def make_faulty_group(step: IntArray, faults: Faults, group: RobotGroupState) -> FaultyGroup:
    """Return a group whose robots may have faults; step: (1,) number of the control step."""
    arrays = group.runner.arrays
    is_oscillator = group.controller.is_oscillator
    phase_ms = arrays.memory.view(np.ndarray)["phase_ms"] if is_oscillator else np.zeros(0)
    period_s = arrays.parameters.view(np.ndarray)["period_s"] if is_oscillator else np.zeros(0)
    oscillators = Oscillators(
        phase_ms=phase_ms,
        period_s=period_s,
        actuators=arrays.actuators.view(np.ndarray),
        held_phase_ms=phase_ms.copy(),
        held_ring_on=np.zeros(len(phase_ms), np.int64),
        first_robot=group.robots.start,
    )
    robots = len(group.sensing.poses)
    return FaultyGroup(step, faults, group.sensing, group.receiver, oscillators, np.zeros(robots, np.bool_))


if TYPE_CHECKING:  # `util.jit.bind` provides it
    value_at: Callable[[int], Any]


def begin_step(address: int) -> None:
    """Begin and end the faults of a swarm whose time has come, and run faulty clocks; first in a control step."""
    swarm = value_at(address)  # noqa: F821 see `bind`
    change_faults(swarm.faults, float(swarm.step[0] * swarm.step_ms))
    count_flashes(swarm.faults, swarm.ring_on, swarm.ring_before)
    tick_faulty_clocks(swarm.faults, swarm.clocks, swarm.step_ms)


def _sense_with_camera(address: int) -> None:
    """Have the robots of a group sense, with cameras that may fail."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays = group.sensing
    sense(arrays, group.step[0] % NOISE_STEPS)
    for row in range(len(arrays.pixels)):
        robot = arrays.first_robot + row
        if hides_flashes(group.faults, robot, arrays.poses, arrays.ring_on, group.visible):
            see(
                arrays.poses,
                group.visible,
                arrays.circles,
                arrays.edges,
                arrays.cells,
                arrays.camera,
                robot,
                arrays.pixels[row : row + 1],
            )
    take_pictures(group.receiver, group.step[0])
    blank_infrared(group.faults, arrays.first_robot, arrays.infrared, arrays.distance_mm)


def _sense_with_reflections(address: int) -> None:
    """Have the robots of a group sense, with cameras that may fail and see mirror images of rings, too."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays = group.sensing
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    for row in range(len(arrays.pixels)):
        robot = arrays.first_robot + row
        hides_flashes(group.faults, robot, arrays.poses, arrays.ring_on, group.visible)
        see_with_reflections(arrays, group.visible, robot, arrays.pixels[row : row + 1])
    take_pictures(group.receiver, group.step[0])
    blank_infrared(group.faults, arrays.first_robot, arrays.infrared, arrays.distance_mm)


def _sense_with_cone(address: int) -> None:
    """Have the robots of a group sense, with ideal sensors that may fail."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays, sensor = group.sensing, group.receiver
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    among = Obstruction(arrays.poses, arrays.circles, arrays.edges, arrays.cells, arrays.radius_cm)
    for row in range(len(arrays.pixels)):
        robot = arrays.first_robot + row
        hides_flashes(group.faults, robot, arrays.poses, arrays.ring_on, group.visible)
        pixels = arrays.pixels[row : row + 1]
        perceive_flashes(sensor.cone, sensor.occlusion, group.visible, among, robot, pixels)
    blank_infrared(group.faults, arrays.first_robot, arrays.infrared, arrays.distance_mm)


def _sense_with_radio(address: int) -> None:
    """Have the robots of a group sense that receive pulses by radio."""
    group = value_at(address)  # noqa: F821 see `bind`
    arrays = group.sensing
    sense_proximity(arrays, group.step[0] % NOISE_STEPS)
    receive_pulses(group.receiver, arrays.poses, arrays.ring_on, arrays.first_robot, group.step[0])
    blank_infrared(group.faults, arrays.first_robot, arrays.infrared, arrays.distance_mm)


_SENSE = {CameraClock: _sense_with_camera, LitRingSensor: _sense_with_cone, Radio: _sense_with_radio}
"""How a group of robots with faults senses, by what brings flashes to it; with reflections,
`_sense_with_reflections`."""


def sense_of_faulty(group: FaultyGroup) -> Callable[[int], None]:
    """Return what has a group with faults sense."""
    if group.sensing.camera.reflection_range_cm > 0:
        return _sense_with_reflections
    return _SENSE[type(group.receiver)]


def hold_oscillators(address: int) -> None:
    """Start oscillators of a group anew, and take note of them, before controllers run."""
    group = value_at(address)  # noqa: F821 see `bind`
    start_anew_and_hold(group.faults, group.oscillators)


def freeze(address: int) -> None:
    """Set frozen oscillators of a group back after controllers have run."""
    group = value_at(address)  # noqa: F821 see `bind`
    freeze_oscillators(group.faults, group.oscillators)


def fail(address: int) -> None:
    """Have rings and wheels of a swarm fail after commands have been carried out."""
    swarm = value_at(address)  # noqa: F821 see `bind`
    fail_rings_and_wheels(swarm.faults, swarm.ring_commands, swarm.ring_on, swarm.velocities)
