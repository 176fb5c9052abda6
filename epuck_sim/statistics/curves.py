"""Curves of a statistic of T_sync, or of a measure, against one axis of a sweep: one for each combination of others."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.scenario.axes import choose_axis, group_rows
from epuck_sim.scenario.keys import axis_key
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.statistic import Measured, check_statistic, cut, estimate, measure, resample, statistic_name


class Curve(NamedTuple):
    """A statistic of T_sync, in cycles, or of a measure, along an axis, at the S points that have trials."""

    axes: dict[str, Any]  # values of the other axes
    scenario: Scenario  # scenario of its first point
    statistic: Statistic
    x: FloatArray  # (S,) values of the axis, ascending
    trials: IntArray  # (S,) number of trials
    censored: FloatArray  # (S,) share of the trials
    values: FloatArray  # (S,) the statistic; NaN where undetermined
    intervals: FloatArray  # (S, 2) 95 % intervals; NaN where there is none, inf where an end is not reached
    resampled: FloatArray  # (B, S) the statistic of resamples; inf or NaN where undetermined
    of: str | None = None  # name of the measure; None for T_sync
    is_share: bool = False  # whether the measure is a truth value, and the statistic a share
    measured: Sequence[Measured] = ()  # (S,) the trials

    @property
    def names(self) -> list[str]:
        """(S,) name of the statistic at each point: a mean is restricted where trials are censored."""
        shares = self.censored.tolist()
        return [statistic_name(self.statistic, share > 0, is_share=self.is_share) for share in shares]


def folder_curves(
    folder: Path | str, of: str | None = None, axis: str | None = None, statistic: Statistic = Statistic.MEAN
) -> tuple[str, list[Curve]]:
    """Return an axis of a run folder, the speed or that with the most numbers by default, and the curves along it."""
    points = read_points(folder, of)
    rows = [point.axes for point in points]
    try:
        chosen = choose_axis(rows, axis and axis_key(axis, rows, "--x"))
    except EpuckSimError as error:
        raise EpuckSimError(f"{folder}: {error}") from error
    curves = read_curves(points, chosen, statistic)
    if not curves:
        raise StoreError(f"{folder}: holds no results yet")
    return chosen, curves


def read_curves(
    points: Sequence[PointTrials], axis: str, statistic: Statistic = Statistic.MEAN, censored_at: int | None = None
) -> list[Curve]:
    """Estimate a curve for each combination of the values of the other axes, in the order of the sweep."""
    groups = group_by_other_axes(points, axis)
    return [estimate_curve(group, axis, others, statistic, censored_at) for others, group in groups]


def group_by_other_axes(points: Sequence[PointTrials], *axes: str) -> list[tuple[dict[str, Any], list[PointTrials]]]:
    """Group points by the values of all axes but `axes`, see `group_rows`, and sort each group by `axes`.

    A group is the values of the other axes, and its points; those without trials are left out.
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

    Estimates are as if trials were censored at a cycle, where one is given.
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
    )
