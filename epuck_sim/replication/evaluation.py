"""From stored trials to the effect of each check of a claim."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import Estimate
from epuck_sim.measures.interface import Value
from epuck_sim.replication import checks, criteria
from epuck_sim.replication.effects import Effect, restrict
from epuck_sim.replication.formulas import FORMULAS
from epuck_sim.replication.places import Drawn, collapse, find_place, place_exponent
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import canonical_text
from epuck_sim.scenario.points import Point
from epuck_sim.statistics.curves import estimate_curve, group_by_other_axes
from epuck_sim.statistics.measured import Measured, measure, measure_t_sync
from epuck_sim.util.messages import short_repr

SMALLEST, LARGEST = 1e-12, 1e-3
"""Deviations, in cycles, between which growth is judged: above rounding, and far below where it must end."""


def growth(deviations: Sequence[float]) -> float:
    """Return the growth rate of a deviation, per cycle, by least squares of its logarithm.

    Cycles count from half-way to that at which it first leaves the range from `SMALLEST` to `LARGEST`, or to the last
    one: a factor that the first cycles bring, once, is no growth.
    """
    left = next((cycle for cycle, each in enumerate(deviations) if not SMALLEST <= each <= LARGEST), None)
    kept = deviations[: None if left is None else left + 1]
    logs = np.log(np.maximum(kept[len(kept) // 2 :], SMALLEST))
    return float(np.polyfit(np.arange(len(logs)), logs, 1)[0]) if len(logs) > 1 else math.nan


REDUCTIONS: dict[str, Callable[[Sequence[float]], float]] = {
    "first": lambda values: values[0],
    "final": lambda values: values[-1],
    "mean": lambda values: float(np.mean(values)),
    "largest": max,
    "growth": growth,
}
"""What stands for the values of a series."""


AnyPoint = TypeVar("AnyPoint", Point, PointTrials)
"""A point of a sweep, with or without its trials."""


class Finding(NamedTuple):
    """A check, and what its test found."""

    check: checks.Check
    effect: Effect
    trials: tuple[int, int]
    """Fewest and most trials of its points; 0 of a formula."""
    censored: float
    """Largest share of censored trials of its points."""


def run_check(check: checks.Check, points: Sequence[PointTrials]) -> Finding:
    """Return what a test finds in the points of its claim's sweep.

    Raises:
        EpuckSimError: The sweep lacks a point that the check names.
    """
    if isinstance(check, checks.FormulaCheck):
        value = FORMULAS[check.number]()
        exact = Effect(Estimate(value), lambda x: 0.0 if value > x else 1.0, lambda x: 0.0 if value < x else 1.0)
        return Finding(check, exact, (0, 0), 0.0)
    used = chosen_points(check, points)
    samples = restrict([_measure(point, check) for point in used])
    counts = [len(each.values) for each in samples]
    censored = max(each.censored for each in samples)
    by_key = {point.key: sample for point, sample in zip(used, samples, strict=True)}
    return Finding(check, EFFECTS[check.test](check, used, by_key), (min(counts), max(counts)), censored)


def chosen_points(check: checks.SweepCheck, points: Sequence[AnyPoint]) -> list[AnyPoint]:
    """Return the points of a sweep that a check uses.

    Raises:
        EpuckSimError: There is none, or more than one where there must be one.
    """
    places = check.between if isinstance(check, checks.RatioCheck | checks.PairCheck) else ({},)
    used = [each for place in places for each in points_at({**check.where, **place}, points)]
    if isinstance(check, checks.PointCheck | checks.EstimatorCheck) and len(used) > 1:
        raise EpuckSimError(f"where {_in_text(check.where)}: {len(used)} points; {check.test} is of one")
    if isinstance(check, checks.PairCheck) and len(used) != 2:
        raise EpuckSimError(f"where {_in_text(check.where)}: {len(used)} points; {check.test} is of one at each place")
    return used


def points_at(values: checks.Values, points: Sequence[AnyPoint]) -> list[AnyPoint]:
    """Return the points of a sweep that have these values of axes.

    Raises:
        EpuckSimError: There is none.
    """
    found = [point for point in points if all(_is_same(point.axes.get(key), values[key]) for key in values)]
    if not found:
        raise EpuckSimError(f"where {_in_text(values)}: the sweep has no such point")
    return found


Points: TypeAlias = Sequence[PointTrials]
Samples: TypeAlias = dict[str, Measured]
Between: TypeAlias = checks.RatioCheck | checks.PairCheck


def _of_a_pair(test: Callable[[Measured, Measured], Effect]) -> Callable[..., Effect]:
    def find(check: checks.PairCheck, points: Points, samples: Samples) -> Effect:
        ((first, second),) = _pairs(check, points, samples)
        return test(first, second)

    return find


def _largest_rise(check: checks.RiseCheck, points: Points, samples: Samples) -> Effect:
    curves = [group for _, group in group_by_other_axes(points, check.along)]
    return criteria.largest_rise([[samples[point.key] for point in curve] for curve in curves])


def _along_axis(test: Callable[[FloatArray, Sequence[Measured]], Effect]) -> Callable[..., Effect]:
    def find(check: checks.AlongCheck, points: Points, samples: Samples) -> Effect:
        ordered = sorted(points, key=lambda point: float(point.axes[check.along]))
        x = np.array([float(point.axes[check.along]) for point in ordered])
        return test(x, [samples[point.key] for point in ordered])

    return find


def _pairs(
    check: checks.RatioCheck | checks.PairCheck, points: Points, samples: Samples
) -> list[tuple[Measured, Measured]]:
    first, second = (points_at({**check.where, **place}, points) for place in check.between)
    if len(first) != len(second):
        raise EpuckSimError(f"between {_in_text(check.between[0])} and {_in_text(check.between[1])}: no pairs")
    return [(samples[a.key], samples[b.key]) for a, b in zip(first, second, strict=True)]


def _place_exponent(check: checks.PlaceCheck, points: Points, _: Samples) -> Effect:
    groups = [group for _, group in group_by_other_axes(points, check.along)]
    places = [find_place(estimate_curve(group, check.along, {}), check.place) for group in groups]
    x = np.array([float(group[0].axes[check.over]) for group in groups])
    return place_exponent(x, places, _fewest(points))


def _collapse(check: checks.CollapseCheck, points: Points, _: Samples) -> Effect:
    drawn = []
    for _, group in group_by_other_axes(points, check.along):
        instead = estimate_curve([_reduced(point, "mean") for point in group], check.along, {})
        drawn.append(Drawn(estimate_curve([point._replace(of=None) for point in group], check.along, {}), instead))
    return collapse(drawn, _fewest(points))


def _fewest(points: Points) -> int:
    return min(len(point.times) for point in points)


EFFECTS: dict[str, Callable[..., Effect]] = {
    "level": lambda _, __, samples: criteria.level(*samples.values()),
    "share": lambda _, __, samples: criteria.share(*samples.values()),
    "ratio": lambda *given: criteria.ratio(_pairs(*given)),
    "largest_rise": _largest_rise,
    "power_exponent": _along_axis(criteria.power_exponent),
    "exponential_rate": _along_axis(criteria.exponential_rate),
    "rank_trend": _along_axis(criteria.rank_trend),
    "superiority": _of_a_pair(criteria.superiority),
    "share_difference": _of_a_pair(criteria.share_difference),
    "likelier": lambda check, _, samples: criteria.likelier(list(samples.values()), check.law, check.than),
    "weibull_ratio": lambda check, _, samples: criteria.weibull_ratio(next(iter(samples.values())), check.censored_at),
    "place_exponent": _place_exponent,
    "collapse": _collapse,
}
"""What each test finds: of a check, the points that it uses, and their samples by key."""


def _measure(point: PointTrials, check: checks.SweepCheck) -> Measured:
    if isinstance(check, checks.CollapseCheck):
        return measure_t_sync(point)
    return measure(point if check.take is None else _reduced(point, check.take))


def _reduced(point: PointTrials, take: str) -> PointTrials:
    reduced: tuple[Value, ...] = tuple(_reduce(value, take) for value in point.measured)
    return point._replace(measured=reduced)


def _reduce(value: Value, take: str) -> Value:
    """Return what stands for a series; None if it has no value."""
    known = [each for each in value if each is not None] if isinstance(value, list) else []
    return REDUCTIONS[take](known) if known else None


def _is_same(value: Any, wanted: Any) -> bool:
    return canonical_text({"value": value}) == canonical_text({"value": wanted})


def _in_text(values: checks.Values) -> str:
    return ", ".join(f"{key} = {short_repr(value)}" for key, value in values.items()) or "all points"
