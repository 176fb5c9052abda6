"""The mean synchronisation time where some trials are censored, and its bootstrap interval (thesis Appendix A).

`times` and `observed` are those of `survival`, and raise ValueError where it does.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.statistics.survival import SurvivalCurves, make_curve, make_curves, make_sample
from epuck_sim.statistics.weibull import fit_lines, local_fits, points_to_fit, starting_lines, weibull_means

MIN_UNCENSORED = 0.1
"""Smallest share of uncensored trials from which the mean is estimated (Appendix A)."""

_FEW_EVENT_TIMES = 20  # up to this number resamples differ much: their fits need more starts, and are quick
_BLOCK_SIZE = 50_000  # trials drawn at once: a block of resamples fits the processor's cache


class MeanTime(NamedTuple):
    """The mean T_sync by Appendix A, in cycles."""

    mean: float
    """NaN where it is undetermined."""
    low: float
    high: float
    """The 95 % bootstrap interval; NaN where the mean is undetermined, inf where an end is not reached."""
    resampled: FloatArray
    """(B,) means of resamples (see `bootstrap_means`)."""


def estimate_mean(times: npt.ArrayLike, observed: npt.ArrayLike, seed: int) -> MeanTime:
    """Return the mean with its interval; `seed` determines the resamples."""
    mean, resampled = mean_time(times, observed), bootstrap_means(times, observed, seed=seed)
    low, high = (math.nan, math.nan) if math.isnan(mean) else confidence_interval(resampled)
    return MeanTime(mean, low, high, resampled)


def mean_time(times: npt.ArrayLike, observed: npt.ArrayLike) -> float:
    """Return the mean T_sync by Appendix A, cycles; NaN where it is undetermined.

    It is undetermined if fewer than `MIN_UNCENSORED` of the trials are uncensored, or if no Weibull distribution fits
    (see `weibull.fit_weibull`). But if all trials synchronised at one time, that time is the mean.

    >>> mean_time([20, 20, 20], [True, True, True])
    20.0
    >>> mean_time([20, 20, 20], [False, False, False])
    nan
    """
    sample = make_sample(times, observed)
    curve = make_curve(sample)
    mean = float(_means(curve, len(sample.cell), local_fits(curve)[:1])[0])
    return mean if mean < math.inf else math.nan


def bootstrap_means(times: npt.ArrayLike, observed: npt.ArrayLike, resamples: int = 1000, seed: int = 0) -> FloatArray:
    """Return Appendix A's mean, (resamples,) cycles, of as many trials drawn with replacement (Efron 1979).

    A mean that is undetermined is inf, longer than can be said, if trials of the resample are censored, else NaN.
    Equal seeds give equal means, in whatever order the trials come.
    """
    sample = make_sample(times, observed)
    curve, n, m = make_curve(sample), len(sample.cell), len(sample.times)
    starts = local_fits(curve)
    if len(curve.times) <= _FEW_EVENT_TIMES:
        starts = np.concatenate([starts, starting_lines(curve, 4)])
    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
    means = np.empty(resamples)
    for block in np.array_split(means, max(1, resamples * n // _BLOCK_SIZE)):
        drawn = sample.cell[random.integers(n, size=(len(block), n))]
        places = drawn + m * np.arange(len(block))[:, None]
        counts = np.bincount(places.ravel(), minlength=m * len(block)).reshape(-1, m)
        block[:] = _means(make_curves(sample, counts), n, starts)
    return means


def confidence_interval(means: npt.ArrayLike, level: float = 0.95) -> tuple[float, float]:
    """Return the percentile interval, cycles, of bootstrap means, (b,): two of them, rounded outwards.

    Either end may be inf. NaN are left out, as they carry no information; if all are NaN, so are both ends.
    """
    known = np.asarray(means, float)
    known = known[~np.isnan(known)]
    if not len(known):
        return math.nan, math.nan
    tail = (1 - level) / 2
    # between a finite mean and inf there is nothing to interpolate
    return float(np.quantile(known, tail, method="lower")), float(np.quantile(known, 1 - tail, method="higher"))


def _means(curves: SurvivalCurves, trials: int, starts: FloatArray) -> FloatArray:
    """Return the means of Appendix A, (B,), inf and NaN as in `bootstrap_means`; each start, (s, 2), is a line."""
    best, least = np.full((len(curves.events), 2), np.nan), np.full(len(curves.events), math.inf)
    points = points_to_fit(curves)
    for start in starts:
        lines, squares = fit_lines(*points, np.tile(start, (len(best), 1)))
        is_better = squares < least
        best[is_better], least[is_better] = lines[is_better], squares[is_better]
    means = weibull_means(-best[:, 0] / best[:, 1], best[:, 1])
    at_one_time, column = np.nonzero(curves.events == trials)
    means[at_one_time] = curves.times[column]
    uncensored = curves.events.sum(axis=1)
    # divide, because 0.1 * trials may round up
    is_undetermined = np.isnan(means) | (uncensored / trials < MIN_UNCENSORED)
    means[is_undetermined & (uncensored < trials)] = math.inf
    return means
