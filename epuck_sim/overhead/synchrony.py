"""Estimates the period of oscillators and detects synchrony, by onsets or by the histogram of thesis 4.3.1, Fig. 4.6.

`times_s` are (n,) rising times of frames, `counts` the (n,) numbers of lit rings in them. A frame stands for the time
until the next one, so frames may come at any rate or be dropped; the light in a longer gap is unknown.

The mode is the largest count within half a period on either side. It is a run of frames with one count, and its time is
the middle of the run; at the first frame of the run, the window would lie half a flash too early. Of equal modes less
than half a period apart, the earlier one counts. Two clusters of equal size are evaluated once or twice a cycle, and
their spread is about a quarter of a period.

As in the thesis, a small spread is the criterion: every robot flashes once a period, so that a window around some of
them contains all others, too. This fails only where rings are hidden, and where a robot flashes alone (`MIN_RINGS`).

Period and duration of flashes are estimated from counts (thesis Appendix C): lags between events are located as peaks
of their density, to a fraction of a frame.
"""

import math
from bisect import bisect_left, bisect_right
from collections import deque
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray

ORDER_PARAMETER = 0.95  # order parameter r_sync at which a swarm counts as synchronised (thesis 4.2.1)
FIRING_SPREAD = math.acos(ORDER_PARAMETER) / math.tau
"""sigma_A in periods: firings half of which are early by it, and half late, have that order parameter (eq. C.2, whose
last term must read cos(2 pi sigma_A / tau))."""

MAX_HOLD_INTERVALS = 3.0  # longest time for which a frame stands, in median intervals: bridges one or two dropped ones
MIN_COVERAGE = 0.95  # least share of a period that is seen: no flash of 0.075 periods (thesis 4.2.1) hides in the rest
MIN_RINGS = 2  # fewest rings at the mode of a synchronised swarm: a lone flash is narrow, but in step with nobody


class Evaluation(NamedTuple):
    """The histogram over the period around a mode, at the moment when the mode passes the midpoint."""

    time_s: float  # time of the mode, the middle of the period
    rings: int  # number of rings lit at the mode
    spread_s: float  # standard deviation of the histogram
    coverage: float  # fraction of the period for which there are frames: 1 without gaps


class SynchronyDetector:
    """Evaluates the histogram of a film, frame by frame."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._times: list[float] = []
        self._counts: list[int] = []
        self._run_s = 0.0  # first frame with the last count
        self._runs: deque[tuple[float, int]] = deque()  # middles and counts of runs that may become modes
        self._earliest_s = 0.0  # earliest time of the next mode

    def update(self, time_s: float, count: int) -> Evaluation | None:
        """Add the next frame; return the evaluation that it completes, or None.

        An evaluation is complete half a period after its mode, or later where frames are missing. A mode less than half
        a period after the first frame is not evaluated, because the period around it was not filmed.
        """
        if not self._times:
            self._run_s, self._earliest_s = time_s, time_s + self._period_s / 2
        elif count != self._counts[-1]:
            if self._counts[-1] and time_s - self._run_s < self._period_s:  # a longer light is no flash
                self._runs.append(((self._run_s + time_s) / 2, self._counts[-1]))
            self._run_s = time_s
        self._times.append(time_s)
        self._counts.append(count)
        half_s = self._period_s / 2
        evaluation = None  # at most one of the runs due now is a mode, as modes are half a period apart
        while self._runs and self._runs[0][0] + half_s <= time_s:
            middle_s, count = self._runs.popleft()
            # the frame before the period covers its beginning; there is none where rounding puts it before the film
            first = max(bisect_right(self._times, middle_s - half_s) - 1, 0)
            end = bisect_left(self._times, middle_s + half_s)
            if middle_s >= self._earliest_s and max(self._counts[first:end]) == count:
                times_s, window = np.array(self._times[first:end]), (middle_s - half_s, middle_s + half_s)
                begins_s, ends_s = (np.clip(each, *window) for each in (times_s, frame_ends(times_s, window[1])))
                seconds, middles_s = ends_s - begins_s, (begins_s + ends_s) / 2
                lit_s = seconds * self._counts[first:end]
                mean_s = np.average(middles_s, weights=lit_s)
                spread_s = math.sqrt(np.average((middles_s - mean_s) ** 2, weights=lit_s))
                evaluation = Evaluation(middle_s, count, spread_s, float(seconds.sum() / self._period_s))
                self._earliest_s = middle_s + half_s
        return evaluation


def evaluate(times_s: FloatArray, counts: IntArray, period_s: float) -> list[Evaluation]:
    """Return all evaluations of a film; see `SynchronyDetector`."""
    evaluations = map(SynchronyDetector(period_s).update, times_s.tolist(), counts.tolist())
    return [evaluation for evaluation in evaluations if evaluation is not None]


def frame_ends(times_s: FloatArray, end_s: float) -> FloatArray:
    """Return (n,) s: the time until which each frame stands, the last one until `end_s` at most; n >= 2."""
    longest_s = MAX_HOLD_INTERVALS * np.median(np.diff(times_s))
    return np.asarray(np.minimum(np.append(times_s[1:], end_s), times_s + longest_s))


def is_synchronised(evaluation: Evaluation, threshold_s: float) -> bool:
    """Return whether the spread is at most the threshold, in a period with enough coverage, by more than one ring."""
    is_narrow = evaluation.spread_s <= threshold_s and evaluation.coverage >= MIN_COVERAGE
    return is_narrow and evaluation.rings >= MIN_RINGS


def spread_threshold_s(period_s: float, flash_s: float) -> float:
    """Return the bound of eq. C.3: the largest spread of a histogram if all rings are lit within sigma_A of its middle.

    Half of the rings are lit from -sigma_A on and the other half until sigma_A (Fig. C.1b), so that the middles of the
    flashes are sigma_A - flash / 2 off. In frames, with sigma_A = 4 and flashes of 5, the bound is sqrt(6) = 2.449 for
    every even number of robots; the thesis prints 2.49, and uses 2 frames. Here time is not cut into frames.

    The longer the flash, the less its beginning may vary, and not at all from 2 sigma_A on. But robots whose clocks
    differ, filmed in frames, are never closer than about a frame. So the middles may always be off by sigma_A / 4: a
    frame of the thesis's camera, and their distance at a flash of 1.5 sigma_A, where the bound is lowest, sigma_A / 2.

    >>> f"{spread_threshold_s(5.0, 0.375):.3f}"
    '0.126'
    """
    sigma_s = FIRING_SPREAD * period_s
    return math.hypot(max(sigma_s - flash_s / 2, sigma_s / 4), flash_s / math.sqrt(12))


def order_over_time(onsets_s: FloatArray, period_s: float) -> tuple[FloatArray, IntArray]:
    """Return (n,) order parameters (eq. 4.2) and numbers of the onsets within half a period of each onset.

    Onsets are ascending. Every robot flashes once a period, so that these are one onset of each robot; before synchrony
    some cycles are shortened, and a robot may be among them twice.
    """
    first = np.searchsorted(onsets_s, onsets_s - period_s / 2)
    end = np.searchsorted(onsets_s, onsets_s + period_s / 2)
    sums = np.concatenate([[0], np.cumsum(np.exp(2j * np.pi * onsets_s / period_s))])
    order: FloatArray = np.abs(sums[end] - sums[first]) / (end - first)
    return np.minimum(order, 1.0), end - first


class Periods:
    """The periods around onsets that were filmed whole and hold the flashes of most robots."""

    def __init__(self, onsets_s: FloatArray, period_s: float, span_s: tuple[float, float], least: float) -> None:
        """Choose the periods around (n,) onsets that are within the film's span and hold at least `least` onsets."""
        order, numbers = order_over_time(onsets_s, period_s)
        is_whole = is_filmed(onsets_s, period_s, span_s) & (numbers >= least)
        self.onset_s, self.order, self.numbers = onsets_s[is_whole], order[is_whole], numbers[is_whole]

    def first_in_order_s(self, order_parameter: float = ORDER_PARAMETER) -> float | None:
        """Return the first onset around which the order parameter is that of synchrony; None if there is none."""
        found = self.onset_s[self.order >= order_parameter]
        return float(found[0]) if len(found) else None

    def robots(self) -> int:
        """Return the median number of flashes in the fifth of the periods with the highest order; 0 without periods.

        It is one flash of each robot; before synchrony a robot may flash twice in a period.
        """
        nearest = self.numbers[np.argsort(-self.order, kind="stable")][: max(len(self.numbers) // 5, 1)]
        return round(float(np.median(nearest))) if len(nearest) else 0


def is_filmed(onsets_s: FloatArray, period_s: float, span_s: tuple[float, float]) -> BoolArray:
    """Return (n,) whether the period around each of (n,) onsets is within the span of the film."""
    return (onsets_s - span_s[0] >= period_s / 2) & (span_s[1] - onsets_s >= period_s / 2)


def order_at_end(onsets_s: FloatArray, period_s: float, end_s: float, robots: int) -> float:
    """Return the highest order parameter at the onsets of the last half period, whose next flashes were not filmed.

    Phases count from the last `robots` flashes, one of each robot; a flash seen since may have advanced a phase.
    """
    highest = 0.0
    for last in range(robots - 1, len(onsets_s)) if robots > 1 else ():
        if onsets_s[last] > end_s - period_s / 2:
            since = np.minimum((onsets_s[last] - onsets_s[last - robots + 1 : last + 1]) / period_s, 1.0)
            highest = max(highest, float(np.abs(np.exp(2j * np.pi * since).mean())))
    return highest


Events = tuple[FloatArray, FloatArray]  # times, (n,) s, ascending, and sizes, (n,): how many rings go on or off
MIN_PERIODS = 2.5  # minimum number of periods in a film; with fewer, any chance repetition would pass for the period
MIN_CORRELATION = 0.3
"""Minimum autocorrelation at the period in a film of many periods: above that of robots that flash at random for a
minute, below that of simulated trials that end with a synchronised cycle or two."""
AS_HIGH = 0.92  # least height of a peak, relative to the highest, that counts as equal; the shortest such lag is taken
PERIOD_RANGE = (0.9, 1.2)
"""Bounds of the period, as multiples of the autocorrelation's lag, which is too short rather than too long: a flash
that is seen can only shorten a cycle (thesis eq. 4.1)."""
AS_COMMON = 0.7  # least frequency, relative to single cycles, of a lag over several cycles that refines the period
MAX_CYCLES = 10  # cycles over which the period is refined; over more, clocks differ by more than the gain
NEARLY_AS_COMMON = 0.8  # least density of a lag, relative to the highest, that counts as equally common
MEAN_SHIFTS = 10  # iterations by which a peak of the density is located


def estimate_period_s(times_s: FloatArray, counts: IntArray) -> float | None:
    """Return the oscillators' period; None if the film is too short (`MIN_PERIODS`) or does not clearly repeat.

    The highest peak of the counts' autocorrelation gives a first estimate; cycles in which many rings flash together
    weigh most. The period is then the commonest time between rings going on. Before synchrony many cycles are
    shortened, each by a different time; so the longest of nearly equally common times is taken. Clusters of nearly
    equal size that stay evenly spaced over the period in the whole film look like one cluster of a shorter period.
    """
    if len(times_s) < 4:
        return None
    frame_s = float(np.median(np.diff(times_s)))
    near_s = _correlated_lag_s(times_s, counts, frame_s)
    if near_s is None:
        return None
    onsets = _changes(times_s, counts, 1)
    lags_s = _common_lags_s(onsets, onsets, (PERIOD_RANGE[0] * near_s, PERIOD_RANGE[1] * near_s), frame_s)
    if not len(lags_s):
        return None
    period_s, single = float(lags_s[-1]), 0.0
    for cycles in range(1, MAX_CYCLES + 1):  # as long as lags over several cycles are about as common as single ones
        expected_s = cycles * period_s
        pairs = _lags(onsets, onsets, (expected_s - 4 * frame_s, expected_s + 4 * frame_s))
        lag_s, weight = mean_shift(*pairs, expected_s, frame_s)
        share = weight / max(times_s[-1] - times_s[0] - lag_s, frame_s)
        single = single or share
        if share < AS_COMMON * single:
            break
        period_s = lag_s / cycles
    return period_s


def estimate_flash_s(times_s: FloatArray, counts: IntArray) -> float | None:
    """Return the duration of a flash, the commonest time from rings going on to rings going off; None if none does.

    All light, divided by the number of onsets, would be too long where one ring goes on as another goes off, and too
    short where a lit ring is missed in a frame and seems to go on twice.
    """
    onsets, ends = _changes(times_s, counts, 1), _changes(times_s, counts, -1)
    if not len(onsets[0]) or not len(ends[0]):
        return None
    frame_s = float(np.median(np.diff(times_s)))
    lit_s = (frame_ends(times_s, times_s[-1]) - times_s) @ counts / onsets[1].sum()
    lags_s = _common_lags_s(onsets, ends, (0.0, 2 * lit_s + frame_s), frame_s)
    return float(lags_s[0]) if len(lags_s) else None


def _correlated_lag_s(times_s: FloatArray, counts: IntArray, frame_s: float) -> float | None:
    """Return the lag of the highest autocorrelation, to about a frame; None if no lag stands out."""
    ends_s = frame_ends(times_s, times_s[-1] + frame_s)
    corners_s = np.column_stack([times_s, ends_s]).ravel()
    lit_s = np.append(0.0, np.repeat(np.cumsum((ends_s - times_s) * counts), 2)[:-1])
    edges_s = np.arange(times_s[0], times_s[-1] + 1.5 * frame_s, frame_s)
    means = np.diff(np.interp(edges_s, corners_s, lit_s)) / frame_s  # counts, over intervals of the length of a frame
    smooth = np.convolve(means, _gaussian(np.arange(-3.0, 4.0)), "same")
    smooth -= smooth.mean()
    padded = 1 << (2 * len(smooth)).bit_length()  # scipy.signal.correlate would do; loading it takes a second
    products = np.fft.irfft(np.abs(np.fft.rfft(smooth, padded)) ** 2, padded)[: len(smooth)]
    correlation = products / products[0] if products[0] > 1e-9 else np.zeros(len(smooth))
    shown = correlation[: int(len(correlation) / MIN_PERIODS) + 2]
    peaks = _local_maxima(shown)
    peaks = peaks[peaks > np.argmax(shown <= 0)]  # at shorter lags, a flash is compared with itself
    if not len(peaks):
        return None
    before, at, after = (shown[peaks + shift] for shift in (-1, 0, 1))
    # heights of parabolas through three points, because a peak may lie between frames
    heights = at - (after - before) ** 2 / (8 * (before - 2 * at + after))
    lag = peaks[np.argmax(heights >= AS_HIGH * heights.max())]
    share = lag / len(correlation)
    # in a shorter film chance correlations are higher, as the square root of the share
    is_clear = shown[lag] / (1 - share) >= max(MIN_CORRELATION, math.sqrt(share))
    return float(lag * frame_s) if is_clear else None


def _changes(times_s: FloatArray, counts: IntArray, sign: int) -> Events:
    """Return when counts rise (sign 1) or fall (-1), midway between two frames, and by how much."""
    sizes = sign * np.diff(counts)
    changes = np.flatnonzero(sizes > 0)
    return (times_s[changes] + times_s[changes + 1]) / 2, sizes[changes].astype(float)


def _common_lags_s(causes: Events, effects: Events, range_s: tuple[float, float], frame_s: float) -> FloatArray:
    """Return the commonest lags from causes to effects, ascending, within a range without its end.

    A mean shift finds the peaks of their density, from bins of a quarter of a frame.
    """
    lags_s, weights = _lags(causes, effects, range_s)
    if not len(lags_s):
        return lags_s
    bin_s = frame_s / 4
    edges_s = np.arange(lags_s.min() - 13.5 * bin_s, lags_s.max() + 14 * bin_s, bin_s)
    histogram, _ = np.histogram(lags_s, edges_s, weights=weights)
    density = np.convolve(histogram, _gaussian(np.arange(-12, 13) / 4), "same")
    peaks = _local_maxima(density)
    common_s = edges_s[peaks[density[peaks] >= NEARLY_AS_COMMON * density.max()]] + bin_s / 2
    return np.array([mean_shift(lags_s, weights, peak_s, frame_s)[0] for peak_s in common_s])


def pairs_within(
    causes_s: FloatArray, effects_s: FloatArray, range_s: tuple[float, float]
) -> tuple[IntArray, IntArray]:
    """Return (pairs,) indices of causes, and of effects that follow them within a range of times, both ascending."""
    first, end = (np.searchsorted(effects_s, causes_s + edge_s) for edge_s in range_s)
    cause = np.repeat(np.arange(len(first)), end - first)
    return cause, np.arange(len(cause)) + np.repeat(end - np.cumsum(end - first), end - first)


def _lags(causes: Events, effects: Events, range_s: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return (pairs,) the lags within a range from any of `causes` to any of `effects`, and products of their sizes."""
    cause, effect = pairs_within(causes[0], effects[0], range_s)
    return effects[0][effect] - causes[0][cause], causes[1][cause] * effects[1][effect]


def _local_maxima(values: FloatArray) -> IntArray:
    """Return (peaks,) the indices of (n,) values that are as large as the one before and larger than the one after."""
    return 1 + np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:]))


def mean_shift(lags_s: FloatArray, weights: FloatArray, start_s: float, frame_s: float) -> tuple[float, float]:
    """Return the peak of the density of (pairs,) lags that is reached from a start, and the density there."""
    peak_s = start_s
    for _ in range(MEAN_SHIFTS):
        near = weights * _gaussian((lags_s - peak_s) / frame_s)
        if not near.any():
            return peak_s, 0.0
        peak_s = float(np.average(lags_s, weights=near))
    return peak_s, float(near.sum())


def _gaussian(frames: FloatArray) -> FloatArray:
    """Return the kernel of the density, as wide as a frame: one lag may appear as two that differ by a frame."""
    return np.asarray(np.exp(-(frames**2) / 2))
