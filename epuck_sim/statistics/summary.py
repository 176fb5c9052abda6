"""Statistics of T_sync at each point of a sweep; censored trials are taken into account (thesis Appendix A)."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.mean_estimate import estimate_mean
from epuck_sim.statistics.survival import median_time, restricted_mean


class PointSummary(NamedTuple):
    """T_sync at one point, in cycles; None where it is undetermined, or an end of an interval is not reached."""

    point: int
    axes: dict[str, Any]
    trials: int
    """Number of trials that have a result."""
    censored: float
    """Share of these trials that is censored; 0 without trials."""
    mean: float | None
    """Mean of the Weibull distribution that is nearest to the Kaplan-Meier estimate (Appendix A)."""
    mean_low: float | None
    """Lower end of the 95 % bootstrap interval of the mean."""
    mean_high: float | None
    """Upper end of the 95 % bootstrap interval of the mean."""
    median: float | None
    """Median of the Kaplan-Meier estimate."""
    median_low: float | None
    """Lower end of the 95 % interval of the median."""
    median_high: float | None
    """Upper end of the 95 % interval of the median."""
    restricted_mean: float | None
    """Mean of the lesser of T_sync and `horizon`: the area under the Kaplan-Meier estimate up to there."""
    horizon: float
    """Limit of cycles, or the longest trial where some were censored before this limit."""


def summarize(points: Iterable[PointTrials]) -> list[PointSummary]:
    """Return the statistics of each point; equal results give equal numbers."""
    return [_summarize_point(point) for point in points]


def _summarize_point(point: PointTrials) -> PointSummary:
    times, observed = point.times, point.observed
    limit = float(point.scenario.stop.max_cycles)
    if not len(times):
        return PointSummary(point.number, point.axes, 0, 0.0, None, None, None, None, None, None, None, limit)
    # trials that ran out of time before they ran out of cycles say nothing about what comes after the longest of them
    horizon = limit if observed.all() else min(limit, float(times.max()))
    mean = estimate_mean(times, observed, point.seed)
    median, median_low, median_high = median_time(times, observed)
    return PointSummary(
        point=point.number,
        axes=point.axes,
        trials=len(times),
        censored=1 - float(observed.mean()),
        mean=finite_or_none(mean.mean),
        mean_low=finite_or_none(mean.low),
        mean_high=finite_or_none(mean.high),
        median=finite_or_none(median),
        median_low=finite_or_none(median_low),
        median_high=finite_or_none(median_high),
        restricted_mean=finite_or_none(restricted_mean(times, observed, horizon)),
        horizon=horizon,
    )


def finite_or_none(number: float) -> float | None:
    """Return a number as JSON can hold it: None if it is NaN or infinite."""
    return number if math.isfinite(number) else None
