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
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied.bodies import chipmunk
from epuck_sim.embodied.bodies.shapes import Bodies, count_surfaces, make_bodies, make_surfaces
from epuck_sim.embodied.cells import sort_into_cells
from epuck_sim.embodied.swarm import GROUND, SPACE, Swarm
from epuck_sim.scenario.embodied import ContactSection
from epuck_sim.scenario.robot_kind import RobotKind
from epuck_sim.util.provenance import format_versions, versions


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
        room = max(map(count_surfaces, self._arenas)) - len(bodies.surfaces)
        head = [0, way.address(bodies.ground), 0, *way.function_addresses()]
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
        self._finalizer = weakref.finalize(self, self._way.free_space, self._addresses, self._bodies)

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
        self._way.free_space(self._addresses, self._bodies)
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
