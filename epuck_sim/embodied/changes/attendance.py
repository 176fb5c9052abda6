"""Robots that come and go: those that are not in the arena are parked far outside, at rest and in the dark.

There they touch nothing, hide nobody and are not seen; what they would sense there is blanked, and their controllers do
not run.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.control.interface import ACTUATORS
from epuck_sim.embodied.controllers import GroupControllers
from epuck_sim.embodied.placement import (
    APART_CM,
    OUTSIDE_CM,
    PLACED,
    TOLERANCE_CM,
    begin_placement,
    is_free,
    place_at_random,
)
from epuck_sim.embodied.sensors.infrared import read_nothing
from epuck_sim.embodied.sensors.radio import forget_signals
from epuck_sim.embodied.swarm import Swarm, group_of, open_block, swarm_at
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.util.jit import jit_no_alloc

if TYPE_CHECKING:  # it imports pymunk, which readers of recordings do without
    from epuck_sim.embodied.bodies.world import World


def parked_poses(robots: IntArray) -> FloatArray:
    """Return (n, 3) cm, cm, rad: where robots of these numbers are parked."""
    places = OUTSIDE_CM - APART_CM * robots
    return np.column_stack([places, places, np.zeros(len(robots))])


def parked(poses: FloatArray) -> FloatArray:
    """Return (..., robots, 3) poses of steps with robots parked that are not in the arena, for whom they are NaN."""
    return np.where(np.isnan(poses), parked_poses(np.arange(poses.shape[-2])), poses)


@jit_no_alloc
def blank(block: ByteArray, _addresses: IntArray, number: int) -> None:
    """Have the robots of a group that are not in the arena sense nothing; their controllers, which hear, do not run."""
    swarm = swarm_at(block)
    group = swarm.groups[number]
    for member in range(group.count):
        if swarm.robots[group.first + member].present:
            continue
        read_nothing(swarm.robots[group.first + member].sensors)
        for pixel in range(member * group.pixels, (member + 1) * group.pixels):
            swarm.pixels[group.row + pixel] = 0
            swarm.pixels[group.in_view + pixel] = 0
            swarm.pixels[group.waiting + pixel] = 0


@jit_no_alloc
def rest(block: ByteArray, _addresses: IntArray, _number: int) -> None:
    """Have all robots that are not in the arena rest in the dark, after commands have been carried out."""
    swarm = swarm_at(block)
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        if not robot.present:
            robot.ring_command, robot.ring_on = False, False
            robot.left_cm_s, robot.right_cm_s = 0.0, 0.0
            robot.vx, robot.vy, robot.spin = 0.0, 0.0, 0.0


def take_out(robots: Sequence[int], swarm: Swarm, world: "World", controllers: Sequence[GroupControllers]) -> None:
    """Take robots out of the arena: they forget all."""
    for number in robots:
        world.move(number, parked_poses(np.array([number]))[0])
        robot = swarm.robots[number]
        robot.present = robot.ring_command = robot.ring_on = robot.ring_before = False
        robot.actuators = np.zeros(1, ACTUATORS)[0]
        group = controllers[group_of(swarm, number)]
        group.memory[number - group.robots.start] = np.zeros(1, group.memory.dtype)[0]


def put_in(
    robots: Sequence[int],
    poses: Sequence[Sequence[float]] | None,
    scenario: EmbodiedScenario,
    block: ByteArray,
    world: "World",
    controllers: Sequence[GroupControllers],
    sequence: np.random.SeedSequence,
    origin: str,
) -> None:
    """Put absent robots into the arena; their controllers start, and they remember what the scenario says.

    Poses are cm, cm, rad; if they are None, free places are drawn from the sequence. Errors begin with `origin`.
    """
    swarm = open_block(block)
    numbers = np.random.PCG64(sequence).state["state"]  # of numpy's `default_rng`; see `util.generators.seed_pcg64`
    words = [half for name in ("state", "inc") for half in divmod(numbers[name], 2**64)]
    swarm.scene[0].placement_random = np.array([*words, 0, 0, 1], np.uint64)
    for number, robot in enumerate(robots):
        record = swarm.robots[robot]
        if record.present:
            continue
        begin_placement(block)
        if poses is None:
            if place_at_random(block, robot, robot + 1) != PLACED:
                raise ScenarioError(f"{origin}: no free place was found for robot {robot}")
            world.move(robot, (record.x, record.y, record.heading))
        else:
            pose = poses[number]
            x, y, _ = pose
            if not is_free(swarm, float(x), float(y), float(record.radius_cm) - TOLERANCE_CM):
                raise ScenarioError(
                    f"{origin}: robot {robot} cannot come to [{x:g}, {y:g}]: it would overlap a robot, a wall, an "
                    "obstacle or a movable; give a free place, or no poses"
                )
            world.move(robot, pose)
        record.present = True
        group = group_of(swarm, robot)
        member = robot - controllers[group].robots.start
        controllers[group].start([member])
        for name, value in scenario.robots[group].memory.items():
            controllers[group].memory[name][member] = value if np.ndim(value) == 0 else value[member]
        forget_signals(swarm, robot)
