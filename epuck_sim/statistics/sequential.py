"""Intervals of a mean that hold at every look at a growing number of trials, and how narrow they must be.

A point is looked at when it has 20 trials, and whenever it has half as many more, up to a limit. The interval at a look
is that of `estimate_mean`, at a higher level, so that the intervals of all looks together hold the truth in 95 % of all
cases: repeated confidence intervals (Jennison and Turnbull 1989), with one boundary for all looks (Pocock 1977) and
Student's quantiles. So looks may end by any rule, and narrower intervals may be asked for later.
"""

import math
import re
from functools import lru_cache
from itertools import pairwise
from statistics import NormalDist
from typing import NamedTuple, Self

import numpy as np
from scipy.optimize import brentq

from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import LEVEL, UNDETERMINED, Estimate
from epuck_sim.statistics.statistic import Measured, difference, estimate_mean

FIRST_LOOK = 20  # number of trials of a point at its first look: with fewer, the spread is not known well enough
GROWTH = 1.5  # number of trials at a look, relative to that at the look before
_NODES = 48  # number of nodes of the Gauss-Legendre quadrature: with 24, the level has five digits


class Precision(NamedTuple):
    """Requested precision of intervals: their largest half-width."""

    reach: float  # half of the width, in cycles, or relative to the estimate
    is_relative: bool

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the precision that is written as 10% or 3, for example.

        >>> Precision.parse("10%")
        Precision(reach=0.1, is_relative=True)
        """
        match = re.fullmatch(r"([0-9]*\.?[0-9]+)(%?)", text.replace(" ", ""))
        if match is None or not float(match[1]) > 0:
            allowed = "half the width of an interval, in per cent of the estimate, as in 10%, or in cycles, as in 3"
            raise EpuckSimError(f"--until is {text}; allowed: {allowed}")
        return cls(float(match[1]) / (100 if match[2] else 1), bool(match[2]))

    def width(self, found: Estimate) -> float:
        """Return the width of an interval over the width asked for; inf if there is none, or it is open."""
        asked = self.reach * (found.value if self.is_relative else 1)
        width = (found.high - found.low) / (2 * asked) if asked > 0 else math.inf
        return math.inf if math.isnan(width) else width

    def __str__(self) -> str:
        return f"{100 * self.reach:g} %" if self.is_relative else f"{self.reach:g} cycles"


def look_sizes(limit: int) -> tuple[int, ...]:
    """Return the numbers of trials at which a point is looked at, the last of them the limit, at least `FIRST_LOOK`.

    >>> look_sizes(100)
    (20, 30, 45, 67, 100)
    """
    sizes, size = [], FIRST_LOOK
    while size * math.sqrt(GROWTH) <= limit:
        sizes.append(size)
        size = int(GROWTH * size)
    return (*sizes, limit)


def relative_sizes(looks: int) -> tuple[float, ...]:
    """Return the numbers of trials at the first `looks` looks, relative to the first of them."""
    return tuple(GROWTH**look for look in range(looks))


def look_level(sizes: tuple[int, ...]) -> float:
    """Return the level of each look's interval so that all of them hold the truth with probability `LEVEL`."""
    return 2 * NormalDist().cdf(look_boundary(sizes, LEVEL)) - 1


@lru_cache
def look_boundary(sizes: tuple[float, ...], level: float) -> float:
    """Return the number of standard errors that a mean deviates by at most, at all looks, with probability `level`."""
    return float(brentq(lambda boundary: probability_within(boundary, sizes) - level, 1, 8))


def looks_p_value(p_value: float, looks: int) -> float:
    """Return the smallest p-value of several looks, between which trials grow by `GROWTH`, corrected for their number.

    Two-sided p-values of any test are converted to standard errors as for a normal mean (the significance level
    approach of Jennison and Turnbull, 1999).

    >>> [round(looks_p_value(0.01, looks), 3) for looks in (1, 2, 8)]
    [0.01, 0.016, 0.05]
    """
    bound = min(1.0, looks * p_value)
    if bound <= 1e-9 or p_value == 1:  # beyond the digits of the quadrature, or no deviation at all
        return bound
    deviation = NormalDist().inv_cdf(1 - p_value / 2)
    return min(bound, 1 - probability_within(deviation, relative_sizes(looks)))


def probability_within(boundary: float, sizes: tuple[float, ...]) -> float:
    """Return the probability that a mean is within `boundary` standard errors of the truth at every look.

    The density of the deviations that were within so far is carried from look to look (Armitage, McPherson and Rowe
    1969); the correlation between the deviations of n of m trials and of all m is the root of n / m.

    >>> [round(probability_within(1.96, sizes), 3) for sizes in ((20,), (20, 40), (20, 40, 60, 80, 100))]
    [0.95, 0.917, 0.858]
    """
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    x, weights = boundary * nodes, boundary * weights
    density = np.exp(-(x**2) / 2) / math.sqrt(2 * math.pi)
    for before, size in pairwise(sizes):
        correlation = math.sqrt(before / size)
        spread = math.sqrt(1 - before / size)
        step = (x[:, None] - correlation * x) / spread
        density = np.exp(-(step**2) / 2) @ (weights * density) / (spread * math.sqrt(2 * math.pi))
    return float(weights @ density)


def look_contrast(first: Estimate, other: Estimate, *, is_relative: bool) -> Estimate:
    """Return the ratio of the other mean to the first, or their difference, from intervals at looks of equal size.

    The level is that of their intervals; the interval of the ratio is computed in logarithms.
    """
    if not is_relative:
        return difference(first.ends, other.ends)
    logs = ([math.log(end) if end > 0 else -math.inf for end in each.ends] for each in (first, other))
    return difference(*logs).apply(math.exp)


def look_interval(measured: Measured, limit: int) -> Estimate:
    """Return the mean at a look, restricted if trials are censored, with its interval; `limit` is the most trials.

    If all trials are censored, the binomial distribution limits the share that would end sooner (Clopper and Pearson
    1934). If all trials have failed, the mean is undetermined.
    """
    if not len(measured.values):
        return UNDETERMINED
    level = look_level(look_sizes(limit))
    if measured.observed.any():
        return estimate_mean(measured, level)
    share_ending = 1 - ((1 - level) / 2) ** (1 / len(measured.values))
    return Estimate(measured.horizon, (1 - share_ending) * float(measured.values.min()), measured.horizon)
