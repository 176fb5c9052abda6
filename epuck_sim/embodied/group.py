"""Groups of robots at work: their controllers, and the arrays with which they sense and act."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.control.interface import ACTUATORS
from epuck_sim.control.loader import find_controller
from epuck_sim.control.runner import ControllerRunner, SensorArrays
from epuck_sim.embodied.camera_clock import CameraClock, start_camera_clock
from epuck_sim.embodied.cell_list import CellList
from epuck_sim.embodied.infrared import SENSORS
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.embodied.sensing import SensingArrays, build_camera
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robots import RobotGroup

NOISE_STEPS = 16
"""Steps for which noise is drawn at once: each call of numpy's generator costs as much as 80 of its numbers."""


class SwarmArrays(NamedTuple):
    """The arrays of all robots; a group has some of their rows."""

    arena: Arena
    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading."""
    velocities: FloatArray
    """(robots, 3) cm/s, cm/s, rad/s: what the bodies move with."""
    wheels_cm_s: FloatArray
    """(robots, 2) cm/s: left and right wheel as commanded."""
    ring_on: BoolArray
    """(robots,) whether each robot's ring is lit."""
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
    return SwarmArrays(
        arena=arena,
        poses=world.poses,
        velocities=world.velocities,
        wheels_cm_s=np.zeros((robots, 2)),
        ring_on=np.zeros(robots, np.bool_),
        cells=world.bodies.cells,
        sensors=SensorArrays(
            step_ms=np.full(robots, scenario.timing.step_ms),
            infrared=np.zeros((robots, SENSORS)),
            distance_mm=np.zeros((robots, SENSORS), np.int64),
            camera=np.zeros((robots, scenario.camera_pixels), np.int64),
            new_picture=np.ones(robots, np.bool_),
        ),
        actuators=np.zeros(robots, ACTUATORS),
        infrared_noise=np.zeros((NOISE_STEPS, robots, SENSORS)),
        wheel_noise=np.zeros((NOISE_STEPS, robots, 2)),
    )


class RobotGroupState(NamedTuple):
    """A group of robots at work."""

    first_robot: int
    """Number of its first robot."""
    period_ms: float
    """Period of its oscillators in ms; NaN if it has none."""
    runner: ControllerRunner
    """Its controllers."""
    sensing: SensingArrays
    """What it senses."""
    camera_clock: CameraClock
    """Decides when its controllers receive which picture; of no robots if they receive one in each step."""


def start_group(
    scenario: EmbodiedScenario,
    group: RobotGroup,
    first_robot: int,
    swarm: SwarmArrays,
    *,
    infrared_gain: FloatArray,
    controller_streams: StreamArray,
    camera_streams: StreamArray,
    interpret: bool,
) -> RobotGroupState:
    """Start the controllers of a group of robots.

    Args:
        scenario: The scenario with timing and noise.
        group: The group's section in it.
        first_robot: Number of the group's first robot.
        swarm: Arrays of all robots.
        infrared_gain: (robots, 8) factor of the reading of each sensor of all robots.
        controller_streams: (robots, 4) random streams from which controllers draw.
        camera_streams: (robots, 4) random streams from which cameras draw.
        interpret: Whether controllers run as plain Python.

    Raises:
        ControllerError: A controller cannot be compiled.
        RobotError: A robot's controller raises.
    """
    rows = slice(first_robot, first_robot + group.count)
    controller = find_controller(group.controller)
    parameters = np.repeat(controller.parameter_record(group.parameters), group.count)
    period_ms = float(parameters["period_s"][0]) * 1000 if controller.is_oscillator else np.nan
    sensors = swarm.sensors.of(rows, group.camera.pixels)
    runner = ControllerRunner(
        controller, parameters, controller_streams[rows], sensors, swarm.actuators[rows], interpret
    )
    for name, value in group.memory.items():
        runner.memory[name] = value
    clock = _start_camera_clock(scenario, group, camera_streams[rows], sensors)
    pixels = clock.in_view if len(clock.in_view) else sensors.camera
    arrays = _sensing_arrays(scenario, group, first_robot, swarm, sensors, infrared_gain[rows], pixels)
    return RobotGroupState(first_robot, period_ms, runner, arrays, clock)


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
        infrared=sensors.infrared,
        distance_mm=sensors.distance_mm,
        pixels=pixels,
    )
