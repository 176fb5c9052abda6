"""Arrays of all robots of a swarm, which their groups share."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.control.interface import ACTUATORS, MAX_MESSAGES, SENSORS
from epuck_sim.control.runner import SensorArrays
from epuck_sim.embodied.cell_list import CellList
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.scenario.embodied import EmbodiedScenario

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


def restart_swarm_arrays(swarm: SwarmArrays, step_ms: int) -> None:
    """Set the arrays that a trial changes to what they are before its first step; `World.place` sets the poses."""
    rings = swarm.ring_commands, swarm.ring_on, swarm.ring_before
    for array in (swarm.wheels_cm_s, swarm.turns_rad, *rings, *swarm.sensors):
        array[:] = 0
    swarm.sensors.step_ms[:] = step_ms
    swarm.sensors.new_picture[:] = True
    swarm.sensors.present[:] = True
