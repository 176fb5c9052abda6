"""Groups of robots at work: their controllers, and the arrays with which they sense and act."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.control.interface import ACTUATORS, MAX_MESSAGES, Controller, Value
from epuck_sim.control.loader import find_controller
from epuck_sim.control.runner import ControllerRunner, SensorArrays
from epuck_sim.embodied.camera_clock import CameraClock, restart_camera_clock, start_camera_clock
from epuck_sim.embodied.cell_list import CellList
from epuck_sim.embodied.flash_cone import LitRingSensor, make_lit_ring_sensor
from epuck_sim.embodied.infrared import SENSORS
from epuck_sim.embodied.radio import Radio, make_radio, restart_radio
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.embodied.sensing import SensingArrays, build_camera
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.scenario.signals import ConeSignal, RadioSignal

NOISE_STEPS = 16
"""Steps for which noise is drawn at once: each call of numpy's generator costs as much as 80 of its numbers."""


class SwarmArrays(NamedTuple):
    """The arrays of all robots; a group has some of their rows."""

    arena: Arena
    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading."""
    shown_poses: FloatArray
    """(robots, 3) what steps show; the same array as `poses` unless robots come and go."""
    velocities: FloatArray
    """(robots, 3) cm/s, cm/s, rad/s: what the bodies move with."""
    wheels_cm_s: FloatArray
    """(robots, 2) cm/s: left and right wheel as commanded."""
    turns_rad: FloatArray
    """(robots,) rad: turns on the spot as commanded."""
    ring_commands: BoolArray
    """(robots,) whether each robot's ring is commanded to be lit; the same array as `ring_on` without faults."""
    ring_on: BoolArray
    """(robots,) whether it is lit."""
    ring_before: BoolArray
    """(robots,) whether it was in the step before, which is what the other robots see."""
    cells: CellList
    sensors: SensorArrays
    """What controllers read."""
    actuators: npt.NDArray[np.void]
    """(robots,) records that controllers set, see `control.interface.ACTUATORS`."""
    infrared_noise: FloatArray
    """(NOISE_STEPS, robots, 8) standard normal numbers."""
    wheel_noise: FloatArray
    """(NOISE_STEPS, robots, 2) uniform numbers from [0, 1)."""


def make_swarm_arrays(scenario: EmbodiedScenario, arena: Arena, world: World) -> SwarmArrays:
    """Return the arrays of all robots before the first step: nothing is sensed or commanded yet."""
    robots = len(world.poses)
    ring_on = np.zeros(robots, np.bool_)
    return SwarmArrays(
        arena=arena,
        poses=world.poses,
        shown_poses=world.poses.copy() if scenario.members_change else world.poses,
        velocities=world.velocities,
        wheels_cm_s=np.zeros((robots, 2)),
        turns_rad=np.zeros(robots),
        ring_commands=np.zeros(robots, np.bool_) if scenario.faults else ring_on,
        ring_on=ring_on,
        ring_before=np.zeros(robots, np.bool_),
        cells=world.bodies.cells,
        sensors=SensorArrays(
            step_ms=np.full(robots, scenario.timing.step_ms),
            infrared=np.zeros((robots, SENSORS)),
            distance_mm=np.zeros((robots, SENSORS), np.int64),
            camera=np.zeros((robots, scenario.camera_pixels), np.int64),
            new_picture=np.ones(robots, np.bool_),
            pulses=np.zeros(robots, np.int64),
            messages=np.zeros((robots, MAX_MESSAGES), np.int64),
            present=world.bodies.present,
        ),
        actuators=np.zeros(robots, ACTUATORS),
        infrared_noise=np.zeros((NOISE_STEPS, robots, SENSORS)),
        wheel_noise=np.zeros((NOISE_STEPS, robots, 2)),
    )


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


def restart_swarm_arrays(swarm: SwarmArrays, step_ms: int) -> None:
    """Set the arrays that a trial changes to what they are before its first step; `World.place` sets the poses."""
    rings = swarm.ring_commands, swarm.ring_on, swarm.ring_before
    for array in (swarm.wheels_cm_s, swarm.turns_rad, *rings, *swarm.sensors):
        array[:] = 0
    swarm.sensors.step_ms[:] = step_ms
    swarm.sensors.new_picture[:] = True
    swarm.sensors.present[:] = True


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
        controller, parameters, controller_streams[rows], sensors, swarm.actuators[rows], interpret
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
        return make_lit_ring_sensor(signal)
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
        camera=build_camera(group.camera),
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
