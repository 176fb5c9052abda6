"""From effects to verdicts."""

import pytest
from pydantic import TypeAdapter

from epuck_sim.replication.checks import Check
from epuck_sim.replication.claims import Claim
from epuck_sim.replication.effects import Effect, student
from epuck_sim.replication.evaluation import Finding
from epuck_sim.replication.verdicts import Verdict, answer, combine, p_values

HOLDS, CONTRADICTED, UNDECIDED = Verdict.HOLDS, Verdict.CONTRADICTED, Verdict.UNDECIDED


def check(**prediction) -> Check:
    return TypeAdapter(Check).validate_python({"test": "level", **prediction})


def finding(effect: Effect, **prediction) -> Finding:
    return Finding(check(**prediction), effect, (20, 20), 0.0)


def claimed(*checks: Finding) -> tuple[Claim, list[Finding]]:
    has_trials = any(each.check.test != "formula" for each in checks)
    keys = {"id": "A1", "section": "9", "claim": "so", "says": "so", "sweep": "tiny" if has_trials else None}
    return Claim.model_validate({**keys, "checks": [each.check for each in checks]}), list(checks)


@pytest.mark.parametrize(
    ("value", "prediction", "verdict"),
    [
        (9.0, {"above": 5}, HOLDS),
        (9.0, {"below": 5}, CONTRADICTED),
        (1.0, {"above": 5}, CONTRADICTED),
        (1.0, {"below": 5}, HOLDS),
        (5.5, {"above": 5}, UNDECIDED),
        (5.5, {"below": 5}, UNDECIDED),
        (5.0, {"within": (0, 10)}, HOLDS),
        (5.0, {"within": (4.5, 5.5)}, UNDECIDED),
        (0.5, {"within": (0, 10)}, UNDECIDED),
        (9.5, {"within": (0, 10)}, UNDECIDED),
        (-5.0, {"within": (0, 10)}, CONTRADICTED),
        (15.0, {"within": (0, 10)}, CONTRADICTED),
    ],
)
def test_an_effect_decides_if_it_is_far_from_the_threshold(value, prediction, verdict) -> None:
    ((_, _, (judged,)),) = answer([claimed(finding(student(value, 1.0, 30), **prediction))])
    assert judged.verdict == verdict


def test_what_one_test_decides_many_may_not() -> None:
    alone = finding(student(2.5, 1.0, 100), above=0)
    noise = [finding(student(0.1, 1.0, 100), above=0) for _ in range(9)]
    assert answer([claimed(alone)])[0].verdict == HOLDS
    judged = answer([claimed(alone), claimed(*noise)])
    assert judged[0].verdict == UNDECIDED
    (found,) = judged[0].checks
    assert found.p_holm == pytest.approx(10 * found.p_value)
    assert found.p_value == pytest.approx(2 * p_values(alone.check, alone.effect)[0])


def test_a_formula_is_not_corrected_and_corrects_nothing() -> None:
    formula = TypeAdapter(Check).validate_python({"test": "formula", "number": "sigma_a", "above": 0})
    exact = Finding(
        formula, Effect(student(1, 0, 0).estimate, lambda x: float(x > 1), lambda x: float(x < 1)), (0, 0), 0
    )
    alone = finding(student(2.1, 1.0, 100), above=0)
    first, second = answer([claimed(exact, exact, alone), claimed(exact)])
    assert [each.verdict for each in first.checks] == [HOLDS] * 3
    assert first.checks[2].p_holm == first.checks[2].p_value
    assert second.verdict == HOLDS


@pytest.mark.parametrize(
    ("verdicts", "together"),
    [
        ([HOLDS, HOLDS], HOLDS),
        ([HOLDS, UNDECIDED], UNDECIDED),
        ([HOLDS, CONTRADICTED, UNDECIDED], CONTRADICTED),
        ([], Verdict.NOT_ASKED),
    ],
)
def test_a_claim_holds_if_all_its_tests_do(verdicts, together) -> None:
    assert combine(verdicts) == together
