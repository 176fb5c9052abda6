"""Control steps in a row, which compiled code takes at once and measures see together."""

from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray
from epuck_sim.embodied.loop import DONE, FIRED, ControlLoop, take_steps
from epuck_sim.embodied.observers import Scene, find_all_sightings, find_contacts, make_scene
from epuck_sim.embodied.swarm import Swarm, swarm_at
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.util.jit import bind, jit_no_alloc

MOST_STEPS = 50
"""Largest number of steps that compiled code takes before Python has its turn, for Ctrl-C and for progress."""


class Stretch(NamedTuple):
    """Steps in a row, in one arena with the same robots; the last of them is the simulation's last step.

    The arrays are overwritten by the next stretch: copy what you keep.
    """

    first: int
    """Number of the first step."""
    poses: FloatArray
    """(steps, robots, 3) cm, cm, rad: x, y, heading."""
    wheels_cm_s: FloatArray
    """(steps, robots, 2) cm/s: left and right wheel as commanded."""
    ring_on: BoolArray
    """(steps, robots): whether the ring is lit."""
    ring_before: BoolArray
    """(steps, robots): whether it was lit before controllers acted, which is what others see."""
    present: BoolArray
    """(robots,): whether each robot is in the arena."""
    scene: Scene
    """The arena, and places for robots, for those who look from outside."""

    @property
    def sightings(self) -> IntArray:
        """(sightings, 3) step from 0, robot that looks, and robot whose lit ring it sees, as `Step.sightings`."""
        return find_all_sightings(self.scene, self.poses, self.present, self.ring_before)

    @property
    def views(self) -> IntArray:
        """(views, 3) step from 0, robot that looks, and robot that is in its view, lit or not."""
        return find_all_sightings(self.scene, self.poses, self.present, None)

    @property
    def contacts(self) -> IntArray:
        """(contacts, 3) step from 0, robot, and the robot that it touches, or -1, as `Step.contacts`."""
        return find_contacts(self.scene, self.poses)[0]


@jit_no_alloc
def record_steps(
    block: ByteArray,
    addresses: IntArray,
    steps: int,
    poses: FloatArray,
    wheels_cm_s: FloatArray,
    ring_on: BoolArray,
    ring_before: BoolArray,
) -> int:
    """Take control steps until the reference fires, as `take_steps` does, and write what `Stretch` has of each."""
    robots = swarm_at(block).robots
    outcome = DONE
    for step in range(steps):
        outcome = take_steps(block, addresses, 1, True)
        if outcome >= 0:
            break
        for number in range(len(robots)):
            robot = robots[number]
            poses[step, number, 0], poses[step, number, 1], poses[step, number, 2] = robot.x, robot.y, robot.heading
            wheels_cm_s[step, number, 0], wheels_cm_s[step, number, 1] = robot.left_cm_s, robot.right_cm_s
            ring_on[step, number], ring_before[step, number] = robot.ring_on, robot.ring_before
        if outcome == FIRED:
            break
    return outcome


class History:
    """Takes steps of a simulation's control loop, and keeps what measures need of them."""

    def __init__(self, scenario: EmbodiedScenario, block: ByteArray, swarm: Swarm, loop: ControlLoop) -> None:
        """Make room for `MOST_STEPS` steps, and compile what takes them."""
        self._scenario, self._block, self._swarm, self._loop = scenario, block, swarm, loop
        robots = len(swarm.robots)
        self._arrays: tuple[Any, ...] = (
            *(np.zeros((MOST_STEPS, robots, columns)) for columns in (3, 2)),
            *(np.zeros((MOST_STEPS, robots), np.bool_) for _ in range(2)),
        )
        record: Any = record_steps
        in_python = {"take_steps": loop.take_steps, "swarm_at": lambda _: swarm}
        self._record = record if loop.is_compiled else bind(record.function, **in_python)
        self._scene: tuple[Arena, Scene] | None = None
        self.take(0)  # compiles now, which belongs to no trial's time

    def take(self, steps: int) -> int:
        """Take up to so many steps, as `record_steps` does."""
        return int(self._record(self._block, self._loop.addresses, steps, *self._arrays))

    def stretch(self, first: int, steps: int, arena: Arena) -> Stretch:
        """Return so many steps that were taken from step `first` on, in this arena."""
        if self._scene is None or self._scene[0] is not arena:
            self._scene = arena, make_scene(self._scenario.robots, self._scenario.group_kinds, arena)
        scene = self._scene[1]
        circles = scene.swarm.circles
        circles["x"], circles["y"], circles["radius"] = arena.circles.T  # movables move
        present: BoolArray = self._swarm.robots.present
        poses, wheels, ring_on, ring_before = (each[:steps] for each in self._arrays)
        return Stretch(first, poses, wheels, ring_on, ring_before, present, scene)
