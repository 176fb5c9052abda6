"""The tests that claims may name: pure functions from the trials of some points to an effect.

Means are restricted to the limit of cycles where trials are censored; ratios of means are compared in logarithms.
"""

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.special import stdtrit

from epuck_sim.arrays import FloatArray
from epuck_sim.replication.effects import Effect, exponentiate, mean_with_error, share_effect, student
from epuck_sim.statistics.estimate import LEVEL, Estimate
from epuck_sim.statistics.mean import MeanError
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.two_samples import welch

MIN_POINTS = 3
"""Fewest points of a slope: two leave nothing to tell how well they lie on a line."""


def level(sample: Measured) -> Effect:
    """Return the mean of the trials of a point."""
    return student(*mean_with_error(sample))


def share(sample: Measured) -> Effect:
    """Return the share of trials that are synchronised within the limit, or in which a truth value is true."""
    true = sample.values > 0 if sample.is_share else sample.observed
    return share_effect(int(np.count_nonzero(true)), len(sample.values))


def ratio(pairs: Sequence[tuple[Measured, Measured]]) -> Effect:
    """Return the geometric mean, over pairs of points, of the second mean over the first; each pair counts alike."""
    means = [mean_with_error(each) for pair in pairs for each in pair]
    if not _have_logs(means):
        return student(math.nan, 0.0, 0)
    logs = [math.log(each.mean) for each in means]
    value = (sum(logs[1::2]) - sum(logs[::2])) / len(pairs)
    return exponentiate(student(value, *welch(_log_parts(means, len(pairs)))))


def largest_rise(curves: Sequence[Sequence[Measured]]) -> Effect:
    """Return the largest ratio of the mean at a point of a curve to that at any point before it.

    It is below a threshold if all ratios are, each of which is tested by itself: the p-value is the largest of theirs.
    It is above one if any ratio is: the p-value is the least, times the number of ratios (Bonferroni). The ends of the
    interval are the largest of those of all ratios, where the lower ones are corrected for their number.
    """
    logs = [_log_ratio(first, later) for curve in curves for first, later in combinations(_means(curve), 2)]
    if not logs or any(math.isnan(each.estimate.low) for each, _, _ in logs):
        value = max((each.estimate.value for each, _, _ in logs), default=math.nan)
        return exponentiate(student(value, 0.0, 0))
    effects, errors, freedoms = zip(*logs, strict=True)
    chance = (1 - LEVEL) / 2 / len(logs)
    lows = [
        effect.estimate.value + float(stdtrit(freedom, chance)) * error
        for effect, error, freedom in zip(effects, errors, freedoms, strict=True)
    ]
    highest = Estimate(
        max(each.estimate.value for each in effects), max(lows), max(each.estimate.high for each in effects)
    )
    return exponentiate(
        Effect(
            highest,
            lambda threshold: min(1.0, len(effects) * min(each.p_above(threshold) for each in effects)),
            lambda threshold: max(each.p_below(threshold) for each in effects),
        )
    )


def power_exponent(x: FloatArray, samples: Sequence[Measured]) -> Effect:
    """Return the exponent of the power of x, (S,), that fits the means of S points best, in logarithms."""
    return _slope(np.log(x), samples)


def exponential_rate(x: FloatArray, samples: Sequence[Measured]) -> Effect:
    """Return the rate c of the exponential exp(c x) that fits the means of S points best, in logarithms; x is (S,)."""
    return _slope(np.asarray(x, float), samples)


def weighted_slope(x: FloatArray, logs: FloatArray, errors: FloatArray) -> tuple[float, float]:
    """Return the slope of logarithms over x by weighted least squares, and its error; all are (S,).

    Where points scatter about the line by more than their errors, its error is larger by as much.
    """
    weights = 1 / errors**2
    away = x - np.average(x, weights=weights)
    spread = float(weights @ away**2)
    slope = float(weights @ (away * logs)) / spread
    deviations = logs - np.average(logs, weights=weights) - slope * away
    misfit = float(weights @ deviations**2) / (len(x) - 2)
    return slope, math.sqrt(max(misfit, 1.0) / spread)


def _slope(x: FloatArray, samples: Sequence[Measured]) -> Effect:
    means = _means(samples)
    if len(means) < MIN_POINTS or not _have_logs(means) or min(each.error for each in means) == 0:
        return student(math.nan, 0.0, 0)
    errors = np.array([each.error / each.mean for each in means])
    return student(*weighted_slope(x, np.log([each.mean for each in means]), errors), len(means) - 2)


def _means(samples: Sequence[Measured]) -> list[MeanError]:
    return [mean_with_error(each) for each in samples]


def _have_logs(means: Sequence[MeanError]) -> bool:
    return all(each.mean > 0 for each in means)  # and so no NaN


def _log_parts(means: Sequence[MeanError], pairs: int) -> list[tuple[float, int]]:
    """Return the variance, and its degrees of freedom, that each mean adds to a mean of log ratios.

    There are none where any mean is known without an error, as nothing is known of its scatter.
    """
    if any(each.error == 0 for each in means):
        return []
    return [((each.error / each.mean / pairs) ** 2, each.freedom) for each in means]


def _log_ratio(first: MeanError, second: MeanError) -> tuple[Effect, float, float]:
    """Return the logarithm of the second mean over the first, its error and the degrees of freedom of that."""
    if not _have_logs((first, second)):
        return student(math.nan, 0.0, 0), 0.0, 0.0
    error, freedom = welch(_log_parts((first, second), 1))
    return student(math.log(second.mean / first.mean), error, freedom), error, freedom
