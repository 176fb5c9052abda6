"""Faults that robots find by synchrony: who is seen and does not flash is suspected (Christensen et al. 2009; 6.2).

Each robot knows of each other one for how long it has had it in view without seeing its ring lit since it last did.
After `cycles` periods of that it suspects the other, until it sees it flash. The time in which another is out of view
does not count, nor do flashes then: that is where false alarms come from.
"""

from typing import Any

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.observers.scene import make_scene
from epuck_sim.embodied.observers.visibility import find_sightings

HALF_A_MILLISECOND = 0.0005
"""Allowance in seconds for the sum of many control steps."""

FLASHLESS = ("ring_dead", "oscillator_frozen")
"""Kinds of faults that keep a robot from flashing."""


class _Suspicion:
    """What both measures share: who suspects whom, and who does not flash."""

    MODELS = ("embodied",)

    def __init__(self, simulation: Any, *, cycles: float = 2.0) -> None:
        scenario, robots = simulation.scenario, len(simulation.period_ms)
        self._simulation = simulation
        self._arena: Arena | None = None  # for which the scene is
        self._step_s = 1 / scenario.timing.control_hz
        self._period_s: FloatArray = simulation.period_ms / 1000
        self._patience_s = cycles * self._period_s[:, None]
        self._dark_s = np.zeros((robots, robots))  # for which each has had each in view without a flash
        self._suspects: BoolArray = np.zeros((robots, robots), bool)
        self._faults: IntArray = np.zeros(robots, np.int64)  # that keep a robot from flashing, at present
        self._events = 0

    @staticmethod
    def check(parameters: Any) -> None:
        """Raise ValueError if no time without a flash is asked for."""
        if parameters.cycles <= 0:
            raise ValueError(f"cycles is {parameters.cycles:g}; allowed: above 0")

    def step(self, step: Any, state: Any) -> None:
        """Have each robot watch those in its view."""
        self._note_faults()
        poses = step.poses.copy()[None]
        if step.arena is not self._arena:
            scenario, self._arena = self._simulation.scenario, step.arena
            self._scene = make_scene(scenario.robots, scenario.robot, step.arena)
        circles = self._scene.swarm.circles
        circles["x"], circles["y"], circles["radius"] = step.arena.circles.T  # movables move
        for group in range(len(self._scene.groups)):
            _, observers, seen = find_sightings(self._scene, poses, group).T
            self._dark_s[observers, seen] += self._step_s
        observers, lit = step.sightings.T
        self._dark_s[observers, lit] = 0
        suspected_before = self._suspects
        self._suspects = self._dark_s >= self._patience_s - HALF_A_MILLISECOND
        self.take(self._suspects & ~suspected_before, state.time_s)

    def _note_faults(self) -> None:
        events = self._simulation.events
        for event in events[self._events :]:
            kind, _, change = event.what.partition(" ")
            if kind in FLASHLESS:
                self._faults[list(event.robots)] += 1 if change == "begins" else -1
        self._events = len(events)

    def take(self, begun: BoolArray, time_s: float) -> None:
        """Take note of suspicions that begin, (robots, robots) by whom of whom."""
        raise NotImplementedError


class DetectionDelay(_Suspicion):
    """Periods from when a robot ceases to flash until another suspects it, mean over all that do (robots)."""

    def __init__(self, simulation: Any, *, cycles: float = 2.0) -> None:
        super().__init__(simulation, cycles=cycles)
        self._since_s = np.full(len(self._period_s), np.nan)
        self._delay = np.full(len(self._period_s), np.nan)

    def take(self, _: BoolArray, time_s: float) -> None:
        """Note who has ceased to flash, and who of them is suspected for the first time."""
        self._since_s[(self._faults > 0) & np.isnan(self._since_s)] = time_s
        found = (self._faults > 0) & self._suspects.any(axis=0) & np.isnan(self._delay)
        self._delay[found] = (time_s - self._since_s[found]) / self._period_s[found]

    def value(self) -> float | None:
        """Return the mean; None if nobody ceased to flash, or one of them was never suspected."""
        delays = self._delay[~np.isnan(self._since_s)]
        return None if not len(delays) or np.isnan(delays).any() else float(delays.mean())


class FalseAlarms(_Suspicion):
    """Suspicions of robots that flash, of each robot in an hour (robots)."""

    def __init__(self, simulation: Any, *, cycles: float = 2.0) -> None:
        super().__init__(simulation, cycles=cycles)
        self._alarms, self._steps = 0, 0

    def take(self, begun: BoolArray, _: float) -> None:
        """Count the suspicions that begin of robots that flash."""
        self._alarms += int(begun[:, self._faults == 0].sum())
        self._steps += 1

    def value(self) -> float | None:
        """Return the mean number; None before the first step."""
        hours = self._steps * self._step_s / 3600
        return self._alarms / len(self._faults) / hours if hours else None
