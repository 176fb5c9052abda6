"""Which robots see whose lit rings, and which touch each other or a wall, in the present step; found if asked for."""

from collections.abc import Callable

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.embodied.observers.contacts import find_contacts
from epuck_sim.embodied.observers.scene import Scene
from epuck_sim.embodied.observers.visibility import find_all_sightings
from epuck_sim.embodied.swarm import poses_of


class Relations:
    """Finds who sees, and who touches, whom; each once a step, and only when asked."""

    def __init__(self, scene: Scene) -> None:
        """Take robots, and the arena in which they are, from a simulation's scene."""
        self._scene = scene
        self._last: dict[str, tuple[int, IntArray]] = {}

    def restart(self) -> None:
        """Forget what was found: in an earlier trial, or another arena."""
        self._last.clear()

    def sightings(self, step: int) -> IntArray:
        """Return (sightings, 2) robot that looks, and robot whose lit ring it sees, in the present step: `step`."""
        return self._once("sightings", step, self._find_sightings)

    def contacts(self, step: int) -> IntArray:
        """Return (contacts, 2) robot, and the robot that it touches, or -1: no robot; in the present step: `step`."""
        return self._once("contacts", step, lambda: find_contacts(self._scene, self._poses())[0])

    def _once(self, what: str, step: int, find: Callable[[], IntArray]) -> IntArray:
        if what not in self._last or self._last[what][0] != step:
            self._last[what] = step, find()[:, 1:].copy()
        return self._last[what][1]

    def _find_sightings(self) -> IntArray:
        robots = self._scene.swarm.robots
        return find_all_sightings(self._scene, self._poses(), robots.present, robots.ring_before[None].copy())

    def _poses(self) -> FloatArray:
        return poses_of(self._scene.swarm.robots)[None].copy()
