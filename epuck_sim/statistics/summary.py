"""The synchronisation time at each point of a sweep, with what is censored taken into account (thesis Appendix A)."""

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
    """Those that have a result."""
    censored: float
    """Their share that is censored; 0 without trials."""
    mean: float | None
    """By Appendix A: the mean of the Weibull distribution that is nearest to the Kaplan-Meier estimate."""
    mean_low: float | None
    mean_high: float | None
    """The 95 % bootstrap interval of the mean."""
    median: float | None
    """Kaplan-Meier."""
    median_low: float | None
    median_high: float | None
    """Its 95 % interval."""
    restricted_mean: float | None
    """The mean of T_sync or `horizon`, whichever is less: the area under the Kaplan-Meier curve up to there."""
    horizon: float
    """The limit of cycles, or as far as trials were followed."""


def summarize(points: Iterable[PointTrials]) -> list[PointSummary]:
    """Return the statistics of each point; the same results give the same numbers."""
    return [_summary(point) for point in points]


def _summary(point: PointTrials) -> PointSummary:
    times, observed = point.times, point.observed
    limit = float(point.scenario.stop.max_cycles)
    if not len(times):
        return PointSummary(point.number, point.axes, 0, 0.0, None, None, None, None, None, None, None, limit)
    # trials that ran out of time before they ran out of cycles tell nothing of what comes after the longest of them
    horizon = limit if observed.all() else min(limit, float(times.max()))
    mean = estimate_mean(times, observed, point.seed)
    median, median_low, median_high = median_time(times, observed)
    return PointSummary(
        point=point.number,
        axes=point.axes,
        trials=len(times),
        censored=1 - float(observed.mean()),
        mean=_known(mean.mean),
        mean_low=_known(mean.low),
        mean_high=_known(mean.high),
        median=_known(median),
        median_low=_known(median_low),
        median_high=_known(median_high),
        restricted_mean=_known(restricted_mean(times, observed, horizon)),
        horizon=horizon,
    )


def _known(number: float) -> float | None:
    return number if math.isfinite(number) else None
