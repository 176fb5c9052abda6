"""Groups of robots at work: their controllers, and the arrays with which they sense and act."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray, IntArray, StreamArray
from epuck_sim.control.interface import Controller, Value
from epuck_sim.control.loader import find_controller
from epuck_sim.control.runner import ControllerRunner, SensorArrays
from epuck_sim.embodied.camera_clock import CameraClock, restart_camera_clock, start_camera_clock
from epuck_sim.embodied.flash_cone import LitRingSensor, make_lit_ring_sensor
from epuck_sim.embodied.infrared import make_infrared_sensors
from epuck_sim.embodied.radio import Radio, make_radio, restart_radio
from epuck_sim.embodied.sensing import SensingArrays, build_camera
from epuck_sim.embodied.swarm_arrays import SwarmArrays
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.scenario.signals import ConeSignal, RadioSignal

SignalReceiver = CameraClock | LitRingSensor | Radio
"""What brings flashes to the robots of a group, by the kind of their `signal`."""


class RobotGroupState(NamedTuple):
    """A group of robots at work."""

    robots: slice
    """Numbers of its robots."""
    controller: Controller
    """What runs on them."""
    first_parameters: npt.NDArray[np.void]
    """(1,) the record of its parameters in the scenario."""
    first_memory: Mapping[str, Any]
    """What its robots remember at the start in the scenario, by name; the controllers' `start` has set the rest."""
    runner: ControllerRunner
    """Its controllers."""
    sensing: SensingArrays
    """What it senses."""
    receiver: SignalReceiver
    """What brings flashes to it."""

    @property
    def parameters(self) -> dict[str, Value]:
        """The parameters of its controllers, by name."""
        return self.controller.parameter_values(self.runner.arrays.parameters[0])

    @property
    def period_ms(self) -> float:
        """Period of its oscillators in ms; NaN if it has none."""
        if not self.controller.is_oscillator:
            return np.nan
        return float(self.runner.arrays.parameters["period_s"][0]) * 1000


def make_group(
    scenario: EmbodiedScenario,
    group: RobotGroup,
    first_robot: int,
    swarm: SwarmArrays,
    *,
    infrared_gain: FloatArray,
    controller_streams: StreamArray,
    signal_streams: StreamArray,
    interpret: bool,
) -> RobotGroupState:
    """Return a group of robots whose controllers are ready to start; see `restart_group`.

    Args:
        scenario: The scenario with timing and noise.
        group: The group's section in it.
        first_robot: Number of the group's first robot.
        swarm: Arrays of all robots.
        infrared_gain: (robots, 8) factor of the reading of each sensor of all robots.
        controller_streams: (robots, 4) random streams from which controllers draw.
        signal_streams: (robots, 4) random streams from which cameras and radios draw.
        interpret: Whether controllers run as plain Python.

    Raises:
        ControllerError: A controller cannot be compiled.
    """
    rows = slice(first_robot, first_robot + group.count)
    controller = find_controller(group.controller)
    first_parameters = controller.parameter_record(group.parameters)
    parameters = np.repeat(first_parameters, group.count)
    sensors = swarm.sensors.of(rows, group.pixels)
    runner = ControllerRunner(
        *(controller, parameters, controller_streams[rows], sensors, swarm.actuators[rows], interpret),
        scenario.robot.wheels,
    )
    receiver = _start_receiver(scenario, group, signal_streams[rows], sensors, swarm)
    # a picture that is delivered later is not yet the controller's
    pixels = receiver.in_view if isinstance(receiver, CameraClock) and len(receiver.in_view) else sensors.camera
    arrays = _sensing_arrays(scenario, group, first_robot, swarm, sensors, infrared_gain[rows], pixels)
    return RobotGroupState(rows, controller, first_parameters, group.memory, runner, arrays, receiver)


def _start_receiver(
    scenario: EmbodiedScenario,
    group: RobotGroup,
    streams: StreamArray,
    sensors: SensorArrays,
    swarm: SwarmArrays,
) -> SignalReceiver:
    """Return what brings flashes to a group; `streams` and `sensors` are the group's."""
    signal = group.signal
    if isinstance(signal, ConeSignal):
        return make_lit_ring_sensor(signal, scenario.robot)
    if isinstance(signal, RadioSignal):
        return make_radio(signal, scenario.timing.step_ms, streams, swarm.actuators, swarm.ring_before, sensors)
    return _start_camera_clock(scenario, group, streams, sensors)


def restart_group(group: RobotGroupState) -> None:
    """Start a group's controllers with the scenario's parameters and memory.

    Raises:
        RobotError: A controller raises.
    """
    group.runner.arrays.senses.camera[:] = 0
    restart_receiver(group.receiver)
    group.runner.arrays.parameters.view(np.ndarray)[:] = group.first_parameters
    group.runner.start()
    for name, value in group.first_memory.items():
        group.runner.memory[name] = value


def start_again(group: RobotGroupState, row: int) -> None:
    """Start the controller of one robot of a group with the scenario's memory; it keeps its parameters.

    Raises:
        RobotError: A controller raises.
    """
    arrays = group.runner.arrays
    changed = [array.view(np.ndarray) for array in (arrays.memory, arrays.actuators, arrays.random)]
    before = [array.copy() for array in changed]
    group.runner.start()
    for array, old in zip(changed, before, strict=True):
        started = array[row].copy()
        array[:] = old
        array[row] = started
    for name, value in group.first_memory.items():
        arrays.memory.view(np.ndarray)[name][row] = np.broadcast_to(value, len(arrays.memory))[row]


def set_parameters(group: RobotGroupState, values: Mapping[str, Value]) -> None:
    """Set all parameters of a group's controllers."""
    record = group.controller.parameter_record(values)
    group.runner.arrays.parameters.view(np.ndarray)[:] = record


def restart_receiver(receiver: SignalReceiver) -> None:
    """Set what brings flashes to a group to before its first step."""
    if isinstance(receiver, CameraClock):
        restart_camera_clock(receiver)
    elif isinstance(receiver, Radio):
        restart_radio(receiver)


def _start_camera_clock(
    scenario: EmbodiedScenario, group: RobotGroup, streams: StreamArray, sensors: SensorArrays
) -> CameraClock:
    """Return the clock of the group's cameras; of no robots for cameras that take a picture in each control step."""
    if group.camera.frames_per_s is None:
        return start_camera_clock(1.0, 0.0, streams[:0], sensors.camera[:0], sensors.new_picture[:0])
    return start_camera_clock(
        interval=scenario.timing.control_hz / group.camera.frames_per_s,
        latency=group.camera.latency_ms * scenario.timing.control_hz / 1000,
        streams=streams,
        camera=sensors.camera,
        new_picture=sensors.new_picture,
    )


def _sensing_arrays(
    scenario: EmbodiedScenario,
    group: RobotGroup,
    first_robot: int,
    swarm: SwarmArrays,
    sensors: SensorArrays,
    infrared_gain: FloatArray,
    pixels: IntArray,
) -> SensingArrays:
    """Return what `sense` takes of a group; `sensors` and `infrared_gain` are the group's, `pixels` is written to."""
    return SensingArrays(
        poses=swarm.poses,
        ring_on=swarm.ring_on,
        width_cm=swarm.arena.width_cm,
        height_cm=swarm.arena.height_cm,
        circles=swarm.arena.circles,
        edges=swarm.arena.edges,
        cells=swarm.cells,
        camera=build_camera(group.camera, scenario.robot),
        radius_cm=float(scenario.robot.radius_cm),
        infrared_sensors=make_infrared_sensors(scenario.robot),
        first_robot=first_robot,
        infrared_gain=infrared_gain,
        infrared_noise=swarm.infrared_noise,
        noise_counts=scenario.noise.infrared_counts,
        by_table=group.infrared.distance == "firmware_table",
        sees_robots=group.infrared.robots,
        infrared=sensors.infrared,
        distance_mm=sensors.distance_mm,
        pixels=pixels,
    )
