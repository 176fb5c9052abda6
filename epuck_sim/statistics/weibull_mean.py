"""The mean of the Weibull distribution nearest to censored trials, and its bootstrap interval (thesis Appendix A).

It is low where trials are not Weibull-distributed, even if none is censored: docs/statistics.md says by how much.
`times` and `observed` are those of `survival`, and raise ValueError where it does.
"""

import math

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.estimate import UNDETERMINED, Estimate
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.survival import SurvivalCurves, make_curve, make_sample, resampled_curves
from epuck_sim.statistics.weibull import fit_lines, local_fits, points_to_fit, starting_lines, weibull_means

MIN_UNCENSORED = 0.1
"""Smallest share of uncensored trials from which the mean is estimated (Appendix A)."""

_FEW_EVENT_TIMES = 20  # up to this number resamples differ much: their fits need more starts, and are quick


def estimate_weibull_mean(measured: Measured) -> Estimate:
    """Return the mean by Appendix A with the percentile interval of 1,000 resamples; none below `MIN_TRIALS` trials."""
    mean = weibull_mean(measured.values, measured.observed)
    if math.isnan(mean):
        return UNDETERMINED
    if not measured.supports_interval:
        return Estimate(mean)
    resampled = weibull_resamples(measured.values, measured.observed, seed=measured.seed)
    return Estimate(mean, *confidence_interval(resampled))


def weibull_mean(times: npt.ArrayLike, observed: npt.ArrayLike) -> float:
    """Return the mean T_sync by Appendix A, cycles; NaN where it is undetermined.

    It is undetermined if fewer than `MIN_UNCENSORED` of the trials are uncensored, or if no Weibull distribution fits:
    that takes two distinct event times above 0, of which that of a single trial that brings R to 0 is none. But if all
    trials synchronised at one time, that time is the mean.

    >>> weibull_mean([20, 20, 20], [True, True, True])
    20.0
    >>> weibull_mean([20, 20, 20], [False, False, False])
    nan
    """
    sample = make_sample(times, observed)
    curve = make_curve(sample)
    mean = float(_means(curve, len(sample.cell), local_fits(curve)[:1])[0])
    return mean if mean < math.inf else math.nan


def weibull_resamples(
    times: npt.ArrayLike, observed: npt.ArrayLike, resamples: int = 1000, seed: int = 0
) -> FloatArray:
    """Return Appendix A's mean, (resamples,) cycles, of as many trials drawn with replacement (Efron 1979).

    A mean that is undetermined is inf, longer than can be said, if trials of the resample are censored, else NaN.
    Equal seeds give equal means, in whatever order the trials come.
    """
    sample = make_sample(times, observed)
    curve = make_curve(sample)
    starts = local_fits(curve)
    if len(curve.times) <= _FEW_EVENT_TIMES:
        starts = np.concatenate([starts, starting_lines(curve, 4)])
    blocks = resampled_curves(times, observed, resamples, seed)
    return np.concatenate([_means(block, len(sample.cell), starts) for block in blocks])


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
    """Return Appendix A's means, (B,), inf and NaN as in `weibull_resamples`; each start, (s, 2), is a line."""
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
