"""The mean synchronisation time where some trials are censored, and its bootstrap interval (thesis Appendix A).

`times` and `observed`, and what raises ValueError, are those of `survival`.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.statistics.survival import Curves, make_curve, make_curves, make_sample
from epuck_sim.statistics.weibull import fit_lines, fit_points, local_fits, means_of, rough_lines

LEAST_UNCENSORED = 0.1
"""If a smaller part of the trials is uncensored, the mean is undetermined (Appendix A)."""

_FEW_TIMES = 20  # with so few event times resamples differ: their fits need more starts, and are quick
_BLOCK = 50_000  # numbers: resamples are fitted in blocks that fit the processor's cache


class MeanTime(NamedTuple):
    """The mean T_sync by Appendix A, in cycles."""

    mean: float
    """NaN where it is undetermined."""
    low: float
    high: float
    """The 95 % bootstrap interval; NaN where the mean is undetermined, inf where an end is not reached."""
    resampled: FloatArray
    """(B,) of resamples, as `bootstrap_means` gives them."""


def estimate_mean(times: npt.ArrayLike, observed: npt.ArrayLike, seed: int) -> MeanTime:
    """Return the mean with its interval; seed: of the resamples."""
    mean, resampled = mean_time(times, observed), bootstrap_means(times, observed, seed=seed)
    low, high = (math.nan, math.nan) if math.isnan(mean) else confidence_interval(resampled)
    return MeanTime(mean, low, high, resampled)


def mean_time(times: npt.ArrayLike, observed: npt.ArrayLike) -> float:
    """Return the mean T_sync by Appendix A, cycles; NaN where it is undetermined.

    It is undetermined if fewer than `LEAST_UNCENSORED` of the trials are uncensored, or if no Weibull distribution fits
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

    Where it is undetermined it is inf, longer than can be said, if trials of the resample are censored, else NaN.
    Equal seeds give equal means, in whatever order the trials come.
    """
    sample = make_sample(times, observed)
    curve, n, m = make_curve(sample), len(sample.cell), len(sample.times)
    starts = local_fits(curve)
    if len(curve.times) <= _FEW_TIMES:
        starts = np.concatenate([starts, rough_lines(curve, 4)])
    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
    means = np.empty(resamples)
    for block in np.array_split(means, max(1, resamples * n // _BLOCK)):
        drawn = sample.cell[random.integers(n, size=(len(block), n))]
        places = drawn + m * np.arange(len(block))[:, None]
        counts = np.bincount(places.ravel(), minlength=m * len(block)).reshape(-1, m)
        block[:] = _means(make_curves(sample, counts), n, starts)
    return means


def confidence_interval(means: npt.ArrayLike, level: float = 0.95) -> tuple[float, float]:
    """Return the percentile interval, cycles, of bootstrap means, (b,): two of them, rounded outwards.

    Either end may be inf. NaN are left out, for they say nothing of the length; if all are NaN, so are both ends.
    """
    known = np.asarray(means, float)
    known = known[~np.isnan(known)]
    if not len(known):
        return math.nan, math.nan
    tail = (1 - level) / 2
    # between a finite mean and inf there is nothing to interpolate
    return float(np.quantile(known, tail, method="lower")), float(np.quantile(known, 1 - tail, method="higher"))


def _means(curves: Curves, trials: int, starts: FloatArray) -> FloatArray:
    """Return Appendix A's means, (B,), inf and NaN as in `bootstrap_means`; fits start from each line, (s, 2)."""
    best, least = np.full((len(curves.events), 2), np.nan), np.full(len(curves.events), math.inf)
    points = fit_points(curves)
    for start in starts:
        lines, squares = fit_lines(*points, np.tile(start, (len(best), 1)))
        is_better = squares < least
        best[is_better], least[is_better] = lines[is_better], squares[is_better]
    means = means_of(-best[:, 0] / best[:, 1], best[:, 1])
    at_one_time, column = np.nonzero(curves.events == trials)
    means[at_one_time] = curves.times[column]
    uncensored = curves.events.sum(axis=1)
    # a quotient, for 0.1 times the trials may be rounded up
    is_undetermined = np.isnan(means) | (uncensored / trials < LEAST_UNCENSORED)
    means[is_undetermined & (uncensored < trials)] = math.inf
    return means
