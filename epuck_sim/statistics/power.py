"""How many trials it takes to see a difference between two means of T_sync."""

import math
from collections.abc import Sequence
from statistics import NormalDist

from epuck_sim.statistics.estimate import LEVEL, MIN_TRIALS
from epuck_sim.statistics.mean import mean_and_error
from epuck_sim.statistics.measured import Measured

POWER = 0.8
"""Probability with which a difference is to be seen, by default."""


def relative_spread(measured: Measured) -> float:
    """Return the standard deviation of a trial over the mean, restricted where trials are censored.

    It is NaN with fewer than `MIN_TRIALS` trials, or where all trials have one value.
    """
    mean, error, _ = mean_and_error(measured)
    if len(measured.values) < MIN_TRIALS or error == 0:
        return math.nan
    return error * math.sqrt(len(measured.values)) / mean


def trials_needed(spreads: Sequence[float], difference: float, power: float = POWER) -> int:
    """Return how many trials a point each of two samples needs for their difference to be seen with this probability.

    Seen means p < 0.05. One spread gives the trials to see it at that point; several, to see it over all of them, if
    they all differ alike. Logarithms of means are taken as normal, and the spreads as those of both samples.

    Args:
        spreads: (P,) relative spread at each point.
        difference: Difference to be seen, relative to the smaller mean: 0.2 for a fifth.
        power: Probability with which it is seen.

    >>> trials_needed([0.8], 0.2), trials_needed([0.8] * 20, 0.2)
    (303, 16)
    """
    both_sides = NormalDist().inv_cdf((1 + LEVEL) / 2) + NormalDist().inv_cdf(power)
    variance = 2 * sum(spread**2 for spread in spreads) / len(spreads) ** 2
    return max(MIN_TRIALS, math.ceil(variance * (both_sides / math.log1p(difference)) ** 2))
