"""From stored trials to the effect of each check of a claim, and from these to a verdict on each claim."""

import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import LEVEL, Estimate
from epuck_sim.measures.measure import Value
from epuck_sim.replication import criteria
from epuck_sim.replication.claims import FORMULAS, TESTS, Check, Claim, Values
from epuck_sim.replication.criteria import Effect
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import canonical_text, choose_axis, other_axes
from epuck_sim.scenario.loader import Point, describe_axes
from epuck_sim.statistics.comparison import holm
from epuck_sim.statistics.curves import estimate_curve, group_by_other_axes, has_series
from epuck_sim.statistics.sequential import looks_p_value
from epuck_sim.statistics.statistic import Measured, measure, measure_of, measure_t_sync, restrict
from epuck_sim.util.messages import comma_list, did_you_mean

SMALLEST, LARGEST = 1e-12, 1e-3
"""Deviations, in cycles, between which growth is judged: above rounding, and far below where it must end."""


def growth(deviations: Sequence[float]) -> float:
    """Return the growth rate of a deviation, per cycle, by least squares of its logarithm.

    The series ends where it first leaves the range from `SMALLEST` to `LARGEST`, or at the last cycle, and only its
    second half counts: a factor that the first cycles bring, once, is no growth.
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
"""Reductions of a series to one number."""

LOGARITHMIC = {"power_exponent": "along", "place_exponent": "over", "collapse": "along"}  # axes taken in logarithms

AnyPoint = TypeVar("AnyPoint", Point, PointTrials)  # a point of a sweep, with or without its trials


class Verdict(StrEnum):
    """Verdict on a claim, or on one of its checks."""

    HOLDS = "holds"
    CONTRADICTED = "contradicted"
    UNDECIDED = "undecided"
    NOT_ASKED = "not asked"
    IDENTITY = "identity"
    READING = "reading"
    NO_CLAIM = "no claim"


class Finding(NamedTuple):
    """A check, the effect that its test found, and its verdict after correction for all others of a page."""

    check: Check
    effect: Effect
    trials: tuple[int, int]  # fewest and most trials of its points; 0 for a formula
    censored: float  # largest censored share of its points
    p_value: float = math.nan  # probability of data as clear, for either side, if the truth were at the threshold
    p_holm: float = math.nan  # the same, corrected for the number of looks, and of checks on the page
    verdict: Verdict = Verdict.UNDECIDED


def run_check(check: Check, points: Sequence[PointTrials]) -> Finding:
    """Run a check's test on the trials that it takes of its claim's sweep; raise as `chosen_points` does."""
    if check.test == "formula":
        value = FORMULAS[check.number]
        exact = Effect(Estimate(value), lambda x: 0.0 if value > x else 1.0, lambda x: 0.0 if value < x else 1.0)
        return Finding(check, exact, (0, 0), 0.0)
    used = chosen_points(check, points)
    samples = restrict([measure_t_sync(point) if check.test == "collapse" else measure(point) for point in used])
    counts = [len(each.values) for each in samples]
    censored = max(each.censored for each in samples)
    return Finding(check, EFFECTS[check.test](check, used, samples), (min(counts), max(counts)), censored)


def chosen_points(check: Check, points: Sequence[AnyPoint]) -> list[AnyPoint]:
    """Return the points of a sweep that a check uses; raise EpuckSimError if points, a measure or axis is missing."""
    test = TESTS[check.test]
    if check.test == "ratio":
        used = [each for pair in pair_points(check, points) for each in pair]
    else:
        places = check.between if "between" in test.takes else ({},)
        used = [each for place in places for each in points_at({**check.where, **place}, points)]
    measured: list[str] = [measure.name for measure in used[0].scenario.measures]
    if check.of is not None and check.of not in measured:
        raise EpuckSimError(f"of: {did_you_mean(check.of, measured)}; measured: {comma_list(measured)}")
    for key in ("along", "over"):
        if key in test.takes:
            axis = choose_axis([point.axes for point in used], getattr(check, key), key)
            if len({point.axes[axis] for point in used}) == 1:
                raise EpuckSimError(f"{key}: {axis} is {used[0].axes[axis]} at all points; {check.test} needs several")
            if LOGARITHMIC.get(check.test) == key and min(float(point.axes[axis]) for point in used) <= 0:
                raise EpuckSimError(f"{key}: {axis} is 0 or less at a point; {check.test} takes values above 0")
    if test.points not in (None, len(used)):
        of = "one at each place" if test.points == 2 else "one"
        where = describe_axes(check.where) or "all points"
        raise EpuckSimError(f"where {where}: {len(used)} points; {check.test} needs {of}")
    return used


def points_at(values: Values, points: Sequence[AnyPoint]) -> list[AnyPoint]:
    """Return the points of a sweep that have these values of axes; raise EpuckSimError if there is none."""
    wanted, keys = canonical_text(values), values.keys()
    having = [point for point in points if keys <= point.axes.keys()]
    found = [point for point in having if canonical_text({key: point.axes[key] for key in keys}) == wanted]
    if not found:
        raise EpuckSimError(f"where {describe_axes(values)}: no such point; axes: {comma_list(points[0].axes)}")
    return found


def pair_points(check: Check, points: Sequence[AnyPoint]) -> list[tuple[AnyPoint, AnyPoint]]:
    """Return pairs of points, at the first and at the second place of a check, that agree in all other axes."""
    sides: list[list[AnyPoint]] = [points_at({**check.where, **place}, points) for place in check.between]
    others = other_axes([point.axes for side in sides for point in side], *check.between[0], *check.between[1])
    one, other = ({canonical_text({key: point.axes[key] for key in others}): point for point in side} for side in sides)
    pairs = [(point, other[text]) for text, point in one.items() if text in other]
    if not pairs or [len(one), len(other)] != [*map(len, sides)]:
        first, second = (describe_axes(place) or "all points" for place in check.between)
        raise EpuckSimError(f"between {first} and {second}: no pairs")
    return pairs


Points: TypeAlias = Sequence[PointTrials]
Samples: TypeAlias = Sequence[Measured]


def _largest_rise(check: Check, points: Points, samples: Samples) -> Effect:
    by_key = {point.key: sample for point, sample in zip(points, samples, strict=True)}
    groups = group_by_other_axes(points, check.along)
    return criteria.largest_rise([[by_key[point.key] for point in curve] for _, curve in groups])


def _along(check: Check, points: Points) -> FloatArray:
    return np.array([float(point.axes[check.along]) for point in points])


def _place_exponent(check: Check, points: Points, _: Samples) -> Effect:
    groups = [group for _, group in group_by_other_axes(points, check.along)]
    places = [criteria.find_place(estimate_curve(group, check.along, {}), check.place) for group in groups]
    x = np.array([float(group[0].axes[check.over]) for group in groups])
    return criteria.place_exponent(x, places, min(len(point.times) for point in points))


def _collapse(check: Check, points: Points, samples: Samples) -> Effect:
    drawn = []
    for _, group in group_by_other_axes(points, check.along):
        of_t_sync = [point._replace(of=None) for point in group]
        drawn.append((estimate_curve(of_t_sync, check.along, {}), estimate_curve(group, check.along, {})))
    return criteria.collapse(drawn, min(len(each.values) for each in samples))


EFFECTS: dict[str, Callable[[Check, Points, Samples], Effect]] = {
    "level": lambda _, __, samples: criteria.level(*samples),
    "share": lambda _, __, samples: criteria.share(*samples),
    "ratio": lambda _, __, samples: criteria.ratio([*zip(samples[::2], samples[1::2], strict=True)]),
    "largest_rise": _largest_rise,
    "power_exponent": lambda check, points, samples: criteria.slope(np.log(_along(check, points)), samples),
    "exponential_rate": lambda check, points, samples: criteria.slope(_along(check, points), samples),
    "rank_trend": lambda check, points, samples: criteria.rank_trend(_along(check, points), samples),
    "superiority": lambda _, __, samples: criteria.superiority(*samples),
    "share_difference": lambda _, __, samples: criteria.share_difference(*samples),
    "likelier": lambda check, _, samples: criteria.likelier(samples, check.law, check.than),
    "weibull_ratio": lambda check, _, samples: criteria.weibull_ratio(samples[0], check.censored_at),
    "place_exponent": _place_exponent,
    "collapse": _collapse,
}
"""Tests by name: functions of a check, the points that it uses, and their samples."""


def reduction(check: Check) -> str | None:
    """Return the name of the reduction of a series that a check takes; None if it takes values as they are."""
    return "mean" if check.test == "collapse" else check.take


def taken(check: Check, points: Sequence[PointTrials]) -> list[PointTrials]:
    """Return points with the values that a check takes; a series is reduced to one number, None if it has no value."""
    name = reduction(check)
    is_series = any(map(has_series, points))
    if name is None:
        if is_series:
            raise EpuckSimError(f"{check.of} is a series, with a value for each cycle; give take, such as take: final")
        return list(points)
    if check.take and not is_series and any(value is not None for point in points for value in point.measured):
        raise EpuckSimError(f"take is {check.take!r}, and {check.of} is no series; leave it out")

    known_as = measure_of(points[0]) if points else None
    over_cycles = known_as is None or known_as.over == "cycle"

    def reduced(series: Value) -> float | None:
        given = series if isinstance(series, list) else []
        if not over_cycles and name in ("first", "final"):
            given = given[:1] if name == "first" else given[-1:]
        known = [each for each in given if each is not None]
        if not known or (not over_cycles and len(known) < len(given)):  # no threshold stands for another one
            return None
        value = REDUCTIONS[name](known)
        return None if math.isnan(value) else value

    return [point._replace(measured=tuple(map(reduced, point.measured))) for point in points]


class Answer(NamedTuple):
    """A claim with its verdict, and those of its checks."""

    claim: Claim
    verdict: Verdict
    checks: tuple[Finding, ...]


def judge_claims(asked: Sequence[tuple[Claim, Sequence[Finding]]], looks: int = 1) -> list[Answer]:
    """Return the verdicts of all claims of a page, whose checks are corrected together by Holm's method.

    Each check is also corrected for `looks` looks at it, while trials are added. A claim holds if all its checks do,
    and is contradicted if any is.
    """
    tested = [each for _, checks in asked for each in checks if each.check.test != "formula"]
    corrected = iter(holm([looks_p_value(_judge(each, None).p_value, looks) for each in tested]))
    answers = []
    for claim, checks in asked:
        judged = tuple(_judge(each, None if each.check.test == "formula" else next(corrected)) for each in checks)
        answers.append(Answer(claim, decide(claim, [each.verdict for each in judged]), judged))
    return answers


def decide(claim: Claim, verdicts: Sequence[Verdict]) -> Verdict:
    """Return the verdict of a claim from those of its checks, if it has any."""
    if claim.no_claim:
        return Verdict.NO_CLAIM
    if claim.identity and set(verdicts) <= {Verdict.HOLDS}:
        return Verdict.IDENTITY
    if not verdicts:
        return Verdict.NOT_ASKED
    is_refuted, is_shown = Verdict.CONTRADICTED in verdicts, set(verdicts) == {Verdict.HOLDS}
    if not (is_refuted or is_shown):
        return Verdict.UNDECIDED
    if claim.reading:
        return Verdict.READING
    return Verdict.CONTRADICTED if is_refuted else Verdict.HOLDS


def p_values(check: Check, effect: Effect) -> tuple[float, float]:
    """Return the p-values for what a check predicts, and for its contrary."""
    low, high = check.predicted
    sides = [] if low is None else [(effect.p_above(low), effect.p_below(low))]
    sides += [] if high is None else [(effect.p_below(high), effect.p_above(high))]
    inside, outside = zip(*sides, strict=True)
    # inside only if on the right side of both; outside if beyond either, of which one alone can be
    return max(inside), min(1.0, len(sides) * min(outside))


def _judge(tested: Finding, p_holm: float | None) -> Finding:
    """Return the verdict of a check; a formula needs no correction."""
    for_it, against = p_values(tested.check, tested.effect)
    p_value = min(1.0, 2 * min(for_it, against))  # of a decision that may go either way
    corrected = p_value if p_holm is None else p_holm
    decided = Verdict.HOLDS if for_it < against else Verdict.CONTRADICTED
    verdict = decided if corrected < 1 - LEVEL else Verdict.UNDECIDED
    return tested._replace(p_value=p_value, p_holm=corrected, verdict=verdict)
