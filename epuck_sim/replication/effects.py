"""An effect: a number estimated from trials, its 95 % interval, and the p-values of its being above or below others."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import bdtr, bdtrc, stdtr

from epuck_sim.arrays import FloatArray
from epuck_sim.estimate import MIN_TRIALS, Estimate
from epuck_sim.statistics.mean import MeanError, mean_and_error, student_estimate
from epuck_sim.statistics.measured import Measured, cut
from epuck_sim.statistics.shares import wilson_interval


class Effect(NamedTuple):
    """What a test finds in the trials of some points."""

    estimate: Estimate
    p_above: Callable[[float], float]
    """Of a threshold: probability of data that speak as clearly for an effect above it, if the effect is not."""
    p_below: Callable[[float], float]
    """The same for an effect below it."""


def student(value: float, error: float, freedom: float) -> Effect:
    """Return a value with Student's interval; without an error nothing is known of it, and no p-value is below 1."""
    if not error > 0:
        return Effect(Estimate(value), lambda _: 1.0, lambda _: 1.0)
    return Effect(
        student_estimate(value, error, freedom),
        lambda threshold: float(stdtr(freedom, (threshold - value) / error)),
        lambda threshold: float(stdtr(freedom, (value - threshold) / error)),
    )


def exponentiate(effect: Effect) -> Effect:
    """Return the effect whose logarithm is given; its thresholds are above 0."""
    return Effect(
        effect.estimate.apply(math.exp),
        lambda threshold: effect.p_above(math.log(threshold)),
        lambda threshold: effect.p_below(math.log(threshold)),
    )


def resampled(value: float, values: FloatArray, freedom: float) -> Effect:
    """Return a value whose error is the standard deviation of its resamples, (B,), of which some may be NaN."""
    known = values[np.isfinite(values)]
    return student(value, float(known.std(ddof=1)) if len(known) > 1 else 0.0, freedom)


def share_effect(successes: int, trials: int) -> Effect:
    """Return a share with Wilson's interval; the p-values are those of the exact binomial test."""
    share = successes / trials if trials else math.nan
    if trials < MIN_TRIALS:
        return Effect(Estimate(share), lambda _: 1.0, lambda _: 1.0)
    return Effect(
        Estimate(share, *wilson_interval(share, trials)),
        lambda threshold: float(bdtrc(successes - 1, trials, threshold)) if successes else 1.0,
        lambda threshold: float(bdtr(successes, trials, threshold)),
    )


def restrict(samples: Sequence[Measured]) -> list[Measured]:
    """Return samples cut at the lowest of their horizons, if trials of any are censored: then their means compare."""
    if all(each.observed.all() for each in samples):
        return list(samples)
    horizon = min(each.horizon for each in samples)
    return [cut(each, horizon) for each in samples]


def mean_with_error(measured: Measured) -> MeanError:
    """Return the mean, restricted where trials are censored, and its standard error.

    Where all are censored, they show no scatter; they get the error that they would have if one of them had ended at
    once. With fewer than `MIN_TRIALS` trials the error is 0, with which `student` knows nothing.
    """
    trials = len(measured.values)
    if not trials:
        return MeanError(math.nan, 0.0, 0)
    if trials < MIN_TRIALS:
        return MeanError(float(measured.values.mean()), 0.0, 0)
    if measured.observed.any():
        return mean_and_error(measured)
    return MeanError(measured.horizon, measured.horizon / trials, trials - 1)
