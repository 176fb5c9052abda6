"""How many trials it takes to see a difference between two means of T_sync or a measure, or between two shares."""

import math
from collections.abc import Sequence
from statistics import NormalDist

from epuck_sim.estimate import LEVEL, MIN_TRIALS
from epuck_sim.statistics.mean import mean_and_error
from epuck_sim.statistics.measured import Measured

POWER = 0.8
"""Probability with which a difference is to be seen, by default."""


def relative_spread(measured: Measured) -> float:
    """Return the standard deviation of a trial over the size of the mean, restricted where trials are censored.

    It is NaN with fewer than `MIN_TRIALS` trials, where all trials have one value, and where the mean is 0.
    """
    mean, error, _ = mean_and_error(measured)
    if len(measured.values) < MIN_TRIALS or error == 0 or mean == 0:
        return math.nan
    return error * math.sqrt(len(measured.values)) / abs(mean)


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
    both_sides = sum(_quantiles(power))
    variance = 2 * sum(spread**2 for spread in spreads) / len(spreads) ** 2
    return max(MIN_TRIALS, math.ceil(variance * (both_sides / math.log1p(difference)) ** 2))


def trials_for_shares(shares: Sequence[float], difference: float, power: float = POWER) -> int | None:
    """Return how many trials a point each of two samples needs for shares that differ by this much to be told apart.

    As `trials_needed`, for truth values. Of shares that are higher and shares that are lower by the difference, those
    count that take more trials. The number is that for a test with the correction for continuity, which is nearly that
    of an exact or a permutation test (Casagrande, Pike, Smith 1978); over several points, of their mean difference.

    Args:
        shares: (P,) share of the trials in which the value is true, at each point.
        difference: Difference of two shares to be seen: 0.2 for 20 percentage points.
        power: Probability with which it is seen.

    Returns:
        The number of trials; None if the shares can neither rise nor fall by so much.

    >>> trials_for_shares([0.5], 0.2), trials_for_shares([0.5], 0.6)
    (103, None)
    """
    found = [
        _trials_between(shares, others, power)
        for others in ([share + difference for share in shares], [share - difference for share in shares])
        if min(others) >= 0 and max(others) <= 1
    ]
    return max(found, default=None)


def _trials_between(shares: Sequence[float], others: Sequence[float], power: float) -> int:
    """Return how many trials a point tell shares, (P,), from others that differ from them by one difference."""
    chance, seen = _quantiles(power)
    count, difference = len(shares), abs(others[0] - shares[0])
    pairs = list(zip(shares, others, strict=True))
    alike = sum(2 * mean * (1 - mean) for mean in ((one + other) / 2 for one, other in pairs))
    apart = sum(one * (1 - one) + other * (1 - other) for one, other in pairs)
    trials = (chance * math.sqrt(alike) + seen * math.sqrt(apart)) ** 2 / (count * difference**2)  # at all points
    corrected = trials / 4 * (1 + math.sqrt(1 + 4 / (trials * difference))) ** 2
    return max(MIN_TRIALS, math.ceil(corrected / count))


def _quantiles(power: float) -> tuple[float, float]:
    """Return how many standard errors must not be passed by chance, and by how many more the difference exceeds it."""
    return NormalDist().inv_cdf((1 + LEVEL) / 2), NormalDist().inv_cdf(power)
