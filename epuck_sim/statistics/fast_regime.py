"""V_f, the speed at which a swarm enters the fast regime, where T_sync hardly depends on speed (thesis 5.4.1)."""

import math

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.estimate import Estimate
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.extrema import MIN_TRIALS

FAST_FACTOR = 2.0
"""T_sync at V_f, as a multiple of that at the largest speed. The thesis gives no definition."""

LEVEL_FACTOR = 1.25
"""Largest T_sync halfway, in logs, from V_f to the largest speed with which a curve counts as level beyond V_f.

It is a multiple of T_sync at the largest speed. A curve that falls on, like a power of the speed, has 1.41 there.
"""


def find_fast_speed(curve: Curve) -> tuple[Estimate, FloatArray] | None:
    """Find the speed from which on T_sync is less than twice that at the largest speed.

    Where T_sync is unknown because all trials are censored, it counts as the limit of cycles.

    Returns:
        V_f, cm/s, with its percentile interval, and that of the resamples, (B,); None where T_sync is nowhere that
        long or still falls at the largest speeds, and where a point has fewer than `extrema.MIN_TRIALS` trials.
    """
    moving = curve.x > 0
    if np.count_nonzero(moving) < 2 or curve.trials[moving].min() < MIN_TRIALS or curve.censored[-1] > 0:
        return None
    speeds, limit = curve.x[moving], float(curve.scenario.stop.max_cycles)
    times = np.vstack([curve.values[moving], curve.resampled[:, moving]])
    times = np.where(np.isfinite(times), times, limit)
    found = _last_crossings(np.log(speeds), np.log(times))
    value, resampled = float(found[0]), found[1:]
    known = resampled[np.isfinite(resampled)]
    if math.isnan(value) or not len(known):
        return None
    halfway = np.interp(math.log(value * speeds[-1]) / 2, np.log(speeds), np.log(times[0]))
    if halfway > math.log(LEVEL_FACTOR * times[0, -1]):
        return None
    low, high = np.percentile(known, [2.5, 97.5]).tolist()
    return Estimate(value, low, high), resampled


def _last_crossings(x: FloatArray, logs: FloatArray) -> FloatArray:
    """Return where each curve of log T, (B, S), last falls below its threshold, cm/s; NaN where it never does."""
    above = logs > logs[:, -1:] + math.log(FAST_FACTOR)
    last = above.shape[1] - 1 - above[:, ::-1].argmax(axis=1)
    before = np.minimum(last, len(x) - 2)
    rows = np.arange(len(logs))
    high, low = logs[rows, before], logs[rows, before + 1]
    threshold = logs[:, -1] + math.log(FAST_FACTOR)
    is_crossed = above.any(axis=1)  # else the two may be equal
    share = np.where(is_crossed, (high - threshold) / np.where(is_crossed, high - low, 1), np.nan)
    crossings: FloatArray = np.exp(x[before] + share * (x[before + 1] - x[before]))
    return crossings
