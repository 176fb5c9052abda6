"""Which robots see whose lit rings, and which touch each other or a wall, in the present step; found if asked for."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.cell_list import CellList, make_cell_list
from epuck_sim.embodied.contacts import surfaces_of, write_contacts
from epuck_sim.embodied.swarm_arrays import SwarmArrays
from epuck_sim.embodied.visibility import SIGHTING_WRITERS, View, view_of
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.util.addresses import compiled_for
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import bind, jit_no_alloc

ROOM = 4
"""Sightings, or contacts, of each robot for which there is room at first; more is made when it is needed."""


_NOTHING = np.empty((0, 2), np.int64)


class SightingSearch(NamedTuple):
    """What is needed to find the lit rings that a group sees."""

    poses: FloatArray
    """(1, robots, 3) cm, cm, rad: x, y, heading."""
    ring_before: BoolArray
    """(robots,) the rings of the step before, which are those that robots see."""
    labels: IntArray
    """(robots,) scratch."""
    circles: FloatArray
    edges: FloatArray
    cells: CellList
    sees_with: View
    first: int
    """Number of the group's first robot."""
    observers: int
    """Number of its robots."""
    found: IntArray
    """(room, 3) output."""


class ContactSearch(NamedTuple):
    """What is needed to find contacts."""

    poses: FloatArray
    """(1, robots, 3) cm, cm, rad: x, y, heading."""
    width_cm: float
    height_cm: float
    circles: FloatArray
    edges: FloatArray
    corners: IntArray
    """(polygons + 1,) index in `edges` of each polygon's first edge."""
    cells: CellList
    radius_cm: float
    """Radius of a robot."""
    points: FloatArray
    """(room, 2) output."""
    found: IntArray
    """(room, 3) output."""


if TYPE_CHECKING:  # `bind` provides them
    value_at: Callable[[int], Any]
    write: Callable[..., int]


@jit_no_alloc
def label_lit(ring_before: BoolArray, labels: IntArray) -> bool:
    """Write the number of each robot whose ring was lit, counted from 1, and 0 for others; return whether any was."""
    any_lit = False
    for robot in range(len(labels)):
        labels[robot] = robot + 1 if ring_before[robot] else 0
        any_lit |= ring_before[robot]
    return any_lit


def _write_lit_sightings(address: int) -> int:
    """Write the sightings of lit rings, as far as there is room; return their number."""
    search = value_at(address)  # noqa: F821 see `bind`
    if not label_lit(search.ring_before, search.labels):
        return 0
    return write(  # noqa: F821 see `bind`
        search.poses,
        search.labels,
        search.circles,
        search.edges,
        search.cells,
        search.sees_with,
        search.first,
        search.observers,
        search.found,
    )


_WRITE_LIT_SIGHTINGS = {kind: bind(_write_lit_sightings, write=writer) for kind, writer in SIGHTING_WRITERS.items()}
"""`_write_lit_sightings` by what robots see with."""


def _write_contacts(address: int) -> int:
    """Write the contacts, as far as there is room; return their number."""
    search = value_at(address)  # noqa: F821 see `bind`
    return write_contacts(
        search.poses,
        search.width_cm,
        search.height_cm,
        search.circles,
        search.edges,
        search.corners,
        search.cells,
        search.radius_cm,
        search.found,
        search.points,
    )


class _Finder:
    """Carries out a search, with more room if it finds more."""

    def __init__(self, write: Callable[[int], int], make_search: Callable[[int], Any], room: int) -> None:
        self._make_search = make_search
        self._search = make_search(room)
        self._owner, self._address = hold(self._search)
        self._write = compiled_for(write, self._search)

    def find(self) -> IntArray:
        """Return (found, 2) what is found: a robot, and another."""
        number = int(self._write(self._address))
        if number > len(self._search.found):
            self._search = self._make_search(2 * number)
            self._owner, self._address = hold(self._search)
            self._write(self._address)
        found: IntArray = self._search.found[:number, 1:].copy()
        return found


class Relations:
    """Finds who sees, and who touches, whom; each once a step, and only when asked."""

    def __init__(self, scenario: EmbodiedScenario, swarm: SwarmArrays) -> None:
        self._scenario, self._swarm = scenario, swarm
        self._sightings: list[_Finder] | None = None
        self._contacts: _Finder | None = None
        self._last: dict[str, tuple[int, IntArray]] = {}

    def change_arena(self, swarm: SwarmArrays) -> None:
        """Search among other walls and obstacles from now on; swarm: the robots' arrays with them."""
        self._swarm = swarm
        self._sightings = self._contacts = None
        self._last.clear()

    def restart(self) -> None:
        """Forget what was found in steps of an earlier trial."""
        self._last.clear()

    def sightings(self, step: int) -> IntArray:
        """Return (sightings, 2) robot that looks, and robot whose lit ring it sees, in the present step.

        Args:
            step: Number of the present step.
        """
        if self._sightings is None:
            self._sightings = self._sighting_finders()
        finders = self._sightings
        return self._once(
            "sightings",
            step,
            lambda: self._of_present(np.concatenate([_NOTHING, *(finder.find() for finder in finders)])),
        )

    def _of_present(self, sightings: IntArray) -> IntArray:
        """Return sightings without those of robots that look from where they are parked."""
        return sightings[self._swarm.sensors.present[sightings[:, 0]]]

    def contacts(self, step: int) -> IntArray:
        """Return (contacts, 2) robot, and the robot that it touches in the present step, or -1: no robot, but a thing.

        Args:
            step: Number of the present step.
        """
        if self._contacts is None:
            self._contacts = _Finder(_write_contacts, self._contact_search, ROOM * len(self._swarm.poses))
        finder = self._contacts
        return self._once("contacts", step, finder.find)

    def _once(self, what: str, step: int, find: Callable[[], IntArray]) -> IntArray:
        """Return what was found in this step already, or else find it."""
        if what not in self._last or self._last[what][0] != step:
            self._last[what] = step, find()
        return self._last[what][1]

    def _cells(self) -> CellList:
        """Return a cell list of one's own: the simulation's is left alone."""
        arena = self._swarm.arena
        return make_cell_list(arena.width_cm, arena.height_cm, len(self._swarm.poses), self._scenario.robot.cell_cm)

    def _sighting_finders(self) -> list[_Finder]:
        finders, first = [], 0
        for group in self._scenario.robots:
            view = view_of(group, self._scenario.robot)
            if view is not None:
                make = partial(self._sighting_search, view, first, group.count)
                finders.append(_Finder(_WRITE_LIT_SIGHTINGS[type(view)], make, ROOM * group.count))
            first += group.count
        return finders

    def _sighting_search(self, view: View, first: int, observers: int, room: int) -> SightingSearch:
        swarm = self._swarm
        return SightingSearch(
            poses=swarm.poses[None],
            ring_before=swarm.ring_before,
            labels=np.zeros(len(swarm.poses), np.int64),
            circles=swarm.arena.circles,
            edges=swarm.arena.edges,
            cells=self._cells(),
            sees_with=view,
            first=first,
            observers=observers,
            found=np.zeros((room, 3), np.int64),
        )

    def _contact_search(self, room: int) -> ContactSearch:
        surfaces = surfaces_of(self._swarm.arena)
        found, points = np.zeros((room, 3), np.int64), np.zeros((room, 2))
        radius_cm = float(self._scenario.robot.radius_cm)
        return ContactSearch(self._swarm.poses[None], *surfaces, self._cells(), radius_cm, points, found)
