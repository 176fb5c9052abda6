"""Verdicts: from the effects of all checks of a page to what they say of each claim."""

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

from epuck_sim.estimate import LEVEL
from epuck_sim.replication.checks import Check, FormulaCheck
from epuck_sim.replication.claims import Claim
from epuck_sim.replication.effects import Effect
from epuck_sim.replication.evaluation import Finding
from epuck_sim.statistics.comparison import holm


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
    p_value: float
    """Probability, if the truth were exactly at the threshold, of data that decide as clearly for either side."""
    p_holm: float
    """The same, corrected for the number of checks on the page."""
    verdict: Verdict


class Answer(NamedTuple):
    """A claim with its verdict, and those of its checks."""

    claim: Claim
    verdict: Verdict
    checks: tuple[Judged, ...]


def answer(asked: Sequence[tuple[Claim, Sequence[Finding]]]) -> list[Answer]:
    """Return the verdicts of all claims of a page, whose checks are corrected together by Holm's method.

    A claim holds if all its checks do, and is contradicted if any is.
    """
    tested = [each for _, checks in asked for each in checks if not isinstance(each.check, FormulaCheck)]
    corrected = iter(holm([two_sided(*p_values(each.check, each.effect)) for each in tested]))
    answers = []
    for claim, checks in asked:
        judged = tuple(
            _judge(each, None if isinstance(each.check, FormulaCheck) else next(corrected)) for each in checks
        )
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
