"""Shares of trials in which a truth value is true, with intervals that hold near 0 and 1, too.

The interval of a share is Wilson's (1927), that of a difference of two shares Newcombe's hybrid of these (1998, method
10). docs/statistics.md says how often they hold the truth.
"""

import math
from statistics import NormalDist

from epuck_sim.estimate import LEVEL, MIN_TRIALS, Estimate
from epuck_sim.statistics.measured import Measured

QUANTILE = NormalDist().inv_cdf((1 + LEVEL) / 2)
"""Number of standard errors that an interval reaches either way."""


def estimate_share(measured: Measured) -> Estimate:
    """Return the share of trials in which a truth value is true; no interval below `MIN_TRIALS` trials."""
    trials = len(measured.values)
    share = float(measured.values.mean())
    if trials < MIN_TRIALS:
        return Estimate(share)
    return Estimate(share, *wilson_interval(share, trials))


def wilson_interval(share: float, trials: int) -> tuple[float, float]:
    """Return the lower and the upper end of the 95 % interval of a share.

    >>> [round(end, 3) for end in wilson_interval(1.0, 10)]
    [0.722, 1.0]
    """
    weight = QUANTILE**2 / trials
    centre = (share + weight / 2) / (1 + weight)
    reach = math.sqrt(weight * (share * (1 - share) + weight / 4)) / (1 + weight)
    return max(0.0, min(centre - reach, share)), min(1.0, max(centre + reach, share))  # whatever is rounded


def share_difference(first: Measured, second: Measured) -> Estimate:
    """Return the second share minus the first, with an interval if both have one."""
    one, other = estimate_share(first), estimate_share(second)
    difference = other.value - one.value
    if not (one.has_interval and other.has_interval):
        return Estimate(difference)
    low = math.hypot(other.value - other.low, one.high - one.value)
    high = math.hypot(other.high - other.value, one.value - one.low)
    return Estimate(difference, difference - low, difference + high)
