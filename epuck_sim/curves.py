"""The results of a sweep as curves: T_sync against one axis, a curve for each combination of the others."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.axes import as_text
from epuck_sim.errors import EpuckSimError
from epuck_sim.mean_time import estimate_mean
from epuck_sim.results import PointTrials
from epuck_sim.scenario import Scenario
from epuck_sim.wording import listed, unknown

Floats = npt.NDArray[np.float64]

SPEED = ".speed_cm_s"
"""The axis to draw against ends so, where there is one."""


class Curve(NamedTuple):
    """Mean T_sync, in cycles, along an axis; points without trials are left out."""

    axes: dict[str, Any]
    """Values of the other axes."""
    scenario: Scenario
    """That of its first point."""
    x: Floats
    """(S,) values of the axis, ascending."""
    trials: npt.NDArray[np.int64]
    """(S,)"""
    censored: Floats
    """(S,) share of them."""
    means: Floats
    """(S,) by Appendix A; NaN where undetermined."""
    intervals: Floats
    """(S, 2) 95 % bootstrap intervals."""
    resampled: Floats
    """(B, S) bootstrap means; inf or NaN where undetermined."""


def choose_axis(points: Sequence[PointTrials], wanted: str | None = None) -> str:
    """Return the axis to draw against: the one wanted, or that of the speed, or the one with the most numbers.

    Raises EpuckSimError where there is none.
    """
    columns = {key: [point.axes[key] for point in points] for key in points[0].axes}
    numbers = {key: set(values) for key, values in columns.items() if _are_numbers(values)}
    if wanted is not None and wanted not in numbers:
        raise EpuckSimError(f"--x: {unknown(wanted, numbers)}; axes with numbers: {listed(numbers)}")
    if not numbers:
        raise EpuckSimError("there is no axis with numbers to draw T_sync against")
    return wanted or max(numbers, key=lambda key: (key.endswith(SPEED), len(numbers[key])))


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def read_curves(points: Sequence[PointTrials], axis: str) -> list[Curve]:
    """Return a curve for each combination of the values of the other axes, in the order of the sweep."""
    others = [key for key in points[0].axes if key != axis and not _goes_along(key, axis, points)]
    groups: dict[str, list[PointTrials]] = {}
    for point in points:
        groups.setdefault(as_text({key: point.axes[key] for key in others}), []).append(point)
    filled = ([point for point in group if len(point.times)] for group in groups.values())
    return [_curve(sorted(group, key=lambda point: point.axes[axis]), axis, others) for group in filled if group]


def _goes_along(key: str, axis: str, points: Sequence[PointTrials]) -> bool:
    """Return whether the values of `axis` and `key` belong together one to one, as in a zip."""
    pairs = {(point.axes[axis], repr(point.axes[key])) for point in points}
    return len(pairs) == len({x for x, _ in pairs}) == len({value for _, value in pairs}) > 1


def _curve(points: Sequence[PointTrials], axis: str, others: Sequence[str]) -> Curve:
    estimates = [estimate_mean(point.times, point.observed, point.seed) for point in points]
    return Curve(
        axes={key: points[0].axes[key] for key in others},
        scenario=points[0].scenario,
        x=np.array([point.axes[axis] for point in points], np.float64),
        trials=np.array([len(point.times) for point in points]),
        censored=np.array([1 - point.observed.mean() for point in points]),
        means=np.array([each.mean for each in estimates]),
        intervals=np.array([(each.low, each.high) for each in estimates]),
        resampled=np.stack([each.resampled for each in estimates], axis=1),
    )


def told_apart(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return of each row of axis values those that tell it from the others; what goes along with another is left out.

    >>> told_apart([{"width": 4, "height": 4, "tau": 5}, {"width": 6, "height": 6, "tau": 5}])
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
