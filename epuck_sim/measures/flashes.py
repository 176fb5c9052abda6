"""Flashes that robots see, miss, or see for longer than a step."""

from typing import Any

import numpy as np

from epuck_sim.arrays import BoolArray, IntArray
from epuck_sim.measures.common import Share, Shipped, check_sight, rows_of_steps, share


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
    """What both measures below share: in how many steps of each flash each other robot has it in view."""

    MODELS = ("embodied",)
    check_scenario = staticmethod(check_sight)
    _is_lit = False  # any ring, now or in the step before
    _pairs, _seen, _repeated = 0, 0, 0

    def __post_init__(self) -> None:
        robots = len(self.simulation.period_ms)
        self._views: IntArray = np.zeros((robots, robots), np.int64)  # of the flash of each robot, by each robot
        self._ring_on: BoolArray = np.zeros(robots, np.bool_)  # in the step before, which is what is seen
        self._was_seen: BoolArray = np.zeros(robots, np.bool_)

    def stretch(self, stretch: Any, _: Any) -> None:
        sightings = stretch.sightings
        ends = rows_of_steps(sightings, stretch)
        for step, is_any_lit in enumerate(stretch.ring_on.any(axis=1).tolist()):
            if is_any_lit or self._is_lit:  # else there is nothing to see, nor to close
                self._look(sightings[ends[step] : ends[step + 1], 1:], stretch.ring_on[step])
                self._is_lit = bool(self._ring_on.any() or self._was_seen.any())

    def _look(self, sightings: IntArray, ring_on: BoolArray) -> None:
        """Count what is seen in a step, and close the flashes whose rings can be seen no more."""
        over = np.flatnonzero(self._was_seen & ~self._ring_on)
        if len(over):
            views = self._views[over]
            self._pairs += views.size - len(over)  # no robot sees itself
            self._seen += int(np.count_nonzero(views))
            self._repeated += int(np.count_nonzero(views > 1))
            self._views[over] = 0
        if self._ring_on.any():
            looks, lit = sightings.T
            self._views[lit, looks] += 1
        self._was_seen = self._ring_on
        self._ring_on = ring_on.copy()


class FlashesMissed(_FlashViews):
    """Share of all flashes of others that a robot never has in view, mean over robots (robots)."""

    def value(self) -> float | None:
        """Return the share; None without a flash that is over."""
        return 1 - self._seen / self._pairs if self._pairs else None


class FlashesRepeated(_FlashViews):
    """Share of the flashes in view that are in view in more than one step, mean over robots (robots)."""

    def value(self) -> float | None:
        """Return the share; None if no robot had a flash in view."""
        return share(self._repeated, self._seen)
