"""The rigid bodies: robots, walls and obstacles in pymunk's space.

Contacts are hard, without bounce, and by default without friction: they never turn a robot (Enki). Wheels set the
bodies' velocities at the beginning of each control step, and changes made by contacts last until the next one. Thus a
robot that pushes one that holds still moves both at half its speed. Where there are movables, forces count: `movables`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pymunk
import pymunk.batch
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import BodyFields

from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.bodies_tuple import Bodies
from epuck_sim.embodied.cell_list import make_cell_list, sort_into_cells
from epuck_sim.embodied.chipmunk import move_bodies
from epuck_sim.embodied.contact_candidates import MARGIN_CM
from epuck_sim.embodied.movables import Movables
from epuck_sim.embodied.pymunk_functions import POSE, VELOCITY, Batch, calls_with, pointer_value
from epuck_sim.embodied.solid_surfaces import obstacle_shapes, wall_shapes
from epuck_sim.scenario.robot_kind import EPUCK, RobotKind

_ROBOTS = 1
"""pymunk's group of shapes that do not touch each other: robots that pass through each other."""


class World:
    """The bodies of one trial after the other; a space is never used for a second one (viblo/pymunk#181)."""

    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading; updated by `advance`. Headings count full turns."""
    velocities: FloatArray
    """(robots, 3) cm/s, cm/s, rad/s: to be written before `advance`."""
    bodies: Bodies
    """What compiled code moves; it holds `poses` and `velocities`."""

    def __init__(
        self,
        arena: Arena,
        poses: FloatArray,
        friction: float,
        physics_hz: int,
        *,
        touch: bool = True,
        drive_force_n: float = 0.5,
        robot: RobotKind = EPUCK,
    ) -> None:
        """Put robots at (robots, 3) `poses` into the arena.

        Args:
            arena: The arena, in cm; where its movables are is written to it.
            poses: (robots, 3) cm, cm, rad: x, y, heading.
            friction: Coefficient between any two bodies that touch.
            physics_hz: Physics steps in a second.
            touch: Whether robots touch each other; else they pass through each other.
            drive_force_n: Largest force of wheels where there are movables, N.
            robot: What kind of robots they are.
        """
        root = friction**0.5  # pymunk multiplies the friction of the two that touch
        self._friction, self._cell_cm = root, robot.cell_cm
        self._ground = pymunk.Body(body_type=pymunk.Body.STATIC)
        self._fixed = self._surfaces(arena)
        own = pymunk.ShapeFilter(group=0 if touch else _ROBOTS)  # shapes of one group do not touch each other
        self._space = pymunk.Space()
        self._discs = [_disc(robot, root, own) for _ in poses]  # in the space while they may touch something
        self.poses = np.empty_like(poses)
        self.velocities = np.empty_like(poses)
        # compiled code refers to both by their addresses only
        self._batches = {
            "poses": Batch(POSE, self.poses),
            "velocities": Batch(VELOCITY, self.velocities),
            "turns": Batch(BodyFields.ANGULAR_VELOCITY, self.velocities),
            "circles": Batch(BodyFields.POSITION, arena.circles),
        }
        robots = [body for body, _ in self._discs] if len(arena.movables) else []
        self._movables = Movables(arena, self._ground, robots, root, drive_force_n)
        self.bodies = Bodies(
            poses=self.poses,
            velocities=self.velocities,
            width_cm=arena.width_cm,
            height_cm=arena.height_cm,
            radius_cm=float(robot.radius_cm),
            circles=arena.circles,
            edges=arena.edges,
            cells=make_cell_list(arena.width_cm, arena.height_cm, len(poses), self._cell_cm),
            touch=touch,
            step_s=1.0 / physics_hz,
            calls=calls_with(self._batches),
            pointers=np.array([[pointer_value(body._body), pointer_value(disc._shape)] for body, disc in self._discs]),
            present=np.ones(len(poses), np.bool_),
            is_candidate=np.zeros(len(poses), np.bool_),
            reached=np.zeros(len(poses), np.int64),
            is_in_space=np.zeros(len(poses), np.bool_),
            movables=self._movables.addresses,
            drives=self._movables.drive_addresses,
        )
        self.place(poses)

    def place(self, poses: FloatArray) -> None:
        """Put the robots at rest at (robots, 3) `poses`: cm, cm, rad; from there on the world is as good as new."""
        self._empty_space()
        self._space = space = pymunk.Space()
        space.collision_slop = 2 * MARGIN_CM
        space.collision_bias = 0.0  # an overlap is gone after one physics step
        # pymunk's own methods would take half of the time
        lib.cpSpaceAddBody(space._space, self._ground._body)
        for shape in self._fixed:
            lib.cpSpaceAddShape(space._space, shape._shape)
        self._movables.enter(space)
        self.bodies.calls["space"] = pointer_value(space._space)
        self.poses[:] = poses
        self.velocities[:] = 0.0
        sort_into_cells(self.poses, self.bodies.cells)

    def change_arena(self, arena: Arena) -> None:
        """Put other walls and obstacles around all bodies where they are; makes `bodies` anew.

        arena: The new arena, with as many movables; where these are now is written to it.
        """
        for shape in self._fixed:
            if lib.cpShapeGetSpace(shape._shape) != ffi.NULL:
                lib.cpSpaceRemoveShape(self._space._space, shape._shape)
        self._fixed = self._surfaces(arena)
        for shape in self._fixed:
            lib.cpSpaceAddShape(self._space._space, shape._shape)
        self._movables.move_to(arena)
        batch = self._batches["circles"] = Batch(BodyFields.POSITION, arena.circles)
        self.bodies.calls["circles"], self.bodies.calls["circles_index"] = batch.pointer, batch.index_pointer
        self.bodies = self.bodies._replace(
            width_cm=arena.width_cm,
            height_cm=arena.height_cm,
            circles=arena.circles,
            edges=arena.edges,
            cells=make_cell_list(arena.width_cm, arena.height_cm, len(self.poses), self._cell_cm),
        )
        sort_into_cells(self.poses, self.bodies.cells)

    def move(self, robot: int, pose: Sequence[float]) -> None:
        """Put a robot at rest elsewhere, as one that has touched nothing yet; pose: x, y in cm and heading in rad."""
        body, disc = self._discs[robot]
        if self.bodies.is_in_space[robot]:
            lib.cpSpaceRemoveShape(self._space._space, disc._shape)
            lib.cpSpaceRemoveBody(self._space._space, body._body)
            self.bodies.is_in_space[robot] = False
        _forget_motion(body._body)
        self.poses[robot] = pose
        self.velocities[robot] = 0.0
        sort_into_cells(self.poses, self.bodies.cells)

    def _surfaces(self, arena: Arena) -> list[pymunk.Shape]:
        """Return the shapes of walls and obstacles."""
        shapes = wall_shapes(self._ground, arena) + obstacle_shapes(self._ground, arena)
        for shape in shapes:
            shape.friction = self._friction
        return shapes

    def _empty_space(self) -> None:
        """Take everything out of the space: pymunk takes the bodies away from the shapes that it finds at its end."""
        self._movables.leave(self._space)
        in_space = [self._discs[robot] for robot in np.flatnonzero(self.bodies.is_in_space)]
        for shape in [*(disc for _, disc in in_space), *self._fixed]:
            if lib.cpShapeGetSpace(shape._shape) != ffi.NULL:
                lib.cpSpaceRemoveShape(self._space._space, shape._shape)
        for body in [*(body for body, _ in in_space), self._ground]:
            if lib.cpBodyGetSpace(body._body) != ffi.NULL:
                lib.cpSpaceRemoveBody(self._space._space, body._body)
        self.bodies.is_in_space[:] = False
        for body, _ in self._discs:
            _forget_motion(body._body)

    def advance(self, steps: int) -> None:
        """Move the bodies for this number of physics steps with the velocities that were written."""
        move_bodies(self.bodies, steps)


def _disc(robot: RobotKind, friction: float, shape_filter: pymunk.ShapeFilter) -> tuple[pymunk.Body, pymunk.Circle]:
    """Return the body of a robot, and its shape."""
    body = pymunk.Body(robot.mass_g, pymunk.moment_for_circle(robot.mass_g, 0, robot.radius_cm))
    disc = pymunk.Circle(body, robot.radius_cm + MARGIN_CM)
    disc.friction = friction
    disc.filter = shape_filter
    return body, disc


def _forget_motion(body: Any) -> None:
    """Set a body to rest at the origin as a new one: from its last place, contacts would be found in another order."""
    lib.cpBodySetVelocity(body, (0.0, 0.0))
    lib.cpBodySetAngularVelocity(body, 0.0)
    lib.cpBodyUpdatePosition(body, 0.0)  # forgets what its last contact was to correct in the next step
    lib.cpBodySetPosition(body, (0.0, 0.0))
    lib.cpBodySetAngle(body, 0.0)
