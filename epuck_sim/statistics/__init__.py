"""Censored synchronisation times, their curves over speed, and scaling laws."""

from enum import StrEnum


class Statistic(StrEnum):
    """The statistic of a point's trials in a figure."""

    MEAN = "mean"  # mean of the sample; restricted to the horizon where trials are censored
    MEDIAN = "median"  # median of the Kaplan-Meier estimate
    WEIBULL_MEAN = "weibull-mean"
    """Mean of the nearest Weibull distribution (thesis Appendix A), which is extrapolated where trials are censored."""
