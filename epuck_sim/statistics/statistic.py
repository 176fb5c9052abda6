"""The statistics of a measure that tables and figures show, with their intervals and resamples."""

import math
from collections.abc import Callable

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import UNDETERMINED, Estimate
from epuck_sim.statistics.mean import estimate_mean, resample_means
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.names import Statistic, statistic_name
from epuck_sim.statistics.shares import estimate_share
from epuck_sim.statistics.survival import median_time, medians, resampled_curves
from epuck_sim.statistics.weibull_mean import estimate_weibull_mean, weibull_resamples

RESAMPLES = 1000
"""Number of resamples of each point."""

MOST_CENSORED = 0.5
"""Share of censored trials from which on figures hatch a point, and minima and peaks do without it."""


def check_statistic(measured: Measured, statistic: Statistic) -> None:
    """Raise EpuckSimError for a statistic that makes no sense of a measure."""
    if statistic == Statistic.WEIBULL_MEAN and not measured.is_time:
        raise EpuckSimError("the Weibull mean is of T_sync alone; allowed for measures: mean or median")
    if statistic != Statistic.MEAN and measured.is_share:
        raise EpuckSimError("truth values have no median; allowed: mean, the share of trials in which they are true")


def estimate(measured: Measured, statistic: Statistic) -> Estimate:
    """Return a statistic with its interval; undetermined where no trial is uncensored."""
    name = statistic_name(statistic, measured.censored > 0, is_share=measured.is_share)
    if not measured.observed.any():
        return measured.described(UNDETERMINED, name)
    return measured.described((estimate_share if measured.is_share else _ESTIMATORS[statistic])(measured), name)


def resample(measured: Measured, statistic: Statistic) -> FloatArray:
    """Return a statistic of `RESAMPLES` resamples, (B,); inf where it is longer than can be said."""
    if not measured.observed.any():
        return np.full(RESAMPLES, math.inf)
    return _RESAMPLERS[statistic](measured)


def estimate_median(measured: Measured) -> Estimate:
    """Return the median with its interval; no interval below `MIN_TRIALS` trials, or where all have one value."""
    shift = _shift(measured)
    median, low, high = (end + shift for end in median_time(measured.values - shift, measured.observed))
    if math.isinf(median):
        return UNDETERMINED
    if not measured.supports_interval:
        return Estimate(median)
    return Estimate(median, low, high)


def _resample_medians(measured: Measured) -> FloatArray:
    shift = _shift(measured)
    curves = resampled_curves(measured.values - shift, measured.observed, RESAMPLES, measured.seed)
    return np.concatenate([medians(block) for block in curves]) + shift


def _shift(measured: Measured) -> float:
    """Return what to subtract from values so that none is negative, as times are; 0.0 where none is."""
    return min(float(measured.values.min()), 0.0)


_ESTIMATORS: dict[Statistic, Callable[[Measured], Estimate]] = {
    Statistic.MEAN: estimate_mean,
    Statistic.MEDIAN: estimate_median,
    Statistic.WEIBULL_MEAN: estimate_weibull_mean,
}

_RESAMPLERS: dict[Statistic, Callable[[Measured], FloatArray]] = {
    Statistic.MEAN: lambda measured: resample_means(measured, RESAMPLES),
    Statistic.MEDIAN: _resample_medians,
    Statistic.WEIBULL_MEAN: lambda measured: weibull_resamples(
        measured.values, measured.observed, RESAMPLES, measured.seed
    ),
}


def _sample_mean(measured: Measured) -> Estimate:
    """Return the mean, or share, of all trials; undetermined where some are censored."""
    found = estimate(measured, Statistic.MEAN)
    return measured.described(UNDETERMINED, "mean") if measured.censored else found


def _median(measured: Measured) -> Estimate:
    return UNDETERMINED if measured.is_share else estimate(measured, Statistic.MEDIAN)


def _restricted_mean(measured: Measured) -> Estimate:
    """Return the mean of the lesser of T_sync and the horizon: the area under the Kaplan-Meier estimate up to there."""
    if not measured.is_time:
        return UNDETERMINED
    found = estimate(measured, Statistic.MEAN) if measured.observed.any() else Estimate(measured.horizon)
    return measured.described(found, "restricted mean")


def _weibull_mean(measured: Measured) -> Estimate:
    return estimate(measured, Statistic.WEIBULL_MEAN) if measured.is_time else UNDETERMINED


SUMMARIES: dict[str, Callable[[Measured], Estimate]] = {
    "mean": _sample_mean,
    "median": _median,
    "restricted_mean": _restricted_mean,
    "weibull_mean": _weibull_mean,
}
"""What `summarize` estimates of the trials of a point, by the names that JSON and CSV have."""
