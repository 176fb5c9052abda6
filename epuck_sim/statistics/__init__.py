"""Censored synchronisation times, their curves over speed, and scaling laws.

May import: runs and what it may import; never sweep.
"""

from enum import StrEnum


class Statistic(StrEnum):
    """What a figure shows of the trials of a point."""

    MEAN = "mean"  # mean of the sample; restricted to the horizon where trials are censored
    MEDIAN = "median"  # median of the Kaplan-Meier estimate
    WEIBULL_MEAN = "weibull-mean"
    """Mean of the nearest Weibull distribution (thesis Appendix A), which is extrapolated where trials are censored."""


def statistic_name(statistic: Statistic, is_censored: bool, *, is_share: bool = False) -> str:
    """Return the name of a statistic of trials some of which are censored, or none, or of truth values.

    >>> statistic_name(Statistic.MEAN, False), statistic_name(Statistic.MEAN, True)
    ('mean', 'restricted mean')
    """
    if is_share:
        return "share"
    if statistic == Statistic.MEAN:
        return "restricted mean" if is_censored else "mean"
    return "median" if statistic == Statistic.MEDIAN else "Weibull mean"
