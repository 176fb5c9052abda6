"""Motion by pymunk's public interface alone, slowly: for versions whose C functions compiled code cannot call.

Each function here is the twin of one in `chipmunk`, and does the same in the same order: outcomes are equal to the bit.
"""

import math
from collections.abc import Iterable

import numpy as np
import pymunk

from epuck_sim.arrays import ByteArray
from epuck_sim.embodied.bodies.chipmunk import SLOP_CM, sort_robots
from epuck_sim.embodied.bodies.contact_candidates import PUSHED_CM, add_reached, find_contact_candidates
from epuck_sim.embodied.bodies.shapes import Bodies
from epuck_sim.embodied.swarm import open_block, swarm_at
from epuck_sim.util.jit import jit_no_alloc


class PublicSpace:
    """The space of one trial after the other."""

    def __init__(self, block: ByteArray, bodies: Bodies) -> None:
        """Begin a trial with bodies that have never been in a space; robots are where the block says."""
        self.use(block)
        self.bodies = bodies
        self._space = pymunk.Space()
        self._space.collision_slop, self._space.collision_bias = SLOP_CM, 0.0
        self._space.add(bodies.ground, *bodies.surfaces)
        for disc in bodies.movables:
            self._space.add(*disc)
        self._space.add(*bodies.holds, *(joint for _, joint in bodies.drives))
        robots = self._swarm.robots
        robots.in_space = False
        robots.vx = robots.vy = robots.spin = 0.0
        sort_robots(block)

    def use(self, block: ByteArray) -> None:
        """Work on a block that is like the first one from now on."""
        self._block, self._swarm = block, open_block(block)

    def rest(self, number: int) -> None:
        """Put a robot at rest, as one that has touched nothing yet, and sort all robots into cells."""
        robot, (body, _) = self._swarm.robots[number], self.bodies.robots[number]
        if robot.in_space:
            self._leave(number)
        body.velocity, body.angular_velocity = (0.0, 0.0), 0.0
        pymunk.Body.update_position(body, 0.0)
        body.position, body.angle = (0.0, 0.0), 0.0
        robot.vx, robot.vy, robot.spin = 0.0, 0.0, 0.0
        sort_robots(self._block)

    def exchange_shapes(self, old: Iterable[pymunk.Shape], new: Iterable[pymunk.Shape]) -> None:
        """Take shapes out of the space, and put others into it."""
        self._space.remove(*old)
        self._space.add(*new)

    def step(self) -> None:
        """Move all bodies for a control step."""
        scene, robots = self._swarm.scene[0], self._swarm.robots
        fastest_cm_s = find_candidates(self._block)
        for number, robot in enumerate(robots):
            if robot.in_space and not robot.may_touch:
                self._leave(number)
            if robot.may_touch:
                self._enter(number)
        candidates = np.flatnonzero(robots.may_touch[self._swarm.members.robot])
        self._swarm.numbers[: len(candidates)] = candidates
        if len(candidates):
            self._step_space(len(candidates), fastest_cm_s)
        outside, time_s = ~robots.in_space, scene.physics_steps * scene.physics_s
        for part, rate in ("x", "vx"), ("y", "vy"), ("heading", "spin"):
            robots[part][outside] += robots[rate][outside] * time_s
        sort_robots(self._block)

    def _step_space(self, inside: int, fastest_cm_s: float) -> None:
        scene, robots, numbers = self._swarm.scene[0], self._swarm.robots, self._swarm.numbers
        members = self._swarm.members
        candidates = inside
        for step in range(scene.physics_steps):
            past_s, index = step * scene.physics_s, 0
            path_cm = fastest_cm_s * past_s + PUSHED_CM
            while scene.touch and step > 0 and index < inside:
                start = members[numbers[index]]
                body = self.bodies.robots[start.robot].body
                x, y = body.position
                dx, dy = x - start.x, y - start.y
                if dx * dx + dy * dy > path_cm * path_cm or index >= candidates:
                    speed = math.hypot(*body.velocity) + fastest_cm_s
                    entered, inside = inside, add_robots_reached(self._block, inside, x, y, speed, past_s)
                    for member in numbers[entered:inside]:
                        self._enter(members[member].robot)
                index += 1
            self._space.step(scene.physics_s)
        for member in numbers[:inside]:
            number = members[member].robot
            robot, body = robots[number], self.bodies.robots[number].body
            robot.x, robot.y = body.position
            robot.heading = body.angle
        for circle, (body, _) in zip(self._swarm.circles[scene.first_movable :], self.bodies.movables, strict=False):
            circle.x, circle.y = body.position

    def _enter(self, number: int) -> None:
        robot, disc = self._swarm.robots[number], self.bodies.robots[number]
        if not robot.in_space:
            self._space.add(*disc)
            disc.body.position, disc.body.angle = (robot.x, robot.y), robot.heading
            robot.in_space = True
        driven = self.bodies.drives[number].body if self.bodies.drives else disc.body
        driven.velocity, disc.body.angular_velocity = (robot.vx, robot.vy), robot.spin

    def _leave(self, number: int) -> None:
        disc = self.bodies.robots[number]
        self._space.remove(disc.shape, disc.body)
        self._swarm.robots[number].in_space = False


@jit_no_alloc
def find_candidates(block: ByteArray) -> float:
    """Find the robots of a block that may touch something; return the speed of the fastest, cm/s."""
    return find_contact_candidates(swarm_at(block))


@jit_no_alloc
def add_robots_reached(block: ByteArray, found: int, x: float, y: float, approach_cm_s: float, past_s: float) -> int:
    """Find further robots of a block that may touch one; see `contact_candidates.add_reached`."""
    return add_reached(swarm_at(block), found, x, y, approach_cm_s, past_s)
