"""Curves of a statistic of T_sync, or of a measure: against one axis of a sweep, and over the cycles of its trials.

Only trials that reach a cycle count there. Where trials end by themselves, as with synchrony, those that are left
differ from those that have ended.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.special import stdtrit

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.display.table import Row, Table, plain
from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.estimate import LEVEL, MIN_TRIALS, Estimate
from epuck_sim.runs.reader import PointTrials, SweepTrials
from epuck_sim.scenario.axes import SPEED, choose_axis, group_rows
from epuck_sim.scenario.base import refused_at
from epuck_sim.scenario.keys import axis_key
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.statistic import (
    Measured,
    check_statistic,
    cut,
    estimate,
    measure,
    measure_of,
    measure_unit,
    resample,
    statistic_name,
)
from epuck_sim.statistics.survival import median_time


class Curve(NamedTuple):
    """A statistic of T_sync, in cycles, or of a measure, along an axis, at the S points that have trials."""

    axes: dict[str, Any]  # values of the other axes
    scenario: Scenario  # scenario of its first point
    statistic: Statistic
    x: FloatArray  # (S,) values of the axis, ascending
    trials: IntArray  # (S,) number of trials
    censored: FloatArray  # (S,) share of censored trials
    values: FloatArray  # (S,) the statistic; NaN where undetermined
    intervals: FloatArray  # (S, 2) 95 % intervals; NaN where there is none, inf where an end is not reached
    resampled: FloatArray  # (B, S) the statistic of resamples; inf or NaN where undetermined
    of: str | None = None  # name of the measure; None for T_sync
    is_share: bool = False  # whether the measure is a truth value, and the statistic a share
    measured: Sequence[Measured] = ()  # (S,) the trials
    tied: Mapping[str, Sequence[Any]] = {}  # (S,) values of axes that go with these, as in a zip

    @property
    def names(self) -> list[str]:
        """(S,) name of the statistic at each point: a mean is restricted where trials are censored."""
        shares = self.censored.tolist()
        return [statistic_name(self.statistic, share > 0, is_share=self.is_share) for share in shares]


def sweep_curves(
    points: SweepTrials, axis: str | None = None, statistic: Statistic = Statistic.MEAN
) -> tuple[str, list[Curve]]:
    """Return an axis of a sweep, by default speed or that with the most numbers, and the curves along it."""
    rows = [point.axes for point in points]
    with refused_at(str(points.folder)):
        chosen = choose_axis(rows, axis and axis_key(axis, rows, "--x"))
    curves = read_curves(points, chosen, statistic)
    if not curves:
        raise StoreError(f"{points.folder}: holds no results yet")
    return chosen, curves


def read_curves(
    points: Sequence[PointTrials], axis: str, statistic: Statistic = Statistic.MEAN, censored_at: int | None = None
) -> list[Curve]:
    """Estimate a curve for each combination of the values of the other axes, in the order of the sweep."""
    groups = group_by_other_axes(points, axis)
    return [estimate_curve(group, axis, others, statistic, censored_at) for others, group in groups]


def check_speed_alone(curves: Sequence[Curve]) -> None:
    """Raise EpuckSimError if anything but speeds and the limit of cycles changes along a curve."""
    tied = [key for curve in curves for key in curve.tied if not key.endswith((SPEED, ".max_cycles"))]
    if tied:
        raise EpuckSimError(f"{tied[0]} changes with the speed; put one of them in sweep.grid instead of zip")


def group_by_other_axes(points: Sequence[PointTrials], *axes: str) -> list[tuple[dict[str, Any], list[PointTrials]]]:
    """Group points by the values of all axes but `axes`, see `group_rows`, and sort each group by `axes`.

    A group is the values of the other axes, and its points; points without trials are left out.
    """
    found = []
    for others, places in group_rows([point.axes for point in points], *axes):
        group = [points[place] for place in places if len(points[place].times)]
        if group:
            found.append((others, sorted(group, key=lambda point: [point.axes[x] for x in axes])))
    return found


def estimate_curve(
    points: Sequence[PointTrials],
    axis: str,
    others: dict[str, Any],
    statistic: Statistic = Statistic.MEAN,
    censored_at: int | None = None,
) -> Curve:
    """Estimate the curve through points that have trials, sorted by `axis`; `others` are the values that they share.

    With `censored_at`, estimates are as if trials were censored at that cycle.
    """
    measured = [measure(point) for point in points]
    for each in measured:
        check_statistic(each, statistic)
    known = measured if censored_at is None else [cut(each, censored_at) for each in measured]
    resampled = [resample(each, statistic) for each in known]
    estimates = [estimate(each, statistic, drawn) for each, drawn in zip(known, resampled, strict=True)]
    return Curve(
        axes=others,
        scenario=points[0].scenario,
        statistic=statistic,
        x=np.array([point.axes[axis] for point in points], np.float64),
        trials=np.array([len(each.values) for each in measured]),
        censored=np.array([each.censored for each in measured]),
        values=np.array([each.value for each in estimates]),
        intervals=np.array([(each.low, each.high) for each in estimates]),
        resampled=np.stack(resampled, axis=1),
        of=points[0].of,
        is_share=any(each.is_share for each in measured),
        measured=measured,
        tied={key: [point.axes[key] for point in points] for key in points[0].axes if key not in (axis, *others)},
    )


class SeriesStatistics(NamedTuple):
    """Statistics of several series at each of C cycles, or other items (`over`); NaN where there are none."""

    cycles: IntArray  # (C,) cycles, from 1; other items count from 0, as robots do everywhere
    trials: IntArray  # (C,) number of trials that reach the cycle
    known: IntArray  # (C,) number of these whose value is determined; the statistics are of them
    mean: FloatArray  # (C, 3) mean, and the ends of its 95 % interval
    median: FloatArray  # (C, 3) median, and the ends of its 95 % interval
    over: str = "cycle"  # noun for the items, see `Measure.over`


class PointSeries(NamedTuple):
    """A measure's series at one point of a sweep."""

    point: int
    axes: dict[str, Any]
    statistics: SeriesStatistics
    unit: str  # unit of the statistics; empty if they have none
    is_timed: bool = False  # whether it is over cycles of 5 s, as the reference is no oscillator

    def record(self) -> dict[str, Any]:
        """Return the statistics as JSON holds them: a list with a value for each cycle."""
        cycles, trials, known, *_ = self.statistics
        found: dict[str, Any] = {"trials": trials, "known": known, self.statistics.over: cycles}
        for name in ("mean", "median"):
            ends = (name, f"{name}_low", f"{name}_high")
            found |= dict(zip(ends, getattr(self.statistics, name).T, strict=True))
        series = {name: plain(values.tolist()) for name, values in found.items()}
        return {"point": self.point, "axes": self.axes, "unit": self.unit, **series}


STEPS = (1, 2, 5)  # cycles of each decade that tables show, besides the last one
MOST = 20  # number of first items that tables show of series that are not over cycles


def series_table(title: str, points: Sequence[PointSeries]) -> Table:
    """Return a table of the series at each point, at some of the cycles: 1, 2 and 5 of each decade, and the last."""
    over, rows = points[0].statistics.over, []
    for point, axes, (cycles, trials, known, means, medians, _), *_ in points:
        last = len(cycles)
        shown = {step * 10**power for power in range(len(str(last))) for step in STEPS} | {last}
        shown |= set() if over == "cycle" else set(range(1, MOST + 1))
        for at in sorted(cycle - 1 for cycle in shown if 0 < cycle <= last):
            mean, median = (Estimate(*each[at].tolist()) for each in (means, medians))
            cells = {"point": point, "trials": int(trials[at]), "known": int(known[at]), "mean": mean, "median": median}
            rows.append(Row({**axes, over: int(cycles[at])}, cells))
    notes = [f"Trials: those that reach the {over} and have a value there."]
    notes += ["Cycles are 5 s long where the reference is no oscillator."] * any(each.is_timed for each in points)
    return Table(f"{title} at {over}s, with 95 % intervals", rows, notes, {"trials": "", "known": "trials"})


def summarize_series(points: Sequence[PointTrials]) -> list[PointSeries]:
    """Return the statistics of the series at each point that has any, over the cycles; raise StoreError without any."""
    if not any(has_series(point) for point in points):
        raise StoreError(f"{points[0].of or 'T_sync'} is no series, but one value for each trial")
    found = []
    for point in points:
        known = [value for value in point.measured if value is not None]
        # a number is a series of one
        series = [np.array(value if isinstance(value, list) else [value], float) for value in known]
        if any(map(len, series)):
            over = known_as.over if (known_as := measure_of(point)) else "cycle"
            statistics = series_statistics(series, over)
            is_timed = over == "cycle" and not getattr(point.scenario, "has_reference", True)
            found.append(PointSeries(point.number, point.axes, statistics, measure_unit(point), is_timed))
    if not found:
        raise StoreError(f"{points[0].of} has no value: no trial reaches a firing of the reference")
    return found


def has_series(point: PointTrials) -> bool:
    """Return whether a point's trials have series of the requested measure."""
    return any(isinstance(value, list) for value in point.measured)


def series_statistics(series: Sequence[FloatArray], over: str = "cycle") -> SeriesStatistics:
    """Return the statistics of several series, of any lengths, at each cycle; truth values count as 1 and 0.

    The mean's interval is Student's, of the logarithm where all values are positive; the median's has order statistics
    as its ends. There is none with fewer than `MIN_TRIALS` values, or where all are equal. Undetermined values are NaN.
    ValueError is raised without any series.
    """
    if not len(series):
        raise ValueError("series has none; allowed: one or more")
    lengths = np.array([len(each) for each in series], np.int64)
    cycles = np.arange(lengths.max()) + (over == "cycle")
    values = np.full((len(series), len(cycles)), np.nan)
    for row, each in zip(values, series, strict=True):
        row[: len(each)] = each
    ordered = np.sort(values, axis=0)  # NaN last; in order, so that the order of the trials does not matter
    known = np.count_nonzero(~np.isnan(values), axis=0)
    has_interval = (known >= MIN_TRIALS) & (_row(ordered, np.maximum(known - 1, 0)) > ordered[0])
    mean, median = _means(ordered, known, has_interval), _medians(ordered, known, has_interval)
    reached = np.count_nonzero(lengths[:, None] > np.arange(len(cycles)), axis=0)
    return SeriesStatistics(cycles, reached, known, mean, median, over)


def _means(ordered: FloatArray, known: IntArray, has_interval: BoolArray) -> FloatArray:
    count = np.maximum(known, 1)
    mean = np.where(known, np.nansum(ordered, axis=0) / count, np.nan)
    variance = np.nansum((ordered - mean) ** 2, axis=0) / np.maximum(known - 1, 1)
    quantiles = stdtrit(np.maximum(known - 1, 1), (1 + LEVEL) / 2)
    reach = np.where(has_interval, quantiles * np.sqrt(variance / count), np.nan)
    is_positive = ordered[0] > 0
    factor = np.exp(np.divide(reach, mean, where=is_positive, out=np.full_like(mean, np.nan)))
    low = np.where(is_positive, mean / factor, mean - reach)
    high = np.where(is_positive, mean * factor, mean + reach)
    return np.column_stack([mean, low, high])


def _medians(ordered: FloatArray, known: IntArray, has_interval: BoolArray) -> FloatArray:
    counts, places = np.unique(known, return_inverse=True)
    ranks = np.array([_median_ranks(count) for count in counts.tolist()], np.int64).reshape(-1, 4)[places]
    lower, upper, low, high = (_row(ordered, rank) for rank in ranks.T)
    ends = (np.where(has_interval, end, np.nan) for end in (low, high))
    return np.column_stack([np.where(known, (lower + upper) / 2, np.nan), *ends])


def _median_ranks(count: int) -> tuple[int, int, int, int]:
    """Return the ranks, from 0, of the two values between which the median lies, and of its interval's ends."""
    if count < MIN_TRIALS:
        return max(count - 1, 0) // 2, count // 2, 0, 0
    _, low, high = median_time(np.arange(count), np.ones(count, np.bool_))
    return (count - 1) // 2, count // 2, int(low), int(min(high, count - 1))


def _row(ordered: FloatArray, ranks: IntArray) -> FloatArray:
    return np.asarray(np.take_along_axis(ordered, ranks[None], axis=0)[0])
