"""Detects synchrony: by the order parameter of onsets, or by the evolving histogram of thesis 4.3.1 and Fig. 4.6.

A count belongs to a frame, and a frame stands for the time until the next one. So frames may come at any rate, be
dropped or be doubled. What was lit while frames were dropped is unknown: a frame stands for at most
`MAX_HOLD_INTERVALS` usual intervals, and `Evaluation.coverage` is the fraction of the period that was seen.

The mode is the largest count within half a period on either side. Rings that flash together do so for several frames,
so a mode is a run of frames with one count, and its time is the middle of the run; with the time of its first frame,
the window would lie half a flash too early. Of equal modes less than half a period apart, the earlier one counts. Two
clusters of equal size are evaluated once or twice a cycle, and their spread is about a quarter of a period.

As in the thesis, a small spread is the criterion: every robot flashes once a period, so that a window around some of
them contains all others, too. This fails only where rings are hidden, and where a robot flashes alone (`MIN_RINGS`).
"""

import math
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray

ORDER_PARAMETER = 0.95  # order parameter r_sync at which a swarm counts as synchronised (thesis 4.2.1)

MAX_HOLD_INTERVALS = 3.0
"""Longest time for which a frame stands, in median intervals. It bridges one or two dropped frames, and a camera that
takes twice as long in the dark; what was lit in a longer gap is unknown."""

MIN_COVERAGE = 0.95
"""Minimum fraction of the period that must have been seen before a spread proves synchrony: no flash of 0.075 periods
(thesis 4.2.1) can hide in the rest."""

MIN_RINGS = 2
"""Minimum number of rings lit at the mode of a synchronised swarm: a lone flash is narrow, but in step with nobody."""


class Evaluation(NamedTuple):
    """The histogram over the period around a mode, at the moment when the mode passes the midpoint."""

    time_s: float
    """Time of the mode, the middle of the period."""
    rings: int
    """Number of rings lit at the mode."""
    spread_s: float
    """Standard deviation of the histogram."""
    coverage: float
    """Fraction of the period for which there are frames: 1 without gaps."""


class SynchronyDetector:
    """Evaluates the histogram of a film, frame by frame; keeps the counts of one period, however long the film is."""

    def __init__(self, period_s: float, start_s: float) -> None:
        """Begin before the first frame; start_s: time at which robots start, before which frames are ignored."""
        self._period_s = period_s
        self._start_s = start_s
        self._times: list[float] = []
        self._counts: list[int] = []
        self._run_s = 0.0  # first frame with the last count
        self._runs: deque[tuple[float, int]] = deque()  # middles and counts of runs that may become modes
        self._earliest_s = 0.0  # earliest time of the next mode

    def update(self, time_s: float, count: int) -> Evaluation | None:
        """Add a frame; return the evaluation that it completes, if it completes one.

        An evaluation is complete half a period after its mode, or later where frames are missing. A mode less than half
        a period after the first frame is not evaluated, because the period around it was not filmed. A frame whose time
        is not after that of the previous frame is ignored.
        """
        if not self._times:
            if time_s < self._start_s:
                return None
            self._run_s, self._earliest_s = time_s, time_s + self._period_s / 2
        elif time_s <= self._times[-1]:
            return None
        elif count != self._counts[-1]:
            if self._counts[-1] and time_s - self._run_s < self._period_s:  # a light that is longer is no flash
                self._runs.append(((self._run_s + time_s) / 2, self._counts[-1]))
            self._run_s = time_s
        self._times.append(time_s)
        self._counts.append(count)
        evaluation = self._evaluate(time_s)
        unneeded = bisect_right(self._times, time_s - self._period_s) - 1
        if unneeded > 0:
            del self._times[:unneeded], self._counts[:unneeded]
        return evaluation

    def _evaluate(self, now_s: float) -> Evaluation | None:
        """Evaluate runs that ended half a period ago; at most one of them is a mode, as modes are that far apart."""
        half_s = self._period_s / 2
        evaluation = None
        while self._runs and self._runs[0][0] + half_s <= now_s:
            middle_s, count = self._runs.popleft()
            if middle_s < self._earliest_s:
                continue
            first = bisect_right(self._times, middle_s - half_s) - 1
            end = bisect_left(self._times, middle_s + half_s)
            counts = self._counts[first:end]
            if max(counts) == count:
                frames = np.array(self._times[first:end]), np.array(counts)
                evaluation = evaluate_around(middle_s, self._period_s, *frames)
                self._earliest_s = middle_s + half_s
        return evaluation


def evaluate(times_s: FloatArray, counts: IntArray, period_s: float, start_s: float) -> list[Evaluation]:
    """Return all evaluations of a film with (n,) counts in frames at (n,) times; see `SynchronyDetector`."""
    detector = SynchronyDetector(period_s, start_s)
    evaluations = map(detector.update, times_s.tolist(), counts.tolist())
    return [evaluation for evaluation in evaluations if evaluation is not None]


def evaluate_around(middle_s: float, period_s: float, times_s: FloatArray, counts: IntArray) -> Evaluation:
    """Return the evaluation of the period around a time, from (n,) times of frames and rings lit in them, not all 0.

    Frames are those within it, and the one before, which stands for its beginning; n >= 2.
    """
    window = middle_s - period_s / 2, middle_s + period_s / 2
    begins_s = np.clip(times_s, *window)
    ends_s = np.clip(frame_ends(times_s, window[1]), *window)
    seconds = ends_s - begins_s
    spread_s = weighted_spread((begins_s + ends_s) / 2, seconds * counts)
    return Evaluation(middle_s, int(counts.max()), spread_s, float(seconds.sum() / period_s))


def frame_ends(times_s: FloatArray, end_s: float) -> FloatArray:
    """Return (n,) s: the time until which each frame stands, at most `MAX_HOLD_INTERVALS` after its own.

    Args:
        times_s: (n,) times of the frames, ascending; n >= 2.
        end_s: Time until which the last one stands.
    """
    longest_s = MAX_HOLD_INTERVALS * np.median(np.diff(times_s))
    ends_s: FloatArray = np.minimum(np.append(times_s[1:], end_s), times_s + longest_s)
    return ends_s


def weighted_spread(values: FloatArray, weights: FloatArray) -> float:
    """Return the standard deviation of (n,) values with (n,) weights, not all of which are 0.

    >>> weighted_spread(np.array([1.0, 2.0, 5.0]), np.array([1.0, 1.0, 0.0]))
    0.5
    """
    mean = np.average(values, weights=weights)
    return float(np.sqrt(np.average((values - mean) ** 2, weights=weights)))


def is_synchronised(evaluation: Evaluation, threshold_s: float) -> bool:
    """Return whether the spread is at most the threshold, in a period with enough coverage, by more than one ring."""
    is_narrow = evaluation.spread_s <= threshold_s and evaluation.coverage >= MIN_COVERAGE
    return is_narrow and evaluation.rings >= MIN_RINGS


def first_synchronised(evaluations: Iterable[Evaluation], threshold_s: float) -> Evaluation | None:
    """Return the first evaluation that shows synchrony; None if none does."""
    return next((each for each in evaluations if is_synchronised(each, threshold_s)), None)


def firing_spread_s(period_s: float, order_parameter: float = ORDER_PARAMETER) -> float:
    """Return sigma_A: if half of the firings are early by it and half are late by it, they have this order parameter.

    The source is eq. C.2, whose last term must read cos(2 pi sigma_A / tau).

    >>> f"{firing_spread_s(5.0):.3f}"
    '0.253'
    """
    return period_s / (2 * math.pi) * math.acos(order_parameter)


def spread_threshold_s(period_s: float, flash_s: float) -> float:
    """Return the bound of eq. C.3: the largest spread of a histogram if all rings are lit within sigma_A of its middle.

    Half of the rings are lit from -sigma_A on and the other half until sigma_A (Fig. C.1b), so that the middles of the
    flashes are sigma_A - flash / 2 off. In frames, with sigma_A = 4 and flashes of 5, the bound is sqrt(6) = 2.449 for
    every even number of robots; the thesis prints 2.49, and uses 2 frames. Here time is not cut into frames.

    The longer the flash, the less room is left for its beginning, and none from 2 sigma_A on. But robots whose clocks
    differ, filmed in frames, are never closer than about a frame. So the middles may always be off by sigma_A / 4: a
    frame of the thesis's camera, and their distance at a flash of 1.5 sigma_A, where the bound is lowest, sigma_A / 2.

    >>> f"{spread_threshold_s(5.0, 0.375):.3f}"
    '0.126'
    """
    sigma_s = firing_spread_s(period_s)
    return math.hypot(max(sigma_s - flash_s / 2, sigma_s / 4), flash_s / math.sqrt(12))


def order_over_time(onsets_s: FloatArray, period_s: float) -> tuple[FloatArray, IntArray]:
    """Return (n,) order parameters (eq. 4.2) and numbers of the onsets within half a period of each onset.

    Every robot flashes once a period, so that these are one onset of each, whosever they are; before synchrony some
    cycles are shortened, and a robot may be among them twice. Onsets are ascending.
    """
    first = np.searchsorted(onsets_s, onsets_s - period_s / 2)
    end = np.searchsorted(onsets_s, onsets_s + period_s / 2)
    sums = np.concatenate([[0], np.cumsum(np.exp(2j * np.pi * onsets_s / period_s))])
    order: FloatArray = np.abs(sums[end] - sums[first]) / (end - first)
    return np.minimum(order, 1.0), end - first


class Periods(NamedTuple):
    """The periods around onsets that were filmed whole and hold flashes of most robots, in order of time."""

    onset_s: FloatArray
    """(n,) the onsets that they are around."""
    order: FloatArray
    """(n,) order parameters of the onsets in them."""
    numbers: IntArray
    """(n,) how many these are."""

    def first_in_order_s(self, order_parameter: float = ORDER_PARAMETER) -> float | None:
        """Return the first onset around which the order parameter is that of synchrony; None if there is none."""
        found = self.onset_s[self.order >= order_parameter]
        return float(found[0]) if len(found) else None

    def robots(self) -> int:
        """Return the number of flashes in the periods in which they are nearest together: one of each robot.

        The fifth whose order parameters are highest count; before synchrony a robot may flash twice in a period. It is
        0 if there is none.
        """
        nearest = self.numbers[np.argsort(-self.order, kind="stable")][: max(len(self.numbers) // 5, 1)]
        return round(float(np.median(nearest))) if len(nearest) else 0


def whole_periods(onsets_s: FloatArray, period_s: float, span_s: tuple[float, float], least: float) -> Periods:
    """Return the periods around onsets that are within what was filmed and hold enough of the robots.

    Args:
        onsets_s: (n,) onsets of flashes, ascending.
        period_s: Period of the oscillators.
        span_s: Beginning and end of what was filmed.
        least: Number of onsets below which a period holds too few of the robots.
    """
    order, numbers = order_over_time(onsets_s, period_s)
    is_whole = (onsets_s - span_s[0] >= period_s / 2) & (span_s[1] - onsets_s >= period_s / 2) & (numbers >= least)
    return Periods(onsets_s[is_whole], order[is_whole], numbers[is_whole])


def order_at_end(onsets_s: FloatArray, period_s: float, end_s: float, robots: int) -> float:
    """Return the highest order parameter at the onsets of the last half period, whose next flashes were not filmed.

    A robot's phase is known from its last flash, and robots have the last flashes, one each. A flash seen since may
    have advanced a phase, so that the order parameter may be higher.
    """
    highest = 0.0
    for last in range(robots - 1, len(onsets_s)) if robots > 1 else ():
        if onsets_s[last] > end_s - period_s / 2:
            since = np.minimum((onsets_s[last] - onsets_s[last - robots + 1 : last + 1]) / period_s, 1.0)
            highest = max(highest, float(np.abs(np.exp(2j * np.pi * since).mean())))
    return highest
