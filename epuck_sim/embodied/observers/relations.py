"""Which robots see whose lit rings, and which touch each other or a wall, in the present step; found if asked for."""

from collections.abc import Callable

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.observers.contacts import find_contacts
from epuck_sim.embodied.observers.scene import Scene
from epuck_sim.embodied.observers.visibility import find_sightings
from epuck_sim.embodied.swarm import Swarm, poses_of
from epuck_sim.scenario.embodied import EmbodiedScenario


class Relations:
    """Finds who sees, and who touches, whom; each once a step, and only when asked."""

    def __init__(self, scenario: EmbodiedScenario, swarm: Swarm, arena: Arena) -> None:
        """Take robots and circles from a swarm, of `open_block`, and the rest from the arena in which it is."""
        self._scenario, self._swarm, self._arena = scenario, swarm, arena
        self._made: Scene | None = None
        self._last: dict[str, tuple[int, IntArray]] = {}

    def restart(self) -> None:
        """Forget what was found in steps of an earlier trial."""
        self._last.clear()

    def sightings(self, step: int) -> IntArray:
        """Return (sightings, 2) robot that looks, and robot whose lit ring it sees, in the present step: `step`."""
        return self._once("sightings", step, self._find_sightings)

    def contacts(self, step: int) -> IntArray:
        """Return (contacts, 2) robot, and the robot that it touches, or -1: no robot; in the present step: `step`."""
        return self._once("contacts", step, lambda: find_contacts(self._scene(), self._poses())[0])

    def _once(self, what: str, step: int, find: Callable[[], IntArray]) -> IntArray:
        """Return what was found in this step already, or else find it."""
        if what not in self._last or self._last[what][0] != step:
            self._last[what] = step, find()[:, 1:].copy()
        return self._last[what][1]

    def _find_sightings(self) -> IntArray:
        """Return (sightings, 3) of lit rings; robots that look from where they are parked see none."""
        robots, scene, poses = self._swarm.robots, self._scene(), self._poses()
        groups, lit = range(len(scene.groups)), robots.ring_before
        found: IntArray = np.concatenate([find_sightings(scene, poses, group, listed=lit) for group in groups])
        present: BoolArray = robots.present
        return found[present[found[:, 1]]]

    def _scene(self) -> Scene:
        """Return the arena with movables where they are now."""
        if self._made is None:
            self._made = Scene(self._scenario.robots, self._scenario.robot, self._arena)
        circles = self._made.swarm.circles
        circles[:] = self._swarm.circles[: len(circles)]
        return self._made

    def _poses(self) -> FloatArray:
        return poses_of(self._swarm.robots)[None].copy()
