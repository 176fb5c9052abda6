"""Statistics of T_sync at each point of a sweep; censored trials are taken into account (thesis Appendix A)."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.estimate import UNDETERMINED, without_interval
from epuck_sim.statistics.measured import measure_t_sync
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.statistic import estimate


class PointSummary(NamedTuple):
    """T_sync at one point, in cycles; None where it is undetermined, has no interval, or an end is not reached."""

    point: int
    axes: dict[str, Any]
    trials: int
    """Number of trials that have a result."""
    censored: float
    """Share of these trials that is censored; 0 without trials."""
    mean: float | None
    """Mean of the sample; None where trials are censored."""
    mean_low: float | None
    """Lower end of the 95 % interval of the mean."""
    mean_high: float | None
    """Upper end of the 95 % interval of the mean."""
    median: float | None
    """Median of the Kaplan-Meier estimate."""
    median_low: float | None
    """Lower end of the 95 % interval of the median."""
    median_high: float | None
    """Upper end of the 95 % interval of the median."""
    restricted_mean: float | None
    """Mean of the lesser of T_sync and `horizon`: the area under the Kaplan-Meier estimate up to there."""
    restricted_mean_low: float | None
    """Lower end of the 95 % interval of the restricted mean."""
    restricted_mean_high: float | None
    """Upper end of the 95 % interval of the restricted mean."""
    weibull_mean: float | None
    """Mean of the Weibull distribution that is nearest to the Kaplan-Meier estimate (Appendix A)."""
    weibull_mean_low: float | None
    """Lower end of the 95 % bootstrap interval of the Weibull mean."""
    weibull_mean_high: float | None
    """Upper end of the 95 % bootstrap interval of the Weibull mean."""
    horizon: float
    """Limit of cycles, or the longest trial where some were censored before this limit."""


def summarize(points: Iterable[PointTrials]) -> list[PointSummary]:
    """Return the statistics of each point; equal results give equal numbers."""
    return [_summarize_point(point) for point in points]


def _summarize_point(point: PointTrials) -> PointSummary:
    measured = measure_t_sync(point)
    if not len(point.times):
        return PointSummary._make([point.number, point.axes, 0, 0.0, *[None] * 12, measured.limit])
    restricted = estimate(measured, Statistic.MEAN)
    if not point.observed.any():
        restricted = without_interval(measured.horizon)
    mean = UNDETERMINED if measured.censored else restricted
    estimates = (mean, estimate(measured, Statistic.MEDIAN), restricted, estimate(measured, Statistic.WEIBULL_MEAN))
    numbers = [finite_or_none(number) for each in estimates for number in each]
    head = (point.number, point.axes, len(point.times), measured.censored)
    return PointSummary._make([*head, *numbers, measured.horizon])


def finite_or_none(number: float) -> float | None:
    """Return a number as JSON can hold it: None if it is NaN or infinite."""
    return number if math.isfinite(number) else None
