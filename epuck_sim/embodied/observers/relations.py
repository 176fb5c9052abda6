"""Which robots see whose lit rings, and which touch each other or a wall, in the present step; found if asked for."""

from collections.abc import Callable

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.observers.contacts import find_contacts
from epuck_sim.embodied.observers.scene import Scene
from epuck_sim.embodied.observers.visibility import find_sightings
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
        """Return (sightings, 3) of lit rings; robots that look from where they are parked see none."""
        robots, groups = self._scene.swarm.robots, range(len(self._scene.groups))
        lit, poses = robots.ring_before[None].copy(), self._poses()
        found: IntArray = np.concatenate([find_sightings(self._scene, poses, group, listed=lit) for group in groups])
        present: BoolArray = robots.present
        return found[present[found[:, 1]]]

    def _poses(self) -> FloatArray:
        return poses_of(self._scene.swarm.robots)[None].copy()
