"""The statistics of a measure that tables and figures show, with their intervals and resamples."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.display.table import Row, Share, Table, plain
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import MIN_TRIALS, UNDETERMINED, Estimate
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.mean import estimate_mean, estimate_share, resample_means
from epuck_sim.statistics.measured import Measured, measure, quantity
from epuck_sim.statistics.names import Statistic, statistic_name
from epuck_sim.statistics.survival import (
    estimate_weibull_mean,
    median_time,
    medians,
    resampled_curves,
    weibull_resamples,
)

RESAMPLES = 1000  # number of resamples of each point

MOST_CENSORED = 0.5
"""Share of censored trials from which on figures hatch a point, and minima and peaks do without it."""


def check_statistic(measured: Measured, statistic: Statistic) -> None:
    """Raise EpuckSimError for a statistic that makes no sense of a measure."""
    if statistic == Statistic.WEIBULL_MEAN and measured.limit == math.inf:
        raise EpuckSimError("the Weibull mean is of T_sync alone; allowed for measures: mean or median")
    if statistic != Statistic.MEAN and measured.is_share:
        raise EpuckSimError("truth values have no median; allowed: mean, the share of trials in which they are true")


def estimate(measured: Measured, statistic: Statistic, resampled: FloatArray | None = None) -> Estimate:
    """Return a statistic with its interval; undetermined where no trial is uncensored.

    The interval of a Weibull mean is that of what `resample` gives, where it is at hand.
    """
    name = statistic_name(statistic, measured.censored > 0, is_share=measured.is_share)
    if not measured.observed.any():
        found = UNDETERMINED
    elif measured.is_share:
        found = estimate_share(measured)
    elif statistic == Statistic.MEAN:
        found = estimate_mean(measured)
    elif statistic == Statistic.MEDIAN:
        found = estimate_median(measured)
    else:
        found = estimate_weibull_mean(measured, resampled)
    return measured.described(found, name)


def resample(measured: Measured, statistic: Statistic) -> FloatArray:
    """Return a statistic of `RESAMPLES` resamples, (B,); inf where it is longer than can be said."""
    if not measured.observed.any():
        return np.full(RESAMPLES, math.inf)
    if statistic == Statistic.MEAN:
        return resample_means(measured, RESAMPLES)
    if statistic == Statistic.WEIBULL_MEAN:
        return weibull_resamples(measured.values, measured.observed, RESAMPLES, measured.seed)
    shift = _shift(measured)
    curves = resampled_curves(measured.values - shift, measured.observed, RESAMPLES, measured.seed)
    return np.concatenate([medians(block) for block in curves]) + shift


def estimate_median(measured: Measured) -> Estimate:
    """Return the median with its interval; no interval below `MIN_TRIALS` trials, or where all have one value."""
    shift = _shift(measured)
    median, low, high = (end + shift for end in median_time(measured.values - shift, measured.observed))
    if math.isinf(median):
        return UNDETERMINED
    return Estimate(median, low, high) if measured.supports_interval else Estimate(median)


def _shift(measured: Measured) -> float:
    """Return the smallest value if it is negative, else 0.0; less it, values are like times."""
    return min(float(measured.values.min()), 0.0)


SUMMARIES = ("mean", "median", "restricted_mean", "weibull_mean")
"""Names in JSON and CSV of the estimates that `summarize` prints for a point."""


class PointSummary(NamedTuple):
    """A measure at one point."""

    point: int
    axes: dict[str, Any]
    trials: int
    """Number of trials that have a result; of a measure, a value."""
    censored: float
    """Share of these trials that is censored; 0 without trials."""
    estimates: dict[str, Estimate]
    """The statistics, by the names in `SUMMARIES`; a mean of truth values is the share that is true."""
    horizon: float
    """Limit of cycles of T_sync, or the longest trial where some were censored before this limit; inf of a measure."""
    is_share: bool = False
    """Whether the mean is the share of trials in which a truth value is true."""

    def record(self) -> dict[str, Any]:
        """Return the point as JSON holds it: each estimate with `_low` and `_high`, null where there is none."""
        head = {"point": self.point, "axes": self.axes, "trials": self.trials, "censored": self.censored}
        return {**head, **Row({}, self.estimates).record(), "horizon": plain(self.horizon), "is_share": self.is_share}


class Summaries(list[PointSummary]):
    """The statistics of the points of a sweep; notebooks show them as a table."""

    def __init__(self, points: Sequence[PointSummary], label: str) -> None:
        """Take the points, and the label of what is estimated."""
        super().__init__(points)
        self.label = label

    def table(self, folder: str = "") -> Table:
        """Return a table of the statistics that say something of some points."""
        names = self._applicable()
        is_time = any(point.horizon < math.inf for point in self)
        rows = []
        for point in self:
            censored = {"censored": Share(point.censored)} if is_time else {}
            estimates = {name: point.estimates[name] for name in names}
            rows.append(Row(point.axes, {"point": point.point, "trials": point.trials, **censored, **estimates}))
        title = f"{folder}{': ' * bool(folder)}{self.label}, with 95 % intervals"
        return Table(title, rows, self._notes(), names)

    def _applicable(self) -> dict[str, str]:
        """Return the headings of the statistics, by name: where nothing is censored, a mean has but one name."""
        is_censored = any(point.censored for point in self)
        names = {name: each.name for point in reversed(self) for name, each in point.estimates.items() if each.name}
        if not is_censored:
            return {name: names[name] for name in names if name in ("mean", "median")} or {"mean": "mean"}
        all_censored = all(point.censored for point in self)
        return {name: heading for name, heading in names.items() if name != "mean" or not all_censored}

    def _notes(self) -> list[str]:
        notes = [] if any(point.trials for point in self) else ["No trial has a result yet."]
        if any(point.censored for point in self):
            notes.append(
                "Mean: of all trials, where none is censored. Restricted mean: of the lesser of T_sync and the limit "
                "of cycles, or the longest trial. Weibull mean: extrapolated by thesis Appendix A. -: undetermined."
            )
        few = sum(0 < point.trials < MIN_TRIALS for point in self)
        if few:
            notes.append(f"No intervals at {few} of {len(self)} points: one takes {MIN_TRIALS} trials or more.")
        return notes

    def _repr_html_(self) -> str:
        """Return the table for notebooks."""
        return self.table()._repr_html_()


def summarize(points: Sequence[PointTrials]) -> Summaries:
    """Return the statistics of T_sync, or of the measure that `read_points` was asked for, at each point.

    Equal results give equal numbers.

    Args:
        points: What `read_points` returns.

    Raises:
        StoreError: The measure is a series (see `statistics.series`), or trials have no T_sync.
    """
    made = [_summarize_point(point) for point in points]
    units = [each.unit for point in made for each in point.estimates.values() if each.unit]
    return Summaries(made, quantity(points[0].of if points else None, units[0] if units else ""))


def _summarize_point(point: PointTrials) -> PointSummary:
    measured = measure(point)
    if not len(measured.values):
        nothing = dict.fromkeys(SUMMARIES, UNDETERMINED)
        return PointSummary(point.number, point.axes, 0, 0.0, nothing, measured.limit)
    mean = estimate(measured, Statistic.MEAN)
    restricted = mean if measured.observed.any() else Estimate(measured.horizon)  # the area under the survival curve
    is_time = measured.limit < math.inf
    estimates = (
        measured.described(UNDETERMINED, "mean") if measured.censored else mean,
        UNDETERMINED if measured.is_share else estimate(measured, Statistic.MEDIAN),
        measured.described(restricted, "restricted mean") if is_time else UNDETERMINED,
        estimate(measured, Statistic.WEIBULL_MEAN) if is_time else UNDETERMINED,
    )
    head = (
        point.number,
        point.axes,
        len(measured.values),
        measured.censored,
        dict(zip(SUMMARIES, estimates, strict=True)),
    )
    return PointSummary(*head, measured.horizon, measured.is_share)
