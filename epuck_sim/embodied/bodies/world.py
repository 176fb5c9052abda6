"""The rigid bodies of a swarm: robots, walls, obstacles and movables.

Contacts are hard, without bounce, and by default without friction: they never turn a robot (Enki). Wheels set the
bodies' velocities at the beginning of each control step, and changes made by contacts last until the next one. Thus a
robot that pushes one that holds still moves both at half its speed.

Movables are discs that robots push over the floor. The floor's friction on a movable is Coulomb's: up to its
coefficient times the weight, against the motion. Wheels drive a robot to the velocity that is commanded, or hold it
there, with a force in any direction up to a limit. So robots move a movable, at the commanded speed, if the forces with
which they press on it sum to more than its friction; else it stays.

Both forces are joints of pymunk that do not correct positions. In each physics step, a joint reduces a difference of
velocities, to 0 if it can, by an impulse of at most its force times the step. Robots thus follow their wheels one
physics step late. Forces take a few steps to balance; until then, even a movable that is too heavy creeps.
"""

import math
import warnings
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import pymunk

from epuck_sim.arena import Arena
from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied.bodies import chipmunk
from epuck_sim.embodied.bodies.chipmunk import Thing
from epuck_sim.embodied.bodies.contacts import MARGIN_CM
from epuck_sim.embodied.cells import sort_into_cells
from epuck_sim.embodied.swarm import GROUND, SPACE, Swarm
from epuck_sim.scenario.embodied import ContactSection
from epuck_sim.scenario.robot_kind import RobotKind
from epuck_sim.util.provenance import format_versions, versions

WALL_CM = 50.0  # thickness of the walls in cm: far more than a robot can cover in one physics step
GRAVITY_CM_S2 = 981.0  # acceleration of gravity in cm/s^2: weight per mass
DYNES_PER_NEWTON = 1e5  # force of 1 N in g cm/s^2, the unit of forces where masses are g and lengths cm
_ROBOTS = 1  # pymunk's group of shapes that do not touch each other: robots that pass through each other

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
        return [*_each(self.robots), *(body for body, _ in (*self.movables, *self.drives)), *self.surfaces]

    @property
    def pushed(self) -> list[Thing]:
        """The parts that are in the space for a whole trial, beside the ground and its surfaces, in this order."""
        return [*_each(self.movables), *self.holds, *(joint for _, joint in self.drives)]

    def parts(self) -> list[Thing]:
        """Return all parts that may be in the space."""
        return [self.ground, *self.listed, *self.pushed]


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


class World:
    """The bodies of a swarm in one trial after the other.

    Compiled code moves them, by `chipmunk.move_bodies`, unless it does not fit this pymunk. Then `is_public` is true,
    as is `scene.moved_publicly`, and `step` moves them in Python: slowly, to the same outcome.
    """

    is_public: bool  # whether Python moves the bodies
    _addresses: npt.NDArray[Any]
    """The addresses in use, see `use`; pymunk's objects in their place where Python moves the bodies."""

    def __init__(self, arenas: Sequence[Arena], kinds: Sequence[RobotKind], contact: ContactSection) -> None:
        """Make the bodies; a trial begins in the first of the arenas, by `use` and `place`."""
        self._arenas, self._arena, self._friction = arenas, arenas[0], contact.friction
        self._make_bodies = partial(make_bodies, arenas[0], kinds, contact)
        self._bodies: Bodies = self._make_bodies()
        self._finalizer: weakref.finalize[Any, Any] | None = None
        reason = chipmunk.reason_for_public_way()
        self.is_public = bool(reason)
        self._way: Any = chipmunk.public_way() if reason else chipmunk
        if self.is_public:
            warnings.warn(
                f"{format_versions(versions())}: {reason}; robots are moved by pymunk's public interface, to the same "
                "outcome, but many times slower; install pymunk 7.3",
                stacklevel=2,
            )

    def addresses(self) -> list[int]:
        """Return the first addresses, to which other parts of the swarm add theirs; see `use`."""
        return [0] * chipmunk.END if self.is_public else self._listed()

    def _listed(self) -> list[Any]:
        """Return functions and bodies as kernels find them, with room for the surfaces of each arena."""
        bodies, way = self._bodies, self._way
        surfaces = (4 + arena.first_movable + len(arena.polygons) for arena in self._arenas)  # walls and obstacles
        room = max(surfaces) - len(bodies.surfaces)
        head = [0, way.address(bodies.ground), 0, 0, *way.function_addresses()]
        return [*head, *map(way.address, bodies.listed), *[0] * room]

    def use(self, block: ByteArray, swarm: Swarm, addresses: IntArray) -> None:
        """Use a block, and addresses that begin with those of `self.addresses`; `weakref` frees the space later."""
        self._block, self._swarm = block, swarm
        used = self._addresses[SPACE] if self._finalizer else 0
        self._addresses = np.array(self._listed()) if self.is_public else addresses
        self._addresses[SPACE] = used
        self._free_with_world()
        scene, bodies = swarm.scene[0], self._bodies
        scene.bodies = chipmunk.END
        scene.movables = scene.bodies + 2 * len(bodies.robots)
        end = scene.movables + len(bodies.movables)
        scene.drives = end if bodies.drives else -1
        scene.surfaces = end + len(bodies.drives)
        scene.surface_count = len(bodies.surfaces)
        scene.moved_publicly, scene.smooth = self.is_public, self._friction == 0

    def _free_with_world(self) -> None:
        if self._finalizer:
            self._finalizer.detach()
        self._finalizer = weakref.finalize(self, self._way.free_space, self._addresses, self._bodies.parts)

    def place(self) -> None:
        """Begin a trial in the first arena, with robots at rest where the block says and movables where they begin."""
        if self._arena is not self._arenas[0]:
            self._surround(self._arenas[0])
        if self._addresses[SPACE] != 0 and (self.is_public or self._bodies.movables):
            self._renew()
        self._way.place(self._block, self._addresses)
        if self._bodies.movables:
            self._way.add_to_space(self._addresses[SPACE], self._bodies.pushed)

    def _renew(self) -> None:
        """Make all bodies anew: old ones keep data of their last contacts, and joints their impulses."""
        self._way.free_space(self._addresses, self._bodies.parts)
        self._bodies = self._make_bodies()
        self._addresses[SPACE], self._addresses[GROUND] = 0, self._way.address(self._bodies.ground)
        listed = list(map(self._way.address, self._bodies.listed))
        self._addresses[chipmunk.END :][: len(listed)] = listed
        self._free_with_world()

    def step(self) -> None:
        """Move the bodies for a control step."""
        self._way.move_bodies(self._block, self._addresses)

    def change_arena(self, arena: Arena) -> None:
        """Put other walls and obstacles around all bodies where they are; the block is in that arena already."""
        self._surround(arena)
        if self._bodies.movables:
            circles = self._swarm.circles[self._swarm.scene[0].first_movable :][: len(self._bodies.movables)]
            circles.x, circles.y = np.transpose([body.position for body, _ in self._bodies.movables])
        sort_into_cells(self._block)

    def move(self, robot: int, pose: Sequence[float]) -> None:
        """Put a robot at rest elsewhere, as one that has touched nothing yet; pose: x, y in cm and heading in rad."""
        record = self._swarm.robots[robot]
        record.x, record.y, record.heading = pose
        self._way.rest(self._block, self._addresses, robot)

    def _surround(self, arena: Arena) -> None:
        bodies, scene = self._bodies, self._swarm.scene[0]
        old, self._arena = bodies.surfaces, arena
        bodies.surfaces = make_surfaces(bodies.ground, arena, self._friction)
        scene.surface_count = len(bodies.surfaces)
        self._way.take_from_space(self._addresses[SPACE], old)
        self._way.add_to_space(self._addresses[SPACE], bodies.surfaces)
        first = scene.surfaces
        self._addresses[first : first + len(bodies.surfaces)] = list(map(self._way.address, bodies.surfaces))
