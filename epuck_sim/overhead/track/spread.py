"""From counts of lit rings to synchrony: the evolving histogram of thesis 4.3.1 and Fig. 4.6.

A count belongs to a frame, and a frame stands for the time until the next one. So frames may come at any rate, be
dropped or come twice. Where frames were dropped nobody knows what was lit: a frame stands for `LONGEST` usual ones at
most, and `Evaluation.seen` tells how much of the period was seen.

The count that is the largest within half a period on either side is the mode. Rings that flash together do so for
several frames, so a mode is a run of frames with one count, and its time is the middle of the run: with that of its
first frame, the window would lie half a flash too early. Of equal modes less than half a period apart the earlier one
counts. Two clusters of equal size are evaluated once or twice a cycle, and their spread is about a quarter of a period.

The thesis asks for nothing but a small spread, and so do we: every robot flashes once a period, so that a window around
a few of them has all the others in it, too. That fails only where rings are hidden.
"""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray

LONGEST = 3.0
"""A frame stands for so many median intervals at most: one or two frames dropped in a row are bridged, as is a camera
that takes twice as long in the dark; what was lit in a longer gap is unknown."""

LEAST_SEEN = 0.95
"""Share of the period that must have been seen before a spread proves synchrony: in what is missing then, no flash of
0.075 periods (thesis 4.2.1) can hide."""


class Evaluation(NamedTuple):
    """The histogram over the period around a mode, when that passes the midpoint."""

    time_s: float
    """Of the mode, and the middle of the period."""
    rings: int
    """Lit at the mode."""
    spread_s: float
    """Standard deviation of the histogram."""
    seen: float
    """Share of the period for which there are frames: 1 without gaps."""


class SpreadWatch:
    """Watches the counts of a film, frame by frame; remembers a period of them, however long the film is."""

    def __init__(self, period_s: float, start_s: float) -> None:
        """Watch oscillators of such a period from `start_s` on, when the robots start; earlier frames do not count."""
        self._period_s = period_s
        self._start_s = start_s
        self._times: list[float] = []
        self._counts: list[int] = []
        self._run_s = 0.0  # when the last count was first seen
        self._runs: deque[tuple[float, int]] = deque()  # middles and counts of those that may become modes
        self._earliest_s = 0.0  # of the next mode

    def look(self, time_s: float, count: int) -> Evaluation | None:
        """Take note of a frame; return an evaluation if this is the frame that completes one.

        That is half a period after the mode, or later where frames are missing. A mode less than half a period after
        the first frame is not evaluated: its period is not known. A frame whose time is not after that of the one
        before adds nothing.
        """
        if not self._times:
            if time_s < self._start_s:
                return None
            self._run_s, self._earliest_s = time_s, time_s + self._period_s / 2
        elif time_s <= self._times[-1]:
            return None
        elif count != self._counts[-1]:
            self._end_run(time_s)
        self._times.append(time_s)
        self._counts.append(count)
        evaluation = self._evaluate(time_s)
        self._forget(time_s - self._period_s)
        return evaluation

    def _end_run(self, time_s: float) -> None:
        """Keep the run that has ended; a light that stays on for a period or more is no flash."""
        if self._counts[-1] and time_s - self._run_s < self._period_s:
            self._runs.append(((self._run_s + time_s) / 2, self._counts[-1]))
        self._run_s = time_s

    def _evaluate(self, now_s: float) -> Evaluation | None:
        """Evaluate a run with half a period after it; there is one mode at most, for they are so far apart."""
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

    def _forget(self, time_s: float) -> None:
        """Forget the frames that have been followed by another one at a time."""
        unneeded = bisect_right(self._times, time_s) - 1
        if unneeded > 0:
            del self._times[:unneeded], self._counts[:unneeded]


def evaluate(times_s: FloatArray, counts: IntArray, period_s: float, start_s: float) -> list[Evaluation]:
    """Return what a `SpreadWatch` says of a film with (n,) counts in frames at (n,) times."""
    watch = SpreadWatch(period_s, start_s)
    looks = map(watch.look, times_s.tolist(), counts.tolist())
    return [evaluation for evaluation in looks if evaluation is not None]


def evaluate_around(middle_s: float, period_s: float, times_s: FloatArray, counts: IntArray) -> Evaluation:
    """Return what the (n,) counts of frames at (n,) times are in the period around a time.

    The frames: those within that period, and the one before, which stands for its beginning; two at least, and some
    ring is lit.
    """
    window = middle_s - period_s / 2, middle_s + period_s / 2
    begins_s = np.clip(times_s, *window)
    ends_s = np.clip(frame_ends(times_s, window[1]), *window)
    seconds = ends_s - begins_s
    spread_s = weighted_spread((begins_s + ends_s) / 2, seconds * counts)
    return Evaluation(middle_s, int(counts.max()), spread_s, float(seconds.sum() / period_s))


def frame_ends(times_s: FloatArray, end_s: float) -> FloatArray:
    """Return (n,) s: until when each frame stands; the last one until `end_s`, none longer than `LONGEST` allows.

    times_s: (n,), ascending, two at least.
    """
    longest_s = LONGEST * np.median(np.diff(times_s))
    ends_s: FloatArray = np.minimum(np.append(times_s[1:], end_s), times_s + longest_s)
    return ends_s


def weighted_spread(values: FloatArray, weights: FloatArray) -> float:
    """Return the standard deviation of (n,) values that weigh (n,), not all of them nothing.

    >>> weighted_spread(np.array([1.0, 2.0, 5.0]), np.array([1.0, 1.0, 0.0]))
    0.5
    """
    mean = np.average(values, weights=weights)
    return float(np.sqrt(np.average((values - mean) ** 2, weights=weights)))


def is_synchronised(evaluation: Evaluation, threshold_s: float) -> bool:
    """Return whether the spread is at most the threshold, in a period that was seen well enough."""
    return evaluation.spread_s <= threshold_s and evaluation.seen >= LEAST_SEEN


def first_synchronised(evaluations: Iterable[Evaluation], threshold_s: float) -> float | None:
    """Return the time of the first evaluation that is synchronised; None if none is."""
    return next((each.time_s for each in evaluations if is_synchronised(each, threshold_s)), None)
