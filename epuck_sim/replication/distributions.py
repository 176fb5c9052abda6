"""Tests of whole distributions that claims may name: which trials take longer, and which law describes them."""

import math
from collections.abc import Sequence

import numpy as np
from scipy import stats

from epuck_sim.arrays import FloatArray
from epuck_sim.replication.effects import Effect, student
from epuck_sim.statistics.estimate import MIN_TRIALS, Estimate
from epuck_sim.statistics.measured import Measured

LAWS = {"Weibull": stats.weibull_min, "gamma": stats.gamma, "log-normal": stats.lognorm}
"""Distributions of positive numbers, each of two parameters: a shape and a scale."""

FITTED_TRIALS = 20
"""Fewest trials of a point whose distribution is fitted."""

FITTED_VALUES = 6
"""Fewest values that these have: T_sync of a few cycles is too coarse to tell distributions apart."""


def superiority(first: Measured, second: Measured) -> Effect:
    """Return the probability that a trial of the second sample takes longer than one of the first.

    Equal trials, such as those censored at one limit, count half: of equal distributions it is 0.5. The test is that of
    Brunner and Munzel (2000).
    """
    sizes = len(first.values), len(second.values)
    if min(sizes) < MIN_TRIALS:
        return student(math.nan, 0.0, 0)
    ranks = stats.rankdata(np.concatenate([first.values, second.values]))
    own = ranks[: sizes[0]], ranks[sizes[0] :]
    value = float((own[1].mean() - own[0].mean()) / sum(sizes)) + 0.5
    # how far a rank among all exceeds that among one's own: by the number in the other sample that are less
    within = [stats.rankdata(each.values) for each in (first, second)]
    parts = [size * float((mine - among).var(ddof=1)) for size, mine, among in zip(sizes, own, within, strict=True)]
    spread = sum(part**2 / (size - 1) for part, size in zip(parts, sizes, strict=True))
    error = math.sqrt(sum(parts)) / (sizes[0] * sizes[1])
    return student(value, error, sum(parts) ** 2 / spread if spread else 0)


def rank_trend(x: FloatArray, samples: Sequence[Measured]) -> Effect:
    """Return Spearman's correlation of the trials of S points with x, (S,); -1 if each is less than all before it.

    Interval and p-values are those of Fisher's transform, with the error of Bonett and Wright (2000).
    """
    places = np.repeat(x, [len(each.values) for each in samples])
    values = np.concatenate([each.values for each in samples])
    if len(samples) < 2 or len(values) < 2 * MIN_TRIALS or len(np.unique(values)) == 1:
        return student(math.nan, 0.0, 0)
    rho = float(stats.spearmanr(places, values).statistic)
    error = math.sqrt((1 + rho**2 / 2) / (len(values) - 3))
    transformed = student(math.atanh(rho), error, len(values) - 2)
    return Effect(
        Estimate(*map(math.tanh, transformed.estimate)),
        lambda threshold: transformed.p_above(math.atanh(threshold)),
        lambda threshold: transformed.p_below(math.atanh(threshold)),
    )


def likelier(samples: Sequence[Measured], law: str, than: str) -> Effect:
    """Return by how much a law makes trials likelier than another does: nats a trial, mean over all trials.

    Both are fitted to each point by maximum likelihood. The test is that of Vuong (1989), for laws neither of which is
    a case of the other. Points with censored trials, with fewer than `FITTED_TRIALS` trials or with fewer than
    `FITTED_VALUES` values are left out.
    """
    gains = [_gains(each.values, law, than) for each in samples if _can_be_fitted(each)]
    trials = sum(map(len, gains))
    if not trials:
        return student(math.nan, 0.0, 0)
    spread = sum(float(each.var(ddof=1)) * len(each) for each in gains)
    return student(float(np.concatenate(gains).mean()), math.sqrt(spread) / trials, trials - len(gains))


def _can_be_fitted(sample: Measured) -> bool:
    values = sample.values
    enough = len(values) >= FITTED_TRIALS and len(np.unique(values)) >= FITTED_VALUES
    return enough and bool(sample.observed.all()) and bool((values > 0).all())


def _gains(values: FloatArray, law: str, than: str) -> FloatArray:
    """Return the logarithm of the ratio of the two fitted densities at each value, (n,)."""
    one, other = (LAWS[name].logpdf(values, *LAWS[name].fit(values, floc=0)) for name in (law, than))
    return np.asarray(one - other)
