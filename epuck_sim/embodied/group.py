"""A group of robots at work: its controllers, and the arguments with which it senses, gathered once."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray, StreamArray
from epuck_sim.control.loader import find_controller
from epuck_sim.control.runner import ControllerRunner, SensorArrays
from epuck_sim.embodied.camera_clock import CameraClock
from epuck_sim.embodied.cell_list import CellList
from epuck_sim.embodied.sensing import build_camera, gather
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robots import RobotGroup

NOISE_STEPS = 16
"""Noise is drawn for so many steps at once: asking for numbers costs as much as 80 of them."""


class SwarmArrays(NamedTuple):
    """What there is of all robots; a group has some of the rows."""

    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading."""
    ring_on: BoolArray
    """(robots,)"""
    arena: Arena
    cells: CellList
    senses: SensorArrays
    infrared_noise: FloatArray
    """(NOISE_STEPS, robots, 8) standard normal numbers."""
    infrared_gain: FloatArray
    """(robots, 8)"""
    actuators: npt.NDArray[np.void]
    """(robots,) records."""
    thinking: StreamArray
    """(robots, 4) what controllers draw from."""
    filming: StreamArray
    """(robots, 4) what cameras draw from."""


class RobotGroupState(NamedTuple):
    """A group of robots at work."""

    first: int
    """The number of its first robot."""
    period_ms: float
    """Of its oscillators; NaN if they are none."""
    control: ControllerRunner
    sensing: list[tuple[Any, ...]]
    """The arguments of `sense`, with the noise of each of `NOISE_STEPS` steps."""
    ticks: list[Callable[[int], None]]
    """What is to be called with each step's number between sensing and control."""


def start_group(
    scenario: EmbodiedScenario, group: RobotGroup, first: int, of: SwarmArrays, *, interpret: bool
) -> RobotGroupState:
    """Start the controllers of a group, the robots from number `first` on.

    Raises ControllerError where they cannot be compiled, RobotError where one raises.
    """
    rows = slice(first, first + group.count)
    controller = find_controller(group.controller)
    parameters = np.repeat(controller.parameter_record(group.parameters), group.count)
    period_ms = float(parameters["period_s"][0]) * 1000 if controller.is_oscillator else np.nan
    senses = of.senses.of(rows, group.camera.pixels)
    control = ControllerRunner(controller, parameters, of.thinking[rows], senses, of.actuators[rows], interpret)
    seen, ticks = senses.camera, list[Callable[[int], None]]()
    if group.camera.frames_per_s is not None:
        shutter = CameraClock(
            scenario.timing.control_hz / group.camera.frames_per_s,
            group.camera.latency_ms * scenario.timing.control_hz / 1000,
            *(of.filming[rows], senses.camera, senses.new_picture),
        )
        seen = shutter.seen
        ticks.append(shutter.tick)
    everybody = gather(of.poses, of.ring_on, of.arena, of.cells, build_camera(group.camera))
    sensing = [
        (
            *(*everybody, first, senses.infrared, of.infrared_gain[rows], noise[rows], scenario.noise.infrared_counts),
            *(group.infrared.distance == "firmware_table", senses.distance_mm, seen),
        )
        for noise in of.infrared_noise
    ]
    return RobotGroupState(first, period_ms, control, sensing, ticks)
