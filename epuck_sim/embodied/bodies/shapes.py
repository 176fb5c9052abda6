"""Bodies and shapes in pymunk: of robots, of walls and obstacles, and of movables with what moves and holds them.

Movables are discs that robots push over the floor. The floor's friction on a movable is Coulomb's: up to its
coefficient times the weight, against the motion. Wheels drive a robot to the velocity that is commanded, or hold it
there, with a force in any direction up to a limit. So robots move a movable, at the commanded speed, if the forces with
which they press on it sum to more than its friction; else it stays.

Both forces are joints of pymunk that do not correct positions. In each physics step, a joint reduces a difference of
velocities, to 0 if it can, by an impulse of at most its force times the step. Robots thus follow their wheels one
physics step late. Forces take a few steps to balance; until then, even a movable that is too heavy creeps.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import pymunk

from epuck_sim.arena import Arena
from epuck_sim.embodied.bodies.contacts import MARGIN_CM
from epuck_sim.scenario.embodied import ContactSection
from epuck_sim.scenario.robot_kind import RobotKind

WALL_CM = 50.0  # thickness of the walls in cm: far more than a robot can cover in one physics step
GRAVITY_CM_S2 = 981.0  # acceleration of gravity in cm/s^2: weight per mass
DYNES_PER_NEWTON = 1e5  # force of 1 N in g cm/s^2, the unit of forces where masses are g and lengths cm
_ROBOTS = 1  # pymunk's group of shapes that do not touch each other: robots that pass through each other

Thing = pymunk.Body | pymunk.Shape | pymunk.Constraint

Disc = tuple[pymunk.Body, pymunk.Shape]  # the body of a robot or a movable, and its shape

Drive = tuple[pymunk.Body, pymunk.Constraint]
"""Drive of a robot where there are movables: a body with the commanded velocity, and the joint of the two."""


@dataclass
class Bodies:
    """All bodies of an arena."""

    ground: pymunk.Body  # the body of the floor, whose shapes are the surfaces
    surfaces: list[pymunk.Shape]  # walls and obstacles
    robots: list[Disc]
    movables: list[Disc]
    holds: list[pymunk.Constraint]  # the floor's friction on each movable
    drives: list[Drive]  # the drive of each robot; none without movables

    @property
    def listed(self) -> list[Thing]:
        """The parts that kernels move by Chipmunk, in the order of their addresses."""
        moved = [body for body, _ in (*self.movables, *self.drives)]
        return [*_each(self.robots), *moved, *self.surfaces]

    @property
    def pushed(self) -> list[Thing]:
        """The parts that are in the space for a whole trial, beside the ground and its surfaces, in this order."""
        return [*_each(self.movables), *self.holds, *(joint for _, joint in self.drives)]


def _each(discs: Sequence[tuple[Thing, ...]]) -> list[Thing]:
    return [thing for disc in discs for thing in disc]


def make_bodies(arena: Arena, kinds: Sequence[RobotKind], contact: ContactSection) -> Bodies:
    """Return the bodies of an arena and of robots of these kinds, at rest at the origin, movables where they begin."""
    friction = contact.friction
    ground = pymunk.Body(body_type=pymunk.Body.STATIC)
    discs = []
    for kind in kinds:
        moment = pymunk.moment_for_circle(kind.mass_g, 0, kind.radius_cm)
        discs.append(_disc(pymunk.Body(kind.mass_g, moment), kind.radius_cm, friction))
    for _, shape in () if contact.robots else discs:
        shape.filter = pymunk.ShapeFilter(group=_ROBOTS)
    movables, holds, drives = [], [], []
    for (x, y, radius), (mass_g, floor_friction) in zip(
        arena.circles[arena.first_movable :].tolist(), arena.movables.tolist(), strict=True
    ):
        body = pymunk.Body(mass_g, math.inf)  # does not turn
        body.position = x, y
        movables.append(_disc(body, radius, friction))
        holds.append(_limited_joint(ground, body, floor_friction * GRAVITY_CM_S2 * mass_g))
    for body, _ in discs if movables else ():
        drive = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        drives.append((drive, _limited_joint(drive, body, DYNES_PER_NEWTON * contact.drive_force_n)))
    return Bodies(ground, make_surfaces(ground, arena, friction), discs, movables, holds, drives)


def _disc(body: pymunk.Body, radius_cm: float, friction: float) -> Disc:
    shape = pymunk.Circle(body, radius_cm + MARGIN_CM)
    shape.friction = math.sqrt(friction)
    return body, shape


def _limited_joint(one: pymunk.Body, other: pymunk.Body, force: float) -> pymunk.Constraint:
    """Return a joint that drives `other` to the velocity of `one` with up to this force, g cm/s^2, at any distance."""
    joint = pymunk.PivotJoint(one, other, (0, 0), (0, 0))
    joint.max_bias = 0.0
    joint.max_force = force
    return joint


def count_surfaces(arena: Arena) -> int:
    """Return the number of the shapes of walls and obstacles."""
    return 4 + arena.first_movable + len(arena.polygons)


def make_surfaces(ground: pymunk.Body, arena: Arena, friction: float) -> list[pymunk.Shape]:
    """Return shapes of the ground: four slabs around the floor that overlap at the corners, and obstacles."""
    width, height, out = arena.width_cm, arena.height_cm, WALL_CM
    slabs = [
        (-out, -out, 0, height + out),
        (width, -out, width + out, height + out),
        (-out, -out, width + out, 0),
        (-out, height, width + out, height + out),
    ]
    polygons = [[(left, low), (right, low), (right, high), (left, high)] for left, low, right, high in slabs]
    polygons += [[(x, y) for x, y in corners.tolist()] for corners in arena.polygons]
    circles = arena.circles[: arena.first_movable].tolist()
    round_ones = [pymunk.Circle(ground, radius + MARGIN_CM, offset=(x, y)) for x, y, radius in circles]
    straight_ones = [pymunk.Poly(ground, corners, radius=MARGIN_CM) for corners in polygons]
    shapes = [*straight_ones[:4], *round_ones, *straight_ones[4:]]
    for shape in shapes:
        shape.friction = math.sqrt(friction)  # pymunk multiplies the friction of the two that touch
    return shapes
