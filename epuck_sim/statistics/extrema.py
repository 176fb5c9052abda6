"""The local minimum and the peak of T_sync against speed, between which it rises (thesis 4.2.2)."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.optimize import isotonic_regression

from epuck_sim.arrays import FloatArray
from epuck_sim.estimate import Estimate
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.statistic import MOST_CENSORED

MIN_SPEEDS = 6  # fewest determined speeds of a curve with extrema: a smooth curve with two bends takes four or more

ENOUGH_TRIALS = 20
"""Fewest trials of a point at which a curve may have extrema.

On curves that do not rise, 2 trials a point make a pair in up to two thirds of all cases, 5 trials in up to a
quarter, and 10 in up to a tenth; from 20 on it is near the 5 % that it should be (docs/statistics.md).
"""

SIGNIFICANCE = 0.05
"""Largest p-value, and largest share of resamples without extrema, with which a minimum and a peak are found."""

MAX_UNDETERMINED = 0.05  # largest share of undetermined resamples at a speed that is taken into account
GRID_POINTS = 300  # number of speeds at which a smoothed curve is evaluated

MIN_VARIANCE = 1e-8
"""Smallest variance of log T; keeps curves without noise solvable, and no experiment knows T_sync to 0.01 %."""

ROUGHNESSES = 10.0 ** np.arange(-1, 6.5, 0.5)
"""Roughnesses of log T to choose from, between almost a parabola and a curve through every point.

The third derivative of log T is taken as white noise; roughness is its variance per decade of speed.
"""

UNDERSMOOTHING = 3.0
"""Factor from the likeliest roughness to the one used.

Peaks of the likeliest curve are too flat, and their intervals miss the truth too often. With three times the
roughness they hold it in 71 to 96 % (docs/statistics.md), and the estimates are as good.
"""

QUINTIC_SCALE = 240
"""Divisor of -|distance| ^ 5 in the covariance of a threefold integral of white noise, up to parabolas."""

PLACES = ("V_m", "T_m", "V_p", "T_p")  # speed, cm/s, and T_sync, cycles, of the local minimum and of the later peak


class Place(NamedTuple):
    """A speed, cm/s, a time, cycles, or another number of a curve."""

    estimate: Estimate
    resampled: FloatArray  # (B,) value in each resample; NaN where it has none


class Extrema(NamedTuple):
    """Places of a minimum, a peak or both on a curve, n numbers in all; NaN where there is none."""

    values: FloatArray  # (n,)
    intervals: FloatArray  # (n, 2) 95 % intervals: low and high
    p_value: float  # probability that noise makes one as strong on a curve without any
    resampled: FloatArray  # (B, n) values in each resample

    @property
    def is_found(self) -> bool:
        """Whether it is more than noise: noise neither makes it nor removes it."""
        kept = float(np.isfinite(self.resampled[:, 0]).mean())
        return self.p_value < SIGNIFICANCE and kept > 1 - SIGNIFICANCE

    @property
    def places(self) -> list[Place]:
        """The n numbers, each with its interval; empty if they may be noise."""
        columns = zip(self.values.tolist(), self.intervals.tolist(), self.resampled.T, strict=True)
        return [Place(Estimate(value, *ends), drawn) for value, ends, drawn in columns if self.is_found]


def find_minimum_and_peak(speeds: FloatArray, means: FloatArray, resampled: FloatArray) -> Extrema | None:
    """Find the local minimum and the later peak with the largest rise in log T between them (thesis 4.2.2).

    The strength of a pair is the least of the fall to the minimum, the rise, and the fall from the peak. Noise makes
    rises, too: the noise of each resample is added to the falling curve that fits best, and the p-value is the share of
    rises that are at least as large as the strength. Intervals are percentiles over the pairs of the resamples.

    Arguments are those of `smooth_logs`; None is returned if that returns it. Numbers are in the order of `PLACES`.
    """
    fit = smooth_logs(speeds, means, resampled)
    return fit and _find(fit, _monotone(fit, False), _largest_rises)


class SmoothedLogs(NamedTuple):
    """Logarithms of T_sync, or of a measure, at K speeds, and the matrix that smooths them."""

    speeds: FloatArray  # (G,) log-spaced speeds, or values of another axis, between the K
    smoother: FloatArray  # (G, K) matrix: logs at the K determined speeds in, logs on the grid out
    logs: FloatArray  # (K,) logs
    resampled: FloatArray  # (B, K) logs of resamples
    variances: FloatArray  # (K,) variances of the logs


def smooth_logs(speeds: FloatArray, means: FloatArray, resampled: FloatArray) -> SmoothedLogs | None:
    """Smooth T_sync, or a measure, as a function of speed, or of another axis, in logs of both.

    Speed 0 is left out, and so is every speed at which the mean, or more than 5 % of the resamples, are undetermined
    (not finite). Up to 5 % count as the longest determined resample, since undetermined ones took too long.

    Speeds, (S,) cm/s, ascend; means are (S,) cycles, those of resamples (B, S). None is returned if fewer than
    `MIN_SPEEDS` are determined.
    """
    finite = np.isfinite(resampled)
    determined = (speeds > 0) & np.isfinite(means) & (finite.mean(axis=0) >= 1 - MAX_UNDETERMINED)
    if np.count_nonzero(determined) < MIN_SPEEDS:
        return None
    longest = np.where(finite, resampled, 0).max(axis=0)
    log_resampled = np.log(np.where(finite, resampled, longest)[:, determined])
    x, logs = np.log10(speeds[determined]), np.log(means[determined])
    variances = np.maximum(log_resampled.var(axis=0, ddof=1), MIN_VARIANCE)
    grid = np.linspace(x[0], x[-1], GRID_POINTS)
    # a quintic smoothing spline, least squares plus a penalty on the third derivative, leaves parabolas unchanged, and
    # extrema are like them; a penalty on the curvature would flatten them
    penalties = variances / (UNDERSMOOTHING * _likeliest_roughness(x, logs, variances))
    smoothing = QUINTIC_SCALE * penalties
    spline = RBFInterpolator(x[:, None], np.eye(len(x)), smoothing=smoothing, kernel="quintic", degree=2)
    return SmoothedLogs(10**grid, np.asarray(spline(grid[:, None])), logs, log_resampled, variances)


def _likeliest_roughness(x: FloatArray, logs: FloatArray, variances: FloatArray) -> float:
    """Return the roughness of largest likelihood, given the noise and with parabolas projected out."""
    contrasts = np.linalg.qr(np.vander(x, 3), "complete")[0][:, 3:]
    projected = contrasts.T @ logs
    rough = contrasts.T @ (-(np.abs(x[:, None] - x) ** 5) / QUINTIC_SCALE) @ contrasts
    noise = contrasts.T @ np.diag(variances) @ contrasts

    def negative_log_likelihood(roughness: float) -> float:
        covariance = roughness * rough + noise
        return float(projected @ np.linalg.solve(covariance, projected) + np.linalg.slogdet(covariance)[1])

    return float(min(ROUGHNESSES, key=negative_log_likelihood))


Finder = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Takes (G,) speeds and (B, G) logarithms of curves; returns the numbers found on each, (B, n), NaN if there are none;
their strength, (B,), 0 if there are none; and their size, (B,), which for noise is compared with the strength."""


def _find(fit: SmoothedLogs, without: FloatArray, find: Finder) -> Extrema:
    """Return the extrema of a curve and of its resamples; `without` is the best curve, (K,), that has none."""
    by_chance = without + fit.resampled - fit.resampled.mean(axis=0)
    one, resampled, noise = ((logs @ fit.smoother.T) for logs in (fit.logs[None], fit.resampled, by_chance))
    found, (strength,), _ = find(fit.speeds, one)
    drawn, *_ = find(fit.speeds, resampled)
    if strength == 0:
        return Extrema(found[0], np.full((len(found[0]), 2), np.nan), 1.0, drawn)
    # the curve itself counts as one more draw, so that no finite number of resamples gives a p-value of 0
    p_value = (1 + np.count_nonzero(find(fit.speeds, noise)[2] >= strength)) / (1 + len(noise))
    own = drawn[~np.isnan(drawn[:, 0])]
    intervals = np.percentile(own if len(own) else found, [2.5, 97.5], axis=0).T
    return Extrema(found[0], intervals, p_value, drawn)


def _monotone(fit: SmoothedLogs, *ways: bool) -> FloatArray:
    """Return the curve, (K,), that only rises (True) or only falls (False), whichever of `ways` fits better."""
    weights = 1 / fit.variances
    curves = [isotonic_regression(fit.logs, weights=weights, increasing=way).x for way in ways]
    return min(curves, key=lambda curve: float((weights * (fit.logs - curve) ** 2).sum()))


def _largest_rises(speeds: FloatArray, logs: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Find the pair with the largest rise on each curve of log T; its size is the rise."""
    rising = np.diff(logs, axis=1) >= 0
    inner = logs[:, 1:-1]
    troughs = np.where(~rising[:, :-1] & rising[:, 1:], inner, np.inf)
    lowest = np.minimum.accumulate(troughs, axis=1)
    rises = np.where(rising[:, :-1] & ~rising[:, 1:], inner, -np.inf) - lowest
    curve, peak = np.arange(len(logs)), rises.argmax(axis=1)
    trough = (troughs == lowest[curve, peak, None]).argmax(axis=1) + 1
    rise, peak = rises[curve, peak], peak + 1
    t_m, t_p = logs[curve, trough], logs[curve, peak]
    fall_before = np.maximum.accumulate(logs, axis=1)[curve, trough] - t_m
    fall_after = t_p - np.minimum.accumulate(logs[:, ::-1], axis=1)[:, ::-1][curve, peak]
    exists = np.isfinite(rise)
    pairs = np.column_stack([speeds[trough], np.exp(t_m), speeds[peak], np.exp(t_p)])
    strengths = np.minimum(np.minimum(fall_before, rise), fall_after)
    return np.where(exists[:, None], pairs, np.nan), np.where(exists, strengths, 0.0), np.where(exists, rise, 0.0)


def most_prominent(x: FloatArray, curves: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Find the most prominent peak of each curve: place and height, and its prominence, as strength and as size."""
    before = np.minimum.accumulate(curves, axis=1)
    after = np.minimum.accumulate(curves[:, ::-1], axis=1)[:, ::-1]
    prominences = curves - np.maximum(before, after)
    rows, places = np.arange(len(curves)), prominences.argmax(axis=1)
    prominence = prominences[rows, places]
    peaks = np.column_stack([x[places], np.exp(curves[rows, places])])
    return np.where(prominence[:, None] > 0, peaks, np.nan), prominence, prominence


def find_peak(fit: SmoothedLogs) -> Extrema:
    """Find the most prominent peak of a smoothed curve: the value of its axis, and its height.

    Its prominence is the fall of the measure's logarithm on the side on which it falls less. The p-value compares it
    with prominences on the best curve that only rises or only falls, with the noise of the resamples.
    """
    return _find(fit, _monotone(fit, False, True), most_prominent)


def find_minimum(fit: SmoothedLogs) -> Extrema:
    """Find the most prominent minimum of a smoothed curve, as `find_peak` finds the peak."""
    found = find_peak(fit._replace(logs=-fit.logs, resampled=-fit.resampled))
    at, (low, high) = found.intervals
    powers = np.array([1.0, -1.0])
    return Extrema(found.values**powers, np.array([at, [1 / high, 1 / low]]), found.p_value, found.resampled**powers)


class ExtremaSearch(NamedTuple):
    """Extrema found on a curve, and their p-value."""

    places: dict[str, Place]  # places of the pair, by the names in `PLACES`; empty if noise could explain it
    p_value: float | None  # None where it cannot be looked for
    reason: str  # why it cannot, and what would be enough; empty where it can


_VAGUE = f"it is known well enough at fewer than {MIN_SPEEDS} points: raise stop.max_cycles, or give more --trials"


def search_extrema(curve: Curve) -> ExtremaSearch:
    """Look for the local minimum and the peak of a curve over speed, at the points that `_usable` returns."""
    usable, reason = _usable(curve)
    if reason or (found := find_minimum_and_peak(*usable)) is None:
        return ExtremaSearch({}, None, reason or _VAGUE)
    return ExtremaSearch(dict(zip(PLACES, found.places, strict=False)), found.p_value, "")


def search_measure(curve: Curve) -> tuple[Extrema | None, Extrema | None, str]:
    """Look for the minimum and the peak of a curve of a measure; None, and why, where they cannot be looked for."""
    if curve.is_share:
        return None, None, "the measure is a truth value, and the search is in logarithms, which shares do not suit"
    usable, reason = _usable(curve)
    if any((values <= 0).any() for values in usable[1:]):
        reason = "not all values are positive, and the search is in logarithms"
    if reason or (fit := smooth_logs(*usable)) is None:
        return None, None, reason or _VAGUE
    return find_minimum(fit), find_peak(fit), ""


def _usable(curve: Curve) -> tuple[tuple[FloatArray, FloatArray, FloatArray], str]:
    """Return x, values and resamples of points with `ENOUGH_TRIALS`, less than half of them censored; why they are few.

    Extrema are looked for at these points, unless there is a reason against it.
    """
    moving = curve.x > 0
    tried = moving & (curve.trials >= ENOUGH_TRIALS)
    usable = tried & (curve.censored < MOST_CENSORED) & np.isfinite(curve.values)
    positive, enough, left = map(np.count_nonzero, (moving, tried, usable))
    hidden = curve.x[(tried & ~usable) & np.maximum.accumulate(usable) & np.maximum.accumulate(usable[::-1])[::-1]]
    points, trials = ("speeds", "trials") if curve.of is None else ("points", "trials with a value")
    censored, reason = "half of the trials or more are censored", ""
    if positive < MIN_SPEEDS:
        of_what = "speeds" if curve.of is None else "values of the axis"
        reason = f"{positive} {of_what} above 0; a minimum and a peak need {MIN_SPEEDS}"
    elif enough < MIN_SPEEDS:
        few = f"fewer than {ENOUGH_TRIALS} {trials} at {positive - enough} of {positive} {points}"
        more = f"give --trials {ENOUGH_TRIALS} or more{': 200 show a rise of a fifth' * (curve.of is None)}"
        reason = f"{few}, where noise can look like a rise; {more}"
    elif left < MIN_SPEEDS:
        where = f"at {enough - left} of {enough} {points}"
        reason = f"{censored} {where}; {MIN_SPEEDS} others are needed: raise stop.max_cycles"
    elif len(hidden):
        where = f"from {hidden[0]:g} to {hidden[-1]:g}{' cm/s' * (curve.of is None)}"
        reason = f"{censored} {where}, where a peak may be: raise stop.max_cycles"
    return (curve.x[usable], curve.values[usable], curve.resampled[:, usable]), reason


FAST_FACTOR = 2.0  # T_sync at V_f, as a multiple of that at the largest speed. The thesis gives no definition

LEVEL_FACTOR = 1.25
"""Largest T_sync, halfway in logs from V_f to the largest speed, of a curve that counts as level beyond V_f.

It is a multiple of T_sync at the largest speed. A curve that keeps falling, like a power of the speed, has 1.41 there.
"""


def find_fast_speed(curve: Curve) -> Place | None:
    """Find V_f, the speed above which T_sync is less than twice that at the largest speed.

    Where T_sync is unknown because all trials are censored, it counts as the limit of cycles. There is no V_f if T_sync
    is nowhere that long or still falls at the largest speeds, if there are fewer than two speeds above 0, if trials at
    the largest are censored, or if a point has fewer than `ENOUGH_TRIALS` trials.
    """
    moving = curve.x > 0
    if np.count_nonzero(moving) < 2 or curve.trials[moving].min() < ENOUGH_TRIALS or curve.censored[-1] > 0:
        return None
    speeds, limit = curve.x[moving], float(curve.scenario.stop.max_cycles)
    times = np.vstack([curve.values[moving], curve.resampled[:, moving]])
    times = np.where(np.isfinite(times), times, limit)
    x, logs = np.log(speeds), np.log(times)
    # where each curve last falls below its threshold
    threshold = logs[:, -1] + math.log(FAST_FACTOR)
    above = logs > threshold[:, None]
    last = len(x) - 1 - above[:, ::-1].argmax(axis=1)
    before, rows = np.minimum(last, len(x) - 2), np.arange(len(logs))
    high, low = logs[rows, before], logs[rows, before + 1]
    is_crossed = above.any(axis=1)  # else the two may be equal
    share = np.where(is_crossed, (high - threshold) / np.where(is_crossed, high - low, 1), np.nan)
    found = np.exp(x[before] + share * (x[before + 1] - x[before]))
    value, resampled = float(found[0]), found[1:]
    known = resampled[np.isfinite(resampled)]
    if math.isnan(value) or not len(known):
        return None
    halfway = np.interp(math.log(value * speeds[-1]) / 2, x, logs[0])
    if halfway > math.log(LEVEL_FACTOR * times[0, -1]):
        return None
    return Place(Estimate(value, *np.percentile(known, [2.5, 97.5]).tolist()), resampled)
