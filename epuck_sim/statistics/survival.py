"""Synchronisation times of which some are censored (thesis Appendix A).

T_sync is counted in whole cycles. A trial that is not synchronised at its limit is censored there: all that is known of
its T_sync is that it is longer. Throughout, `times` is (n,) cycles and `observed` (n,), True where the trial has
synchronised. Of two trials with equal times, one synchronised and one censored, the censored one was still at risk.
Every function raises ValueError for times that are negative or not finite, for no trials, and for arrays of different
shapes.
"""

import math
from collections.abc import Iterator
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray

_BLOCK_SIZE = 50_000  # trials drawn at once: a block of resamples fits the processor's cache
_MANY_TRIALS = 10_000  # of more, in few kinds, numbers of each kind are drawn at once: as likely as trial by trial
_HALF = 0.5 + 1e-12  # R is a product of rounded fractions: one that should be a half may lie above or below


class Sample(NamedTuple):
    """Trials in the order of time; equal ones share one of m cells."""

    times: FloatArray  # (m,) cycles
    observed: BoolArray  # (m,): events come before censorings of the same time
    cell: IntArray  # (n,) cell of each trial, ascending


class SurvivalCurves(NamedTuple):
    """Kaplan-Meier estimates of B samples with k event times in all."""

    times: FloatArray  # (k,) cycles, ascending
    events: IntArray  # (B, k) trials that synchronise then
    at_risk: IntArray  # (B, k) trials still running just before
    survival: FloatArray  # (B, k + 1) R before the first event time and after each


def make_sample(times: npt.ArrayLike, observed: npt.ArrayLike) -> Sample:
    """Sort trials by time, and gather equal ones."""
    t, is_event = np.asarray(times, float), np.asarray(observed, bool)
    if t.ndim != 1 or t.shape != is_event.shape:
        raise ValueError(f"times and observed must be (n,) both, but are {t.shape} and {is_event.shape}")
    if not len(t):
        raise ValueError("there are no trials")
    if not (np.isfinite(t) & (t >= 0)).all():
        raise ValueError("times must be finite and not negative")
    order = np.lexsort((~is_event, t))
    t, is_event = t[order], is_event[order]
    is_new = np.append(True, (t[1:] > t[:-1]) | (is_event[1:] != is_event[:-1]))
    return Sample(t[is_new], is_event[is_new], np.cumsum(is_new) - 1)


def make_curves(sample: Sample, counts: IntArray) -> SurvivalCurves:
    """Return the estimates of samples whose cells hold other numbers of trials, counts (B, m)."""
    at_risk = counts[:, ::-1].cumsum(axis=1)[:, ::-1][:, sample.observed]
    events = counts[:, sample.observed]
    survival = np.ones((len(counts), events.shape[1] + 1))
    np.cumprod((at_risk - events) / np.maximum(at_risk, 1), axis=1, out=survival[:, 1:])
    return SurvivalCurves(sample.times[sample.observed], events, at_risk, survival)


def make_curve(sample: Sample) -> SurvivalCurves:
    """Return the estimate of the sample itself: B = 1."""
    return make_curves(sample, np.bincount(sample.cell)[None])


def resample_counts(cells: IntArray, kinds: int, resamples: int, seed: int) -> Iterator[IntArray]:
    """Yield how many trials of each kind are in as many trials drawn with replacement (Efron 1979), block by block.

    Args:
        cells: (n,) kind of each trial, from 0.
        kinds: Number m of kinds.
        resamples: Number of draws.
        seed: Equal seeds give equal draws.

    Yields:
        (b, m) counts; the b of all blocks add up to `resamples`.
    """
    random, n = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed))), len(cells)
    draws_numbers = n > max(_MANY_TRIALS, 10 * kinds)
    shares = np.bincount(cells, minlength=kinds) / n
    drawn_at_once = kinds if draws_numbers else n
    for block in np.array_split(np.arange(resamples), max(1, resamples * drawn_at_once // _BLOCK_SIZE)):
        if draws_numbers:
            yield random.multinomial(n, shares, size=len(block))
        else:
            drawn = cells[random.integers(n, size=(len(block), n))]
            places = drawn + kinds * np.arange(len(block))[:, None]
            yield np.bincount(places.ravel(), minlength=kinds * len(block)).reshape(-1, kinds)


def resampled_curves(
    times: npt.ArrayLike, observed: npt.ArrayLike, resamples: int, seed: int
) -> Iterator[SurvivalCurves]:
    """Yield the estimates of as many trials drawn with replacement, block by block, whatever their order."""
    sample = make_sample(times, observed)
    for counts in resample_counts(sample.cell, len(sample.times), resamples, seed):
        yield make_curves(sample, counts)


def median_time(times: npt.ArrayLike, observed: npt.ArrayLike, level: float = 0.95) -> tuple[float, float, float]:
    """Return the median T_sync and the lower and upper end of its confidence interval, cycles; inf if not reached.

    The median is the first time with R < 1/2, or halfway to it from that with R = 1/2: uncensored it is that of the
    sample. The interval is from the first time when the lower confidence limit of R is at most 1/2 to that when the
    upper one is (Brookmeyer and Crowley 1982); the limits are symmetrical in log(-log R), of which Greenwood (1926)
    gives the variance.
    """
    curve = make_curve(make_sample(times, observed))
    n, d, survival = curve.at_risk[0], curve.events[0], curve.survival[0, 1:]
    variance = np.cumsum(d / (n * np.maximum(n - d, 1)))  # of log R; at the last n = d both limits are 0 anyway
    z = NormalDist().inv_cdf((1 + level) / 2)
    power = np.exp(z * np.sqrt(variance) / -np.log(np.maximum(survival, 1e-300)))
    limits = survival**power, survival ** (1 / power)
    lower, upper = (float(np.append(curve.times[limit <= _HALF], math.inf)[0]) for limit in limits)
    return float(medians(curve)[0]), lower, upper


def medians(curves: SurvivalCurves) -> FloatArray:
    """Return the medians, (B,) cycles, as `median_time` does; inf where R does not fall below 1/2."""
    times = np.append(curves.times, math.inf)
    first, second = ((curves.survival[:, 1:] > limit).sum(axis=1) for limit in (_HALF, 1 - _HALF))
    found: FloatArray = (times[first] + times[second]) / 2
    return found


def restricted_means(curves: SurvivalCurves, horizon: float) -> FloatArray:
    """Return the means, (B,) cycles, of the lesser of T_sync and `horizon`: the areas under R up to there (Irwin 1949).

    Where the longest trial is censored before the horizon, R is taken to stay as it is there.
    """
    edges = np.concatenate([[0.0], np.minimum(curves.times, horizon), [horizon]])
    return curves.survival @ np.diff(edges)
