"""Flashes that robots see, miss, or see for longer than a step, and robots that are suspected as no flash is seen.

Faults are found by synchrony (Christensen et al. 2009; 6.2): each robot counts for how long it has had each other robot
in view since it last saw that robot's ring lit. After `cycles` periods in view it suspects the other, until it sees it
flash. Time out of view does not count, nor do flashes in that time, which is the source of false alarms.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.measures.common import ABOVE_0, Share, Shipped, allowed, check_sight, share
from epuck_sim.util.jit import jit

HALF_A_MILLISECOND = 0.0005  # tolerance in seconds for rounding in the sum of many control steps
FLASHLESS = ("ring_dead", "oscillator_frozen")  # kinds of faults that keep a robot from flashing


class FlashesSeen(Share):
    """Mean number of flashes that a robot sees in a cycle; one seen for several steps counts once (robots)."""

    MODELS = ("embodied",)

    def __post_init__(self) -> None:
        self._last: BoolArray = np.zeros((1, len(self.simulation.period_ms)), np.bool_)

    def stretch(self, stretch: Any, state: Any) -> None:
        is_seen = np.concatenate([self._last, stretch.flash_seen])
        self._part += int(np.count_nonzero(is_seen[1:] & ~is_seen[:-1]))
        self._last = is_seen[-1:]
        self._whole = is_seen.shape[1] * state.cycles


class _FlashViews(Shipped):
    """Base class of two measures: the number of steps for which each flash is in view of each other robot."""

    MODELS = ("embodied",)
    check_scenario = staticmethod(check_sight)

    def __post_init__(self) -> None:
        robots = len(self.simulation.period_ms)
        self._views: IntArray = np.zeros((robots, robots), np.int64)  # steps of the flash of [robot] in view of [other]
        self._seen: BoolArray = np.zeros((2, robots), np.bool_)  # rings that show in a step, and in the step before
        self._counts: IntArray = np.zeros(3, np.int64)  # flashes times others: all, in view, in view in several steps

    def stretch(self, stretch: Any, _: Any) -> None:
        count_views(self._views, self._seen, self._counts, stretch.sightings, stretch.ring_on)


@jit
def count_views(views: IntArray, seen: BoolArray, counts: IntArray, sightings: IntArray, ring_on: BoolArray) -> None:
    """Count the views of flashes in the steps of a `Stretch`; a flash is over when its ring can no longer be seen.

    Updates `views`, (robots, robots) steps in which the flash of each robot is in view of each other; `seen`, (2,
    robots) rings that can be seen in a step, and in the step before; and `counts`, (3,) pairs of a flash that is over
    and another robot: all, in view, in view in several steps. A ring that is on, (steps, robots), shows a step later.
    """
    (shows, showed), row = seen, 0
    for step in range(len(ring_on)):
        for robot in range(len(shows)):
            if not showed[robot] or shows[robot]:
                continue
            counts[0] += len(shows) - 1  # no robot sees itself
            for other in range(len(shows)):
                counts[1] += views[robot, other] > 0
                counts[2] += views[robot, other] > 1
                views[robot, other] = 0
        while row < len(sightings) and sightings[row, 0] == step:
            views[sightings[row, 2], sightings[row, 1]] += 1
            row += 1
        showed[:] = shows
        shows[:] = ring_on[step]


class FlashesMissed(_FlashViews):
    """Share of all flashes of others that a robot never has in view, mean over robots (robots)."""

    def value(self) -> float | None:
        """Return the share; None if no flash is over."""
        pairs, in_view, _ = self._counts.tolist()
        return 1 - in_view / pairs if pairs else None


class FlashesRepeated(_FlashViews):
    """Share of the flashes in view that are in view in more than one step, mean over robots (robots)."""

    def value(self) -> float | None:
        """Return the share; None if no robot had a flash in view."""
        _, in_view, repeated = self._counts.tolist()
        return share(repeated, in_view)


@dataclass
class _Suspicion(Shipped):
    """Base class of two measures: who suspects whom, and who does not flash."""

    cycles: float = 2.0
    check, check_scenario = staticmethod(allowed(cycles=ABOVE_0)), staticmethod(check_sight)
    MODELS = ("embodied",)
    _events, _steps, _alarms = 0, 0, 0

    def __post_init__(self) -> None:
        robots = len(self.simulation.period_ms)
        self._step_s = 1 / self.simulation.scenario.timing.control_hz
        self._period_s: FloatArray = self.simulation.period_ms / 1000
        self._dark_s = np.zeros((robots, robots))  # for which [robot] has had [other] in view without a flash
        self._suspects: BoolArray = np.zeros((robots, robots), bool)
        self._faults: IntArray = np.zeros(robots, np.int64)  # number of present faults that keep a robot from flashing
        # steps in which each robot first did not flash, and in which it was first suspected then; -1 before
        self._silent, self._found = np.full((2, robots), -1)

    def stretch(self, stretch: Any, _: Any) -> None:
        steps = len(stretch.poses)
        faults = np.tile(self._faults, (steps, 1))
        for event in self.simulation.events[self._events :]:
            kind, _, change = event.what.partition(" ")
            if kind in FLASHLESS:
                faults[event.step - stretch.first :, list(event.robots)] += 1 if change == "begins" else -1
        self._events = len(self.simulation.events)
        states = self._dark_s, self._suspects, self._silent, self._found
        seen = stretch.views, stretch.ring_before, faults
        self._alarms += watch(*states, self.cycles * self._period_s, self._step_s, *seen, stretch.first)
        self._steps += steps
        self._faults = faults[-1]


@jit
def watch(
    dark_s: FloatArray,
    suspects: BoolArray,
    silent: IntArray,
    found: IntArray,
    patience_s: FloatArray,
    step_s: float,
    views: IntArray,
    is_lit: BoolArray,
    faults: IntArray,
    first: int,
) -> int:
    """Update suspicions in the steps of a `Stretch`, from step `first` on; return how many begin of robots that flash.

    Updates the states of a `_Suspicion`. `patience_s` is (robots,). `views` are those of the stretch, `is_lit` (steps,
    robots) rings that show lit, and `faults` numbers of faults that keep them dark.
    """
    alarms = row = 0
    for step in range(len(is_lit)):
        while row < len(views) and views[row, 0] == step:
            robot, other = views[row, 1], views[row, 2]
            dark_s[robot, other] = 0.0 if is_lit[step, other] else dark_s[robot, other] + step_s
            is_suspect = dark_s[robot, other] >= patience_s[robot] - HALF_A_MILLISECOND
            alarms += is_suspect and not suspects[robot, other] and not faults[step, other]
            suspects[robot, other] = is_suspect
            row += 1
        for robot in range(len(found)):
            if faults[step, robot]:
                silent[robot] = first + step if silent[robot] < 0 else silent[robot]
                found[robot] = first + step if found[robot] < 0 and suspects[:, robot].any() else found[robot]
    return alarms


class DetectionDelay(_Suspicion):
    """Periods from when a robot stops flashing until another suspects it, mean over all that stop (robots)."""

    UNIT = "cycles"

    def value(self) -> float | None:
        """Return the mean; None if no robot stopped flashing, or one that did was never suspected."""
        stopped, step_s = self._silent >= 0, self.simulation.step_s
        delays = (self._found * step_s - self._silent * step_s) / self._period_s
        return float(delays[stopped].mean()) if stopped.any() and (self._found[stopped] >= 0).all() else None


class FalseAlarms(_Suspicion):
    """Suspicions of robots that do flash, per robot and hour (robots)."""

    UNIT = "1/h"

    def value(self) -> float | None:
        """Return the mean number; None before the first step."""
        return share(self._alarms / len(self._faults), self._steps * self._step_s / 3600)
