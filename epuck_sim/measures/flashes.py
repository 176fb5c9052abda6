"""Flashes that robots see, miss, or see for longer than a step, and robots that are suspected as no flash is seen.

Faults are found by synchrony (Christensen et al. 2009; 6.2): each robot counts for how long it has had each other robot
in view since it last saw that robot's ring lit. After `cycles` periods in view it suspects the other, until it sees it
flash. Time out of view does not count, nor do flashes in that time, which is the source of false alarms.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.measures.common import ABOVE_0, Share, Shipped, allowed, check_sight, rows_of_steps, share
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
        sightings = stretch.sightings
        ends = rows_of_steps(sightings, stretch)
        count_views(self._views, self._seen, self._counts, sightings, ends, stretch.ring_on)


@jit
def count_views(
    views: IntArray, seen: BoolArray, counts: IntArray, sightings: IntArray, ends: IntArray, ring_on: BoolArray
) -> None:
    """Count the views of flashes in the steps of a `Stretch`; a flash is over when its ring can no longer be seen.

    Updates `views`, (robots, robots) steps in which the flash of each robot is in view of each other; `seen`, (2,
    robots) rings that can be seen in a step, and in the step before; and `counts`, (3,) pairs of a flash that is over
    and another robot: all, in view, in view in several steps. A step sees rings as `ring_on` (steps, robots) has them
    in the step before; its sightings begin at its row in `ends` (steps + 1,).
    """
    shows, showed = seen
    for step in range(len(ring_on)):
        for robot in range(len(shows)):
            if not showed[robot] or shows[robot]:
                continue
            counts[0] += len(shows) - 1  # no robot sees itself
            for other in range(len(shows)):
                counts[1] += views[robot, other] > 0
                counts[2] += views[robot, other] > 1
                views[robot, other] = 0
        for row in range(ends[step], ends[step + 1]):
            views[sightings[row, 2], sightings[row, 1]] += 1
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
    _events = 0

    def __post_init__(self) -> None:
        robots = len(self.simulation.period_ms)
        self._step_s = 1 / self.simulation.scenario.timing.control_hz
        self._period_s: FloatArray = self.simulation.period_ms / 1000
        self._patience_s = self.cycles * self._period_s[:, None]
        self._dark_s = np.zeros((robots, robots))  # for which [robot] has had [other] in view without a flash
        self._suspects: BoolArray = np.zeros((robots, robots), bool)
        self._faults: IntArray = np.zeros(robots, np.int64)  # number of present faults that keep a robot from flashing

    def stretch(self, stretch: Any, _: Any) -> None:
        views = stretch.views
        rows = rows_of_steps(views, stretch)
        begun = np.zeros_like(self._suspects)
        step = 0
        while step < len(stretch.poses):
            # the first step of a fault is watched by itself, to find robots that are already suspected
            last = step + 1
            if not self._note_faults(stretch.first + step):  # up to the next fault
                later = (event.step - stretch.first for event in self.simulation.events[self._events :])
                last = int(min([*later, len(stretch.poses)]))
            seen = views, rows, stretch.ring_before, step, last
            end = watch(self._dark_s, self._suspects, begun, self._patience_s, self._step_s, *seen)
            self.take(begun, (stretch.first + end - 1) * self.simulation.step_s, end - step)
            step = end

    def _note_faults(self, step: int) -> bool:
        """Update faults for a step, and return whether anything has changed."""
        events = [event for event in self.simulation.events[self._events :] if event.step <= step]
        for event in events:
            kind, _, change = event.what.partition(" ")
            if kind in FLASHLESS:
                self._faults[list(event.robots)] += 1 if change == "begins" else -1
        self._events += len(events)
        return bool(events)

    def take(self, begun: BoolArray, time_s: float, steps: int) -> None:
        """Record steps up to a time, and the (robots, robots) suspicions that begin in the last of them."""
        raise NotImplementedError


@jit
def watch(
    dark_s: FloatArray,
    suspects: BoolArray,
    begun: BoolArray,
    patience_s: FloatArray,
    step_s: float,
    views: IntArray,
    ends: IntArray,
    is_lit: BoolArray,
    first: int,
    end: int,
) -> int:
    """Update suspicions from step `first` until one begins, or up to `end`; return the step after the last one.

    Updates `dark_s`, (robots, robots) s for which each has had each other in view without a flash; `suspects`, who
    suspects whom; and `begun`, suspicions that begin in the last step. `patience_s` is (robots, 1). `views` are those
    of a `Stretch`; those of each step begin at its row in `ends` (steps + 1,). `is_lit` are (steps, robots) rings that
    show lit.
    """
    begun[:] = False
    for step in range(first, end):
        is_any = False
        for row in range(ends[step], ends[step + 1]):
            robot, other = views[row, 1], views[row, 2]
            dark_s[robot, other] = 0.0 if is_lit[step, other] else dark_s[robot, other] + step_s
            is_suspect = dark_s[robot, other] >= patience_s[robot, 0] - HALF_A_MILLISECOND
            if is_suspect and not suspects[robot, other]:
                begun[robot, other] = is_any = True
            suspects[robot, other] = is_suspect
        if is_any:
            return step + 1
    return end


class DetectionDelay(_Suspicion):
    """Periods from when a robot stops flashing until another suspects it, mean over all that stop (robots)."""

    UNIT = "cycles"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._since_s, self._delay = np.full((2, len(self._period_s)), np.nan)

    def take(self, _: BoolArray, time_s: float, steps: int) -> None:  # noqa: ARG002 are for the other
        """Record which robots have stopped flashing, and which of these are suspected for the first time."""
        self._since_s[(self._faults > 0) & np.isnan(self._since_s)] = time_s
        found = (self._faults > 0) & self._suspects.any(axis=0) & np.isnan(self._delay)
        self._delay[found] = (time_s - self._since_s[found]) / self._period_s[found]

    def value(self) -> float | None:
        """Return the mean; None if no robot stopped flashing, or one that did was never suspected."""
        delays = self._delay[~np.isnan(self._since_s)]
        return None if not len(delays) or np.isnan(delays).any() else float(delays.mean())


class FalseAlarms(_Suspicion):
    """Suspicions of robots that do flash, per robot and hour (robots)."""

    UNIT = "1/h"
    _alarms, _steps = 0, 0

    def take(self, begun: BoolArray, _: float, steps: int) -> None:
        self._alarms += int(begun[:, self._faults == 0].sum())
        self._steps += steps

    def value(self) -> float | None:
        """Return the mean number; None before the first step."""
        return share(self._alarms / len(self._faults), self._steps * self._step_s / 3600)
