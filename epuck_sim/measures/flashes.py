"""Flashes that robots see, miss, or see for longer than a step, and whom they suspect because they see none of them.

Faults are found by synchrony (Christensen et al. 2009; 6.2): each robot knows of each other one for how long it has had
it in view without seeing its ring lit since it last did. After `cycles` periods of that it suspects the other, until it
sees it flash. The time in which another is out of view does not count, nor do flashes then: that is where false alarms
come from.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.measures.common import ABOVE_0, Share, Shipped, allowed, check_sight, rows_of_steps, share
from epuck_sim.util.jit import jit

HALF_A_MILLISECOND = 0.0005  # allowance in seconds for the sum of many control steps
FLASHLESS = ("ring_dead", "oscillator_frozen")  # kinds of faults that keep a robot from flashing


class FlashesSeen(Share):
    """Mean number of flashes that a robot sees in a cycle; one seen for several steps counts once (robots)."""

    MODELS = ("embodied",)

    def __post_init__(self) -> None:
        self._is_seen = np.zeros(len(self.simulation.period_ms), np.bool_)

    def step(self, step: Any, state: Any) -> None:
        is_seen = step.flash_seen
        self._part += int(np.count_nonzero(is_seen & ~self._is_seen))
        self._is_seen = is_seen
        self._whole = len(is_seen) * state.cycles


class _FlashViews(Shipped):
    """Base class of two measures: in how many steps of each flash each other robot has it in view."""

    MODELS = ("embodied",)
    check_scenario = staticmethod(check_sight)

    def __post_init__(self) -> None:
        robots = len(self.simulation.period_ms)
        self._views: IntArray = np.zeros((robots, robots), np.int64)  # of the flash of each robot, by each robot
        self._seen: BoolArray = np.zeros((2, robots), np.bool_)  # rings that show in a step, and in the step before
        self._counts: IntArray = np.zeros(3, np.int64)  # pairs of a flash and another robot; with views, with several

    def stretch(self, stretch: Any, _: Any) -> None:
        sightings = stretch.sightings
        ends = rows_of_steps(sightings, stretch)
        count_views(self._views, self._seen, self._counts, sightings, ends, stretch.ring_on)


@jit
def count_views(
    views: IntArray, seen: BoolArray, counts: IntArray, sightings: IntArray, ends: IntArray, ring_on: BoolArray
) -> None:
    """Count the views of flashes in the steps of a `Stretch`; a flash whose ring can be seen no more is over.

    Changes the (robots, robots) views of the flash of each robot by each other one, the (2, robots) rings that can be
    seen in a step, and that could be in the step before, and the (3,) counts of flashes that are over, for each other
    robot, of those that it had in view, and in several steps. A ring is seen as it is in the step before, `ring_on`
    (steps, robots); sightings of each step begin at (steps + 1,) rows.
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
        """Return the share; None without a flash that is over."""
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
        self._dark_s = np.zeros((robots, robots))  # for which each has had each in view without a flash
        self._suspects: BoolArray = np.zeros((robots, robots), bool)
        self._faults: IntArray = np.zeros(robots, np.int64)  # that keep a robot from flashing, at present

    def stretch(self, stretch: Any, _: Any) -> None:
        views = stretch.views
        rows = rows_of_steps(views, stretch)
        begun = np.zeros_like(self._suspects)
        step = 0
        while step < len(stretch.poses):
            # who is suspected already when a fault begins is found in its first step, which is watched by itself
            last = step + 1
            if not self._note_faults(stretch.first + step):  # up to the next fault
                later = (event.step - stretch.first for event in self.simulation.events[self._events :])
                last = int(min([*later, len(stretch.poses)]))
            seen = views, rows, stretch.ring_before, step, last
            end = watch(self._dark_s, self._suspects, begun, self._patience_s, self._step_s, *seen)
            self.take(begun, (stretch.first + end - 1) * self.simulation.step_s, end - step)
            step = end

    def _note_faults(self, step: int) -> bool:
        """Return whether faults begin or end in a step."""
        events = [event for event in self.simulation.events[self._events :] if event.step <= step]
        for event in events:
            kind, _, change = event.what.partition(" ")
            if kind in FLASHLESS:
                self._faults[list(event.robots)] += 1 if change == "begins" else -1
        self._events += len(events)
        return bool(events)

    def take(self, begun: BoolArray, time_s: float, steps: int) -> None:
        """Take note of steps up to a time, and of (robots, robots) suspicions that begin in the last of them."""
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
    """Have robots watch those in their view, from step `first` to one in which a suspicion begins or that before `end`.

    Changes the time, (robots, robots) s, for which each has had each in view without a flash, who suspects whom, and
    whose suspicion of whom begins in the last of the steps; patience is (robots, 1) s. Views are those of a `Stretch`,
    with (steps + 1,) rows from which on each step's are, and (steps, robots) the rings that show lit. Returns the step
    after the last of the steps.
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
    """Periods from when a robot ceases to flash until another suspects it, mean over all that do (robots)."""

    UNIT = "cycles"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._since_s, self._delay = np.full((2, len(self._period_s)), np.nan)

    def take(self, _: BoolArray, time_s: float, steps: int) -> None:  # noqa: ARG002 are for the other
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

    UNIT = "1/h"
    _alarms, _steps = 0, 0

    def take(self, begun: BoolArray, _: float, steps: int) -> None:
        self._alarms += int(begun[:, self._faults == 0].sum())
        self._steps += steps

    def value(self) -> float | None:
        """Return the mean number; None before the first step."""
        return share(self._alarms / len(self._faults), self._steps * self._step_s / 3600)
