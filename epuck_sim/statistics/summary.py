"""Statistics of a measure at each point of a sweep; censored trials are taken into account (thesis Appendix A)."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.estimate import UNDETERMINED, without_interval
from epuck_sim.statistics.measured import measure
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.statistic import estimate

STATISTIC_NAMES = {
    "mean": "mean",
    "median": "median",
    "restricted_mean": "restricted mean",
    "weibull_mean": "Weibull mean",
}
"""Name of each statistic of a `PointSummary`, by its field."""


class PointSummary(NamedTuple):
    """A measure at one point; None where it is undetermined, has no interval, or an end is not reached.

    T_sync is in cycles. Only of T_sync are there restricted and Weibull means, and a horizon.
    """

    point: int
    axes: dict[str, Any]
    trials: int
    """Number of trials that have a result; of a measure, a value."""
    censored: float
    """Share of these trials that is censored; 0 without trials."""
    mean: float | None
    """Mean of the sample, or share of truth values that are true; None where trials are censored."""
    mean_low: float | None
    """Lower end of the 95 % interval of the mean."""
    mean_high: float | None
    """Upper end of the 95 % interval of the mean."""
    median: float | None
    """Median of the Kaplan-Meier estimate; None of truth values."""
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
    horizon: float | None
    """Limit of cycles, or the longest trial where some were censored before this limit."""
    is_share: bool = False
    """Whether the mean is the share of trials in which a truth value is true."""

    def estimate(self, statistic: str) -> list[float | None]:
        """Return the value of a statistic, given by its field, and the two ends of its interval."""
        return [getattr(self, f"{statistic}{end}") for end in ("", "_low", "_high")]


def summarize(points: Iterable[PointTrials]) -> list[PointSummary]:
    """Return the statistics of T_sync, or of the measure that `read_points` was asked for, at each point.

    Equal results give equal numbers.

    Args:
        points: What `read_points` returns.

    Raises:
        StoreError: The measure is a series (see `statistics.series`), or trials have no T_sync.
    """
    return [_summarize_point(point) for point in points]


def _summarize_point(point: PointTrials) -> PointSummary:
    measured = measure(point)
    horizon = finite_or_none(measured.limit)
    if not len(measured.values):
        return PointSummary._make([point.number, point.axes, 0, 0.0, *[None] * 12, horizon, False])
    head = (point.number, point.axes, len(measured.values), measured.censored)
    mean = estimate(measured, Statistic.MEAN)
    median = UNDETERMINED if measured.is_share else estimate(measured, Statistic.MEDIAN)
    restricted = weibull = UNDETERMINED
    if measured.is_time:
        restricted = mean if measured.observed.any() else without_interval(measured.horizon)
        mean = UNDETERMINED if measured.censored else restricted
        weibull = estimate(measured, Statistic.WEIBULL_MEAN)
        horizon = measured.horizon
    numbers = [finite_or_none(number) for each in (mean, median, restricted, weibull) for number in each]
    return PointSummary._make([*head, *numbers, horizon, measured.is_share])


def applicable_statistics(points: Sequence[PointSummary]) -> dict[str, str]:
    """Return the names of the statistics that say something of some points, by their fields, in the order of tables."""
    if any(point.is_share for point in points):
        return {"mean": "share"}
    is_censored = any(point.censored for point in points)
    names = {field: name for field, name in STATISTIC_NAMES.items() if is_censored or field in ("mean", "median")}
    return {
        field: name for field, name in names.items() if field != "mean" or not all(point.censored for point in points)
    }


def finite_or_none(number: float) -> float | None:
    """Return a number as JSON can hold it: None if it is NaN or infinite."""
    return number if math.isfinite(number) else None
