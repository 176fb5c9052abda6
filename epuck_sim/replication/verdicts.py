"""From stored trials to the effect of each check of a claim, and from these to a verdict on each claim."""

import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import LEVEL, Estimate
from epuck_sim.replication import criteria
from epuck_sim.replication.claims import FORMULAS, TESTS, Check, Claim, Values
from epuck_sim.replication.criteria import Drawn, Effect
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import canonical_text, choose_axis, other_axes
from epuck_sim.scenario.points import Point
from epuck_sim.statistics.comparison import holm
from epuck_sim.statistics.curves import estimate_curve, group_by_other_axes
from epuck_sim.statistics.measured import Measured, measure, measure_t_sync
from epuck_sim.statistics.sequential import looks_p_value
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

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


AnyPoint = TypeVar("AnyPoint", Point, PointTrials)  # a point of a sweep, with or without its trials


class Finding(NamedTuple):
    """A check, and what its test found."""

    check: Check
    effect: Effect
    trials: tuple[int, int]  # fewest and most of its points; 0 of a formula
    censored: float  # largest share of its points


def run_check(check: Check, points: Sequence[PointTrials]) -> Finding:
    """Return what a test finds in its claim's sweep, with what the check takes of its trials (`taken`).

    Raises:
        EpuckSimError: The sweep lacks a point that the check names.
    """
    if check.test == "formula":
        value = FORMULAS[check.number]()
        exact = Effect(Estimate(value), lambda x: 0.0 if value > x else 1.0, lambda x: 0.0 if value < x else 1.0)
        return Finding(check, exact, (0, 0), 0.0)
    used = chosen_points(check, points)
    samples = criteria.restrict([_measure(point, check) for point in used])
    counts = [len(each.values) for each in samples]
    censored = max(each.censored for each in samples)
    by_key = {point.key: sample for point, sample in zip(used, samples, strict=True)}
    return Finding(check, EFFECTS[check.test](check, used, by_key), (min(counts), max(counts)), censored)


def chosen_points(check: Check, points: Sequence[AnyPoint]) -> list[AnyPoint]:
    """Return the points of a sweep that a check uses.

    Raises:
        EpuckSimError: There is none, or more than the test is of; or they lack a measure or an axis that it names.
    """
    test = TESTS[check.test]
    places = check.between if "between" in test.takes else ({},)
    if check.test == "ratio":
        used = [each for side in zip(*pair_points(check, points), strict=True) for each in side]
    else:
        used = [each for place in places for each in points_at({**check.where, **place}, points)]
    measured: list[str] = [measure.name for measure in used[0].scenario.measures]
    if check.of is not None and check.of not in measured:
        raise EpuckSimError(f"of: {did_you_mean(check.of, measured)}; measured: {comma_list(measured)}")
    for key in ("along", "over"):
        if key in test.takes:
            choose_axis([point.axes for point in used], getattr(check, key), key)
    if test.points not in (None, len(used)):
        of = "one at each place" if test.points == 2 else "one"
        raise EpuckSimError(f"where {_in_text(check.where)}: {len(used)} points; {check.test} is of {of}")
    return used


def points_at(values: Values, points: Sequence[AnyPoint]) -> list[AnyPoint]:
    """Return the points of a sweep that have these values of axes; raise EpuckSimError if there is none."""
    wanted = {key: canonical_text({"value": value}) for key, value in values.items()}
    found = [
        point
        for point in points
        if all(key in point.axes and canonical_text({"value": point.axes[key]}) == text for key, text in wanted.items())
    ]
    if not found:
        raise EpuckSimError(f"where {_in_text(values)}: the sweep has no such point")
    return found


def pair_points(check: Check, points: Sequence[AnyPoint]) -> list[tuple[AnyPoint, AnyPoint]]:
    """Return the points at the first place of a check that have one at the second, with it: all other axes agree."""
    sides: list[list[AnyPoint]] = [points_at({**check.where, **place}, points) for place in check.between]
    others = other_axes([point.axes for side in sides for point in side], *check.between[0], *check.between[1])
    one, other = ({canonical_text({key: point.axes[key] for key in others}): point for point in side} for side in sides)
    pairs = [(point, other[text]) for text, point in one.items() if text in other]
    if not pairs or [len(one), len(other)] != [*map(len, sides)]:
        raise EpuckSimError(f"between {_in_text(check.between[0])} and {_in_text(check.between[1])}: no pairs")
    return pairs


def _in_text(values: Values) -> str:
    return ", ".join(f"{key} = {short_repr(value)}" for key, value in values.items()) or "all points"


Points: TypeAlias = Sequence[PointTrials]
Samples: TypeAlias = dict[str, Measured]
Find: TypeAlias = Callable[[Check, Points, Samples], Effect]


def _ratio(check: Check, points: Points, samples: Samples) -> Effect:
    return criteria.ratio([(samples[a.key], samples[b.key]) for a, b in pair_points(check, points)])


def _of_each(test: Callable[..., Effect]) -> Find:
    """Return what a test of one point, or of two, finds."""
    return lambda _, points, samples: test(*(samples[point.key] for point in points))


def _largest_rise(check: Check, points: Points, samples: Samples) -> Effect:
    curves = [group for _, group in group_by_other_axes(points, check.along)]
    return criteria.largest_rise([[samples[point.key] for point in curve] for curve in curves])


def _along_axis(test: Callable[[FloatArray, Sequence[Measured]], Effect]) -> Find:
    def find(check: Check, points: Points, samples: Samples) -> Effect:
        ordered = sorted(points, key=lambda point: float(point.axes[check.along]))
        x = np.array([float(point.axes[check.along]) for point in ordered])
        return test(x, [samples[point.key] for point in ordered])

    return find


def _place_exponent(check: Check, points: Points, _: Samples) -> Effect:
    groups = [group for _, group in group_by_other_axes(points, check.along)]
    places = [criteria.find_place(estimate_curve(group, check.along, {}), check.place) for group in groups]
    x = np.array([float(group[0].axes[check.over]) for group in groups])
    return criteria.place_exponent(x, places, _fewest(points))


def _collapse(check: Check, points: Points, _: Samples) -> Effect:
    drawn = []
    for _, group in group_by_other_axes(points, check.along):
        instead = estimate_curve(group, check.along, {})
        drawn.append(Drawn(estimate_curve([point._replace(of=None) for point in group], check.along, {}), instead))
    return criteria.collapse(drawn, _fewest(points))


def _fewest(points: Points) -> int:
    return min(len(point.times) for point in points)


EFFECTS: dict[str, Find] = {
    "level": _of_each(criteria.level),
    "share": _of_each(criteria.share),
    "ratio": _ratio,
    "largest_rise": _largest_rise,
    "power_exponent": _along_axis(criteria.power_exponent),
    "exponential_rate": _along_axis(criteria.exponential_rate),
    "rank_trend": _along_axis(criteria.rank_trend),
    "superiority": _of_each(criteria.superiority),
    "share_difference": _of_each(criteria.share_difference),
    "likelier": lambda check, _, samples: criteria.likelier(list(samples.values()), check.law, check.than),
    "weibull_ratio": lambda check, _, samples: criteria.weibull_ratio(next(iter(samples.values())), check.censored_at),
    "place_exponent": _place_exponent,
    "collapse": _collapse,
}
"""What each test finds: of a check, the points that it uses, and their samples by key."""


def _measure(point: PointTrials, check: Check) -> Measured:
    return measure_t_sync(point) if check.test == "collapse" else measure(point)


def reduction(check: Check) -> str | None:
    """Return the name of what stands for the series that a check takes; None if it takes values as they are."""
    return "mean" if check.test == "collapse" else check.take


def taken(check: Check, points: Sequence[PointTrials]) -> list[PointTrials]:
    """Return points with what a check takes of their measured values."""
    name = reduction(check)
    return [point if name is None else reduced(point, name) for point in points]


def reduced(point: PointTrials, take: str) -> PointTrials:
    """Return a point with what stands for its series in their place; None for those without a value."""
    series = (value if isinstance(value, list) else [] for value in point.measured)
    known = ([each for each in values if each is not None] for values in series)
    return point._replace(measured=tuple(REDUCTIONS[take](values) if values else None for values in known))


class Verdict(StrEnum):
    """What is found of a claim, or of one of its checks."""

    HOLDS = "holds"
    CONTRADICTED = "contradicted"
    UNDECIDED = "undecided"
    NOT_ASKED = "not asked"
    IDENTITY = "identity"
    READING = "reading"
    NO_CLAIM = "no claim"


class Judged(NamedTuple):
    """A check with its verdict."""

    tested: Finding
    p_value: float  # of data that decide as clearly for either side, if the truth were exactly at the threshold
    p_holm: float  # the same, corrected for the number of looks, and of checks on the page
    verdict: Verdict


class Answer(NamedTuple):
    """A claim with its verdict, and those of its checks."""

    claim: Claim
    verdict: Verdict
    checks: tuple[Judged, ...]


def judge_claims(asked: Sequence[tuple[Claim, Sequence[Finding]]], looks: int = 1) -> list[Answer]:
    """Return the verdicts of all claims of a page, whose checks are corrected together by Holm's method.

    Each check is one of so many looks at it, while trials are added. A claim holds if all its checks do, and is
    contradicted if any is.
    """
    tested = [each for _, checks in asked for each in checks if each.check.test != "formula"]
    p_once = [two_sided(*p_values(each.check, each.effect)) for each in tested]
    corrected = iter(holm([looks_p_value(each, looks) for each in p_once]))
    answers = []
    for claim, checks in asked:
        judged = tuple(_judge(each, None if each.check.test == "formula" else next(corrected)) for each in checks)
        answers.append(Answer(claim, decide(claim, [each.verdict for each in judged]), judged))
    return answers


def decide(claim: Claim, verdicts: Sequence[Verdict]) -> Verdict:
    """Return the verdict of a claim from those of its checks; none if they are not asked."""
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
    if high is None and low is not None:
        return effect.p_above(low), effect.p_below(low)
    if low is None and high is not None:
        return effect.p_below(high), effect.p_above(high)
    assert low is not None
    assert high is not None
    # inside only if on the right side of both; outside if beyond either, of which one alone can be
    return max(effect.p_above(low), effect.p_below(high)), min(1.0, 2 * min(effect.p_below(low), effect.p_above(high)))


def two_sided(one: float, other: float) -> float:
    """Return the p-value of a decision that may go either way."""
    return min(1.0, 2 * min(one, other))


def _judge(tested: Finding, p_holm: float | None) -> Judged:
    """Return the verdict of a check; a formula needs no correction."""
    for_it, against = p_values(tested.check, tested.effect)
    p_value = two_sided(for_it, against)
    corrected = p_value if p_holm is None else p_holm
    if corrected >= 1 - LEVEL:
        return Judged(tested, p_value, corrected, Verdict.UNDECIDED)
    return Judged(tested, p_value, corrected, Verdict.HOLDS if for_it < against else Verdict.CONTRADICTED)
