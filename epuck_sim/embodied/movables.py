"""Movables: discs that robots push over the floor, and the limited force of wheels that push them.

The floor's friction on a movable is Coulomb's: up to its coefficient times the weight, against the motion. Wheels drive
a robot to the velocity that is commanded, or hold it there, with a force in any direction up to a limit. So pushers
move what they press on if their forces sum to more than its friction, at the commanded speed; else it stays.

Both forces are joints of pymunk without a memory of places: in each physics step, a joint changes a difference of
velocities by an impulse of at most its force times the step, as much as it takes to make the difference 0. Robots thus
follow their wheels one physics step late. Forces take a few steps to balance, in which even what is too heavy creeps.
"""

import math

import numpy as np
import pymunk
from pymunk._chipmunk_cffi import ffi, lib

from epuck_sim.arena import Arena
from epuck_sim.arrays import IntArray
from epuck_sim.embodied.contact_candidates import MARGIN_CM

GRAVITY_CM_S2 = 981.0
"""Acceleration of gravity in cm/s^2, which makes a weight of a mass."""

DYNES_PER_NEWTON = 1e5
"""Force of 1 N in g cm/s^2, the unit of forces where masses are g and lengths cm."""


class Movables:
    """The movables of one trial after the other, and the drives of robots among them."""

    addresses: IntArray
    """(movables,) address of each `cpBody`; written by `enter`."""
    drive_addresses: IntArray
    """(robots,) address of the `cpBody` that has the velocity to which each robot is driven."""

    def __init__(
        self, arena: Arena, ground: pymunk.Body, robots: list[pymunk.Body], friction: float, drive_force_n: float
    ) -> None:
        """Prepare the movables of an arena.

        Args:
            arena: The arena; where its movables are now is where they begin in each trial.
            ground: The body of the floor.
            robots: Bodies of all robots; none if there is nothing to push.
            friction: Root of the coefficient of friction between any two bodies that touch.
            drive_force_n: Largest force of a robot's wheels, N.
        """
        self._circles = arena.circles[arena.first_movable :]
        self._start = self._circles.copy()
        self._masses_g, self._floor_friction = arena.movables.T.tolist() if len(arena.movables) else ([], [])
        self._ground, self._robots, self._friction = ground, robots, friction
        self._drive_force = DYNES_PER_NEWTON * drive_force_n
        self._drives = [pymunk.Body(body_type=pymunk.Body.KINEMATIC) for _ in robots]
        self._discs: list[tuple[pymunk.Body, pymunk.Circle]] = []
        self._joints: list[pymunk.Constraint] = []
        self.addresses = np.zeros(len(self._start), np.int64)
        self.drive_addresses = np.array([_address(drive) for drive in self._drives], np.int64)

    def move_to(self, arena: Arena) -> None:
        """Have the movables be among the circles of another arena, where they are now."""
        circles = arena.circles[arena.first_movable :]
        circles[:] = self._circles
        self._circles = circles

    def enter(self, space: pymunk.Space) -> None:
        """Put movables at rest where they begin, and all joints, as new ones: old ones know their last impulses."""
        self._circles[:] = self._start
        self._discs = [self._disc(*each) for each in zip(self._start.tolist(), self._masses_g, strict=True)]
        self.addresses[:] = [_address(body) for body, _ in self._discs]
        self._joints = [
            _limited_joint(self._ground, body, friction * GRAVITY_CM_S2 * mass_g)
            for (body, _), mass_g, friction in zip(self._discs, self._masses_g, self._floor_friction, strict=True)
        ]
        self._joints += [
            _limited_joint(drive, robot, self._drive_force)
            for drive, robot in zip(self._drives, self._robots, strict=True)
        ]
        for body, disc in self._discs:
            lib.cpSpaceAddBody(space._space, body._body)
            lib.cpSpaceAddShape(space._space, disc._shape)
        for joint in self._joints:
            lib.cpSpaceAddConstraint(space._space, joint._constraint)

    def leave(self, space: pymunk.Space) -> None:
        """Take movables and joints out of the space that they entered last, if any."""
        for joint in self._joints:
            lib.cpSpaceRemoveConstraint(space._space, joint._constraint)
        for body, disc in self._discs:
            lib.cpSpaceRemoveShape(space._space, disc._shape)
            lib.cpSpaceRemoveBody(space._space, body._body)
        self._joints, self._discs = [], []

    def _disc(self, circle: list[float], mass_g: float) -> tuple[pymunk.Body, pymunk.Circle]:
        """Return the body of a movable, which does not turn, and its shape."""
        x, y, radius = circle
        body = pymunk.Body(mass_g, math.inf)
        body.position = x, y
        disc = pymunk.Circle(body, radius + MARGIN_CM)
        disc.friction = self._friction
        return body, disc


def _limited_joint(one: pymunk.Body, other: pymunk.Body, force: float) -> pymunk.PivotJoint:
    """Return a joint that lets `other` move as `one` as far as a force, g cm/s^2, can, wherever the two are."""
    joint = pymunk.PivotJoint(one, other, (0, 0), (0, 0))
    joint.max_bias = 0.0
    joint.max_force = force
    return joint


def _address(body: pymunk.Body) -> int:
    """Return the address of a body's `cpBody`."""
    return int(ffi.cast("uintptr_t", body._body))
