"""Changes of a schedule: robots that come and go, walls and phases.

Robots that are not in the arena are parked far outside, at rest and in the dark. There they touch nothing, hide nobody
and are not seen; their readings are blanked, and their controllers do not run.
"""

from collections.abc import Sequence

import numpy as np

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.interface import ACTUATORS
from epuck_sim.embodied import start
from epuck_sim.embodied.bodies.contacts import MARGIN_CM
from epuck_sim.embodied.bodies.world import World
from epuck_sim.embodied.sensors.infrared import read_nothing
from epuck_sim.embodied.sensors.signals import forget_signals
from epuck_sim.embodied.swarm import Swarm, group_of, open_block, swarm_at
from epuck_sim.embodied.user_code import GroupControllers
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.changes import RobotDisplacement
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.util.jit import jit_no_alloc

DEEPEST_CM = 2 * MARGIN_CM
"""Largest overlap of a body with new walls and obstacles, cm: as much as that of bodies that press on each other."""


@jit_no_alloc
def blank(block: ByteArray, _addresses: IntArray, number: int) -> None:
    """Blank infrared and pixels of a group's robots outside the arena; pulses stay, as no controller reads them."""
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
    """Stop all robots that are not in the arena and darken their rings, after commands have been carried out."""
    swarm = swarm_at(block)
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        if not robot.present:
            robot.ring_command, robot.ring_on = False, False
            robot.left_cm_s, robot.right_cm_s = 0.0, 0.0
            robot.vx, robot.vy, robot.spin = 0.0, 0.0, 0.0


def take_out(robots: Sequence[int], swarm: Swarm, world: World, controllers: Sequence[GroupControllers]) -> None:
    """Take robots out of the arena, and clear their memories and actuators."""
    for number in robots:
        world.move(number, start.parked_poses(np.array([number]))[0])
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
    world: World,
    controllers: Sequence[GroupControllers],
    sequence: np.random.SeedSequence,
    origin: str,
) -> None:
    """Put absent robots into the arena, start their controllers, and set the memories that the scenario gives.

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
        start.begin_placement(block)
        if poses is None:
            if start.place_at_random(block, robot, robot + 1) != start.PLACED:
                raise ScenarioError(f"{origin}: no free place was found for robot {robot}")
            world.move(robot, (record.x, record.y, record.heading))
        else:
            pose = poses[number]
            x, y, radius_cm = float(pose[0]), float(pose[1]), float(record.radius_cm) - start.TOLERANCE_CM
            if scenario.contact.robots:
                is_free = start.is_free(swarm, x, y, radius_cm)
            else:  # robots pass through each other
                is_free = start.clearance_cm(swarm, x, y, swarm.scene[0].circles) >= radius_cm - start.TOLERANCE_CM
            if not is_free:
                why = "it would overlap a robot, a wall, an obstacle or a movable; give a free place, or no poses"
                raise ScenarioError(f"{origin}: robot {robot} cannot come to [{x:g}, {y:g}]: {why}")
            world.move(robot, pose)
        record.present = True
        group = group_of(swarm, robot)
        member = robot - controllers[group].robots.start
        controllers[group].start([member])
        for name, value in scenario.robots[group].memory.items():
            controllers[group].memory[name][member] = value if np.ndim(value) == 0 else value[member]
        forget_signals(swarm, robot)


def check_bodies_outside(swarm: Swarm, origin: str) -> None:
    """Raise ScenarioError, which begins with `origin`, if a robot or a movable is in a wall or an obstacle."""
    scene, robots = swarm.scene[0], swarm.robots
    bodies = [(f"robot {robot}", robots[robot], robots[robot].radius_cm) for robot in np.flatnonzero(robots.present)]
    movables = swarm.circles[scene.first_movable : scene.circles]
    bodies += [(f"movable {number}", circle, circle.radius) for number, circle in enumerate(movables)]
    for name, place, radius_cm in bodies:
        overlap_cm = radius_cm - start.clearance_cm(swarm, float(place.x), float(place.y), scene.first_movable)
        if overlap_cm > DEEPEST_CM:
            said = f"{name} at [{place.x:.4g}, {place.y:.4g}] would be {overlap_cm:.3g} cm into a wall or an obstacle"
            raise ScenarioError(f"{origin}: {said}; change the arena elsewhere, or at another time")


def displace_phases(
    swarm: Swarm,
    controllers: Sequence[GroupControllers],
    displacement: RobotDisplacement,
    sequence: np.random.SeedSequence,
) -> None:
    """Displace phases, and command rings dark; random phases are drawn for all robots, displaced or not."""
    robots = np.arange(len(swarm.robots))
    drawn = np.random.Generator(np.random.SFC64(sequence)).random(len(robots))
    is_displaced = np.isin(robots, robots if displacement.robots is None else displacement.robots)
    by_cycles = displacement.by_cycles
    for group in controllers:
        if not group.controller.is_oscillator:
            continue
        phase_ms, period_ms = group.memory["phase_ms"], group.period_ms
        if isinstance(by_cycles, str):
            displaced = drawn[group.robots] * period_ms
        else:
            ahead_ms = np.round(by_cycles * period_ms, 6)  # 1450 ms, not 1449.9999999999998, for whole phases
            displaced = (phase_ms + ahead_ms) % period_ms
        rows = is_displaced[group.robots]
        phase_ms[rows] = displaced[rows]
        swarm.robots.actuators.ring_on[group.robots][rows] = 0
