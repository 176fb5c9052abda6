"""The rigid bodies of a swarm: robots, walls, obstacles and movables.

Contacts are hard, without bounce, and by default without friction: they never turn a robot (Enki). Wheels set the
bodies' velocities at the beginning of each control step, and changes made by contacts last until the next one. Thus a
robot that pushes one that holds still moves both at half its speed. Where there are movables, forces count: `shapes`.
"""

import warnings
import weakref
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.embodied.bodies import chipmunk
from epuck_sim.embodied.bodies.public_space import PublicSpace
from epuck_sim.embodied.bodies.shapes import Bodies, count_surfaces, make_bodies, make_surfaces
from epuck_sim.embodied.swarm import GROUND, SPACE, open_block
from epuck_sim.scenario.robot_kind import EPUCK, RobotKind
from epuck_sim.util.jit import address_of


class World:
    """The bodies of a swarm in one trial after the other.

    Compiled code moves them, by `chipmunk.move_bodies`, unless pymunk is another one than that code is made for. Then
    `is_public` is true, as is `scene.moved_publicly`, and `step` moves them in Python: slowly, to the same outcome.
    """

    is_public: bool
    """Whether Python moves the bodies."""
    _addresses: IntArray
    _public_space: PublicSpace

    def __init__(
        self,
        block: ByteArray,
        arenas: Sequence[Arena],
        *,
        friction: float = 0.0,
        drive_force_n: float = 0.5,
        kind: RobotKind = EPUCK,
    ) -> None:
        """Make the bodies, and write to the block where in the addresses they are; `place` begins a trial.

        Args:
            block: The swarm, in the first arena; it says whether robots touch each other.
            arenas: Every arena that there is in a trial, first the one that it begins with.
            friction: Coefficient between any two bodies that touch.
            drive_force_n: Largest force of wheels where there are movables, N.
            kind: What kind of robots they are.
        """
        reason = chipmunk.reason_for_public_way()
        self._block, self._swarm = block, open_block(block)
        self._finalizer: weakref.finalize[Any, Any] | None = None
        self._arenas, self._arena = arenas, arenas[0]
        self._friction = friction
        scene, robots = self._swarm.scene[0], len(self._swarm.robots)
        self._make_bodies = partial(make_bodies, arenas[0], robots, kind, friction, drive_force_n, touch=scene.touch)
        self._bodies: Bodies = self._make_bodies()
        self.is_public = bool(reason)
        self._number_bodies()
        if self.is_public:
            warnings.warn(
                f"{chipmunk.versions()}: {reason}; robots are moved by pymunk's public interface, to the same outcome, "
                "but many times as slowly; install pymunk 7.3",
                stacklevel=2,
            )

    def _number_bodies(self) -> None:
        """Write to the block where in the addresses its bodies are."""
        scene, bodies = self._swarm.scene[0], self._bodies
        scene.bodies = chipmunk.END
        scene.movables = scene.bodies + 2 * len(bodies.robots)
        end = scene.movables + chipmunk.MOVABLE_ADDRESSES * len(bodies.movables)
        scene.drives = end if bodies.drives else -1
        scene.surfaces = end + 2 * len(bodies.drives)
        scene.surface_count = len(bodies.surfaces)
        scene.moved_publicly = self.is_public

    def addresses(self) -> list[int]:
        """Return what the addresses begin with, up to where other parts of the swarm add theirs; see `use`."""
        if self.is_public:
            return [0] * chipmunk.END
        bodies, address = self._bodies, chipmunk.address
        room = max(map(count_surfaces, self._arenas)) - len(bodies.surfaces)
        things: list[chipmunk.Thing] = [each for disc in bodies.robots for each in disc]
        things += [each for parts in zip(bodies.movables, bodies.holds, strict=True) for each in (*parts[0], parts[1])]
        things += [each for drive in bodies.drives for each in drive]
        addresses = [0] * (chipmunk.PLACE_MOVABLES + 1) + chipmunk.function_addresses()
        addresses[GROUND] = address(bodies.ground)
        if bodies.movables:
            addresses[chipmunk.PLACE_MOVABLES] = address_of(chipmunk.place_movables)
        return addresses + [address(each) for each in [*things, *bodies.surfaces]] + [0] * room

    def use(self, block: ByteArray, addresses: IntArray) -> None:
        """Work on a block, the first one or one that is like it, from now on; the space is freed with the world.

        Args:
            block: The swarm.
            addresses: The array that begins with what `addresses` returns.
        """
        if self._finalizer:
            addresses[SPACE] = self._addresses[SPACE]
            self._finalizer.detach()
            if self.is_public:
                self._public_space.use(block)
        self._block, self._swarm, self._addresses = block, open_block(block), addresses
        self._number_bodies()
        self._finalizer = weakref.finalize(self, _free, addresses, self._bodies)

    def place(self) -> None:
        """Begin a trial in the first arena, which the block is in, with robots at rest where it says: all is as new.

        Without movables, and in the first arena, `chipmunk.place` does the same in compiled code.
        """
        if self._arena is not self._arenas[0]:
            self._surround(self._arenas[0])
        self._put_movables(self._arena.circles[self._arena.first_movable :, :2])
        if self.is_public:
            self._bodies = self._make_bodies()
            self._public_space = PublicSpace(self._block, self._bodies)
        else:
            chipmunk.place(self._block, self._addresses)

    def step(self) -> None:
        """Move the bodies for a control step."""
        if self.is_public:
            self._public_space.step()
        else:
            chipmunk.step(self._block, self._addresses)

    def change_arena(self, arena: Arena) -> None:
        """Put other walls and obstacles around all bodies where they are, in a block that is in that arena already.

        Places of movables are written to the block.
        """
        self._surround(arena)
        self._put_movables(np.array([body.position for body, _ in self._bodies.movables]).reshape(-1, 2))
        chipmunk.sort_robots(self._block)

    def move(self, robot: int, pose: Sequence[float]) -> None:
        """Put a robot at rest elsewhere, as one that has touched nothing yet; pose: x, y in cm and heading in rad."""
        record = self._swarm.robots[robot]
        record.x, record.y, record.heading = pose
        if self.is_public:
            self._public_space.rest(robot)
        else:
            chipmunk.rest(self._block, self._addresses, robot)

    def _surround(self, arena: Arena) -> None:
        """Put other walls and obstacles into the space."""
        bodies, scene = self._bodies, self._swarm.scene[0]
        old, self._arena = bodies.surfaces, arena
        bodies.surfaces = make_surfaces(bodies.ground, arena, self._friction)
        scene.surface_count = len(bodies.surfaces)
        if self.is_public:
            self._public_space.exchange_shapes(old, bodies.surfaces)
        else:
            chipmunk.exchange_shapes(int(self._addresses[SPACE]), old, bodies.surfaces)
            first = scene.surfaces
            self._addresses[first : first + len(bodies.surfaces)] = [chipmunk.address(each) for each in bodies.surfaces]

    def _put_movables(self, places_cm: FloatArray) -> None:
        """Write (movables, 2) cm to the block."""
        if len(places_cm):
            circles = self._swarm.circles[self._swarm.scene[0].first_movable :][: len(places_cm)]
            circles.x, circles.y = places_cm.T


def _free(addresses: IntArray, bodies: Bodies) -> None:
    joints = [*bodies.holds, *(joint for _, joint in bodies.drives)]
    discs = [*bodies.robots, *bodies.movables]
    shapes = [*bodies.surfaces, *(shape for _, shape in discs)]
    chipmunk.free_space(addresses, [*joints, *shapes, *(body for body, _ in discs), bodies.ground])
