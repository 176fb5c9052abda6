"""An estimate of a number from several trials, with its 95 % interval; and how many trials an interval takes."""

import math
from typing import NamedTuple

LEVEL = 0.95
"""Probability with which an interval is meant to hold the truth."""

MIN_TRIALS = 5
"""Fewest trials with an interval.

With 5 trials of skewed distributions intervals of the mean hold the truth in 90 to 98 % of all cases, and are 1 to 3
times as wide as the mean; with 3 they are 3 to 8 times as wide, and tell nothing (docs/statistics.md).
"""


class Estimate(NamedTuple):
    """A number and its 95 % interval."""

    value: float
    """NaN where it is undetermined."""
    low: float
    high: float
    """NaN, as `low` is, where there is no interval; inf where the upper end is not reached."""

    @property
    def has_interval(self) -> bool:
        """Whether there is an interval, though its upper end may be open."""
        return not math.isnan(self.low)


UNDETERMINED = Estimate(math.nan, math.nan, math.nan)
"""Estimate of a number of which nothing is known."""


def without_interval(value: float) -> Estimate:
    """Return an estimate that has no interval."""
    return Estimate(value, math.nan, math.nan)
