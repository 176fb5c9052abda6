"""Curves of T_sync against one axis of a sweep, one for each combination of the other axes."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import canonical_text
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.statistics.mean_estimate import estimate_mean
from epuck_sim.util.messages import comma_list, did_you_mean

SPEED = ".speed_cm_s"
"""Ending of the keys of speeds, against which T_sync is drawn by default."""


class Curve(NamedTuple):
    """Mean T_sync, in cycles, along an axis, at the S points that have trials."""

    axes: dict[str, Any]
    """Values of the other axes."""
    scenario: Scenario
    """Scenario of its first point."""
    x: FloatArray
    """(S,) values of the axis, ascending."""
    trials: IntArray
    """(S,) number of trials."""
    censored: FloatArray
    """(S,) share of the trials."""
    means: FloatArray
    """(S,) mean by Appendix A; NaN where undetermined."""
    intervals: FloatArray
    """(S, 2) 95 % bootstrap intervals."""
    resampled: FloatArray
    """(B, S) bootstrap means; inf or NaN where undetermined."""


def choose_axis(points: Sequence[PointTrials], requested: str | None = None, origin: str = "--x") -> str:
    """Choose the axis to draw against: the requested one, or a speed, or the one with the most distinct numbers.

    Args:
        points: Points of a sweep.
        requested: Dotted key, or None.
        origin: Option or key that requests it, for messages.

    Raises:
        EpuckSimError: The requested axis, or every axis, is without numbers.
    """
    numbers = _numeric_axes(points)
    if requested is not None:
        return _check_axis(requested, numbers, origin)
    if not numbers:
        raise EpuckSimError("there is no axis with numbers to draw T_sync against")
    return max(numbers, key=lambda key: (key.endswith(SPEED), len(numbers[key])))


def choose_second_axis(points: Sequence[PointTrials], x: str, requested: str | None = None, origin: str = "--y") -> str:
    """Choose the vertical axis of a map: the requested one, or the only other one whose numbers differ.

    Args:
        points: Points of a sweep.
        x: Dotted key of the horizontal axis.
        requested: Dotted key of the vertical axis, or None.
        origin: Option or key that requests it, for messages.

    Raises:
        EpuckSimError: There is no such axis, there are several to choose from, or it is tied one-to-one to `x`.
    """
    numbers = _numeric_axes(points)
    others: list[str] = []
    for key, values in numbers.items():
        if len(values) > 1 and not any(_is_tied_to(key, axis, points) for axis in (x, *others)):
            others.append(key)
    choice = f"give --y one of {comma_list(others)}" if others else "there is no other axis whose numbers differ"
    if requested is not None:
        if _check_axis(requested, numbers, origin) == x or _is_tied_to(requested, x, points):
            raise EpuckSimError(f"{origin}: {requested} varies together with {x}, the horizontal axis; {choice}")
        return requested
    if len(others) != 1:
        raise EpuckSimError(f"a map needs a second axis, beside {x}: {choice}")
    return others[0]


def _check_axis(requested: str, numbers: Mapping[str, object], origin: str) -> str:
    if requested not in numbers:
        raise EpuckSimError(f"{origin}: {did_you_mean(requested, numbers)}; axes with numbers: {comma_list(numbers)}")
    return requested


def _numeric_axes(points: Sequence[PointTrials]) -> dict[str, set[float]]:
    """Return the distinct values of each axis all of whose values are numbers."""
    columns = {key: [point.axes[key] for point in points] for key in points[0].axes}
    return {key: set(values) for key, values in columns.items() if _are_numbers(values)}


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def read_curves(points: Sequence[PointTrials], axis: str) -> list[Curve]:
    """Estimate a curve for each combination of the values of the other axes, in the order of the sweep."""
    return [estimate_curve(group, axis, others) for others, group in group_by_other_axes(points, axis)]


def group_by_other_axes(points: Sequence[PointTrials], *axes: str) -> list[tuple[dict[str, Any], list[PointTrials]]]:
    """Group points by the values of all axes but `axes`, and sort each group by `axes`.

    An axis that is tied one-to-one to one of `axes` is not among the others. Groups are in the order of the sweep;
    points without trials are left out.

    Returns:
        For each group, the values of the other axes, and its points.
    """
    others = [key for key in points[0].axes if not any(key == x or _is_tied_to(key, x, points) for x in axes)]
    groups: dict[str, list[PointTrials]] = {}
    for point in points:
        groups.setdefault(canonical_text({key: point.axes[key] for key in others}), []).append(point)
    filled = ([point for point in group if len(point.times)] for group in groups.values())
    return [
        ({key: group[0].axes[key] for key in others}, sorted(group, key=lambda point: [point.axes[x] for x in axes]))
        for group in filled
        if group
    ]


def _is_tied_to(key: str, axis: str, points: Sequence[PointTrials]) -> bool:
    """Return whether the values of `axis` and `key` correspond one-to-one, as in a zip."""
    pairs = {(point.axes[axis], repr(point.axes[key])) for point in points}
    return len(pairs) == len({x for x, _ in pairs}) == len({value for _, value in pairs}) > 1


def estimate_curve(points: Sequence[PointTrials], axis: str, others: dict[str, Any]) -> Curve:
    """Estimate the curve through points that have trials, sorted by `axis`; `others` are the values that they share."""
    estimates = [estimate_mean(point.times, point.observed, point.seed) for point in points]
    return Curve(
        axes=others,
        scenario=points[0].scenario,
        x=np.array([point.axes[axis] for point in points], np.float64),
        trials=np.array([len(point.times) for point in points]),
        censored=np.array([1 - point.observed.mean() for point in points]),
        means=np.array([each.mean for each in estimates]),
        intervals=np.array([(each.low, each.high) for each in estimates]),
        resampled=np.stack([each.resampled for each in estimates], axis=1),
    )


def distinguishing_axes(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Keep only the axis values that distinguish each row, and drop axes that are tied one-to-one to another.

    >>> distinguishing_axes([{"width": 4, "height": 4, "tau": 5}, {"width": 6, "height": 6, "tau": 5}])
    [{'width': 4}, {'width': 6}]
    """
    kept: list[str] = []
    patterns: set[tuple[int, ...]] = set()
    for key in rows[0]:
        values = [repr(row[key]) for row in rows]
        pattern = tuple(values.index(value) for value in values)
        if len(set(pattern)) > 1 and pattern not in patterns:
            kept.append(key)
            patterns.add(pattern)
    return [{key: row[key] for key in kept} for row in rows]
