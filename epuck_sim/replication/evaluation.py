"""From stored trials to the effect of each check of a claim."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from epuck_sim.errors import EpuckSimError
from epuck_sim.measures.interface import Value
from epuck_sim.replication.checks import (
    Check,
    FormulaCheck,
    LevelCheck,
    PowerCheck,
    RateCheck,
    RatioCheck,
    RiseCheck,
    ShareCheck,
    SweepCheck,
    Values,
)
from epuck_sim.replication.criteria import exponential_rate, largest_rise, level, power_exponent, ratio, share
from epuck_sim.replication.effects import Effect, restrict
from epuck_sim.replication.formulas import FORMULAS
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import canonical_text
from epuck_sim.scenario.points import Point
from epuck_sim.statistics.curves import group_by_other_axes
from epuck_sim.statistics.estimate import without_interval
from epuck_sim.statistics.measured import Measured, measure
from epuck_sim.util.messages import short_repr

REDUCTIONS: dict[str, Callable[[Sequence[float]], float]] = {
    "first": lambda values: values[0],
    "final": lambda values: values[-1],
    "mean": lambda values: float(np.mean(values)),
    "largest": max,
}
"""What stands for the values of a series."""


AnyPoint = TypeVar("AnyPoint", Point, PointTrials)
"""A point of a sweep, with or without its trials."""


class Finding(NamedTuple):
    """A check, and what its test found."""

    check: Check
    effect: Effect
    trials: tuple[int, int]
    """Fewest and most trials of its points; 0 of a formula."""
    censored: float
    """Largest share of censored trials of its points."""


def run_check(check: Check, points: Sequence[PointTrials]) -> Finding:
    """Return what a test finds in the points of its claim's sweep.

    Raises:
        EpuckSimError: The sweep lacks a point that the check names.
    """
    if isinstance(check, FormulaCheck):
        value = FORMULAS[check.number]()
        exact = Effect(
            without_interval(value), lambda x: 0.0 if value > x else 1.0, lambda x: 0.0 if value < x else 1.0
        )
        return Finding(check, exact, (0, 0), 0.0)
    used = chosen_points(check, points)
    samples = restrict([_measure(point, check) for point in used])
    counts = [len(each.values) for each in samples]
    censored = max(each.censored for each in samples)
    by_key = {point.key: sample for point, sample in zip(used, samples, strict=True)}
    return Finding(check, _find_effect(check, used, by_key), (min(counts), max(counts)), censored)


def chosen_points(check: SweepCheck, points: Sequence[AnyPoint]) -> list[AnyPoint]:
    """Return the points of a sweep that a check uses.

    Raises:
        EpuckSimError: There is none, or more than one where there must be one.
    """
    places = check.between if isinstance(check, RatioCheck) else ({},)
    used = [each for place in places for each in points_at({**check.where, **place}, points)]
    if isinstance(check, LevelCheck | ShareCheck) and len(used) > 1:
        raise EpuckSimError(f"where {_in_text(check.where)}: {len(used)} points; {check.test} is of one")
    return used


def points_at(values: Values, points: Sequence[AnyPoint]) -> list[AnyPoint]:
    """Return the points of a sweep that have these values of axes.

    Raises:
        EpuckSimError: There is none.
    """
    found = [point for point in points if all(_is_same(point.axes.get(key), values[key]) for key in values)]
    if not found:
        raise EpuckSimError(f"where {_in_text(values)}: the sweep has no such point")
    return found


def _find_effect(check: SweepCheck, points: Sequence[PointTrials], samples: dict[str, Measured]) -> Effect:
    if isinstance(check, RatioCheck):
        first, second = (points_at({**check.where, **place}, points) for place in check.between)
        if len(first) != len(second):
            raise EpuckSimError(f"between {_in_text(check.between[0])} and {_in_text(check.between[1])}: no pairs")
        return ratio([(samples[a.key], samples[b.key]) for a, b in zip(first, second, strict=True)])
    if isinstance(check, RiseCheck):
        curves = [group for _, group in group_by_other_axes(points, check.along)]
        return largest_rise([[samples[point.key] for point in curve] for curve in curves])
    if isinstance(check, PowerCheck | RateCheck):
        ordered = sorted(points, key=lambda point: float(point.axes[check.along]))
        x = np.array([float(point.axes[check.along]) for point in ordered])
        fit = power_exponent if isinstance(check, PowerCheck) else exponential_rate
        return fit(x, [samples[point.key] for point in ordered])
    (sample,) = samples.values()
    return share(sample) if isinstance(check, ShareCheck) else level(sample)


def _measure(point: PointTrials, check: SweepCheck) -> Measured:
    if check.take is not None:
        reduced: tuple[Value, ...] = tuple(_reduce(value, check.take) for value in point.measured)
        point = point._replace(measured=reduced)
    return measure(point)


def _reduce(value: Value, take: str) -> Value:
    """Return what stands for a series; None if it has no value."""
    known = [each for each in value if each is not None] if isinstance(value, list) else []
    return REDUCTIONS[take](known) if known else None


def _is_same(value: Any, wanted: Any) -> bool:
    return canonical_text({"value": value}) == canonical_text({"value": wanted})


def _in_text(values: Values) -> str:
    return ", ".join(f"{key} = {short_repr(value)}" for key, value in values.items()) or "all points"
