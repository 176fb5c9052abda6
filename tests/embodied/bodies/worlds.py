"""Worlds without scenarios, and their slow twin: all robots are in pymunk's space, and its own methods move them."""

import numpy as np
import pymunk

from epuck_sim.arena import Arena, make_arena
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.bodies.contacts import SLOP_CM
from epuck_sim.embodied.bodies.world import World, make_bodies
from epuck_sim.embodied.observers import make_scene
from epuck_sim.embodied.swarm import offset_of, poses_of
from epuck_sim.scenario.embodied import ContactSection
from epuck_sim.scenario.robot_kind import EPUCK
from epuck_sim.scenario.robots import RobotGroup


class MovedWorld:
    """A world with robots at given places, for any number of physics steps at a time.

    Poses and velocities are (robots, 3) cm, cm, rad, and as much in a second: in place.
    """

    def __init__(self, arena: Arena, poses, friction: float = 0.0, physics_hz: int = 100, **how: object) -> None:
        """Begin a trial with ten physics steps in a control step; how: further fields of `ContactSection`."""
        places, kinds = np.array(poses, float), [EPUCK] * len(poses)
        groups = [RobotGroup(signal={"kind": "radio"}, count=1)] * len(poses)
        _, self.block, self.swarm = make_scene(groups, kinds, arena)
        scene, robots = self.swarm.scene[0], self.swarm.robots
        scene.physics_steps, scene.physics_s, scene.touch = 10, 1.0 / physics_hz, True
        robots.present, robots.wheel_gain = True, 1.0
        self.world = World([arena], kinds, ContactSection(friction=friction, **how))
        self.world.use(self.block, self.swarm, np.array(self.world.addresses()))
        self.poses, self.is_in_space = poses_of(robots), robots.in_space
        self.velocities = np.ndarray((len(robots), 3), np.float64, robots, offset_of("vx"), (robots.strides[0], 8))
        self.poses[:] = places
        self.world.place()

    def advance(self, steps: int = 10) -> None:
        """Move the bodies for this number of physics steps with the velocities that were written."""
        self.swarm.scene[0].physics_steps = steps
        self.world.step()


class FullSpaceWorld:
    def __init__(self, arena: Arena, poses, friction: float = 0.0, physics_hz: int = 100) -> None:
        self.poses = np.array(poses, float)
        self.velocities = np.zeros_like(self.poses)
        self._bodies = make_bodies(arena, [EPUCK] * len(poses), ContactSection(friction=friction))
        self._step_s = 1.0 / physics_hz
        self._space = pymunk.Space()
        self._space.collision_slop, self._space.collision_bias = SLOP_CM, 0.0
        self._space.add(self._bodies.ground, *self._bodies.surfaces)
        for (body, disc), (x, y, heading) in zip(self._bodies.robots, self.poses.tolist(), strict=True):
            body.position, body.angle = (x, y), heading
            self._space.add(body, disc)

    def advance(self, steps: int = 10) -> None:
        for (body, _), (x, y, turn) in zip(self._bodies.robots, self.velocities.tolist(), strict=True):
            body.velocity, body.angular_velocity = (x, y), turn
        for _ in range(steps):
            self._space.step(self._step_s)
        self.poses[:] = [(*body.position, body.angle) for body, _ in self._bodies.robots]


def advanced(worlds, velocities, steps: int = 10):
    for world in worlds:
        world.velocities[:] = velocities
        world.advance(steps)
    return worlds


def overlap_cm(positions: FloatArray) -> float:
    """Return the largest overlap of two robots at (robots, 2) cm; negative if there is none."""
    one, other = np.triu_indices(len(positions), 1)
    apart = np.hypot(*(positions[one] - positions[other]).T)
    return float(2 * EPUCK.radius_cm - apart.min())


def squeeze(robots: int, aside_cm: float = 1.1, late_s: float = 0.0, speed_cm_s: float = 0.0):
    """Return an arena, poses and velocities: rows of robots drive at each other, and squeeze out one between them.

    It is then a little off their line, on its way to another one that drives at it.
    """
    ahead = np.sqrt(7.4**2 - aside_cm**2) + 7.4 * np.arange(robots) + 12.8 * late_s
    y = 125 + speed_cm_s * late_s - aside_cm
    rows = [[125 - x, y, 0.0] for x in ahead] + [[125 + x, y, np.pi] for x in ahead]
    poses = np.array([[125, 125, np.pi / 2], *rows, [125, 135.321, -np.pi / 2]])
    speeds = np.array([speed_cm_s] + [12.8] * (2 * robots + 1))
    velocities = np.column_stack([speeds * np.cos(poses[:, 2]), speeds * np.sin(poses[:, 2]), 0 * speeds])
    return make_arena(250, 250, [], []), poses, velocities
