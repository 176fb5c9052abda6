"""From trials to effects, and from effects to verdicts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.replication.claims import Check, Claim
from epuck_sim.replication.criteria import Effect, student
from epuck_sim.replication.verdicts import (
    LARGEST,
    Finding,
    Verdict,
    decide,
    growth,
    judge_claims,
    p_values,
    pair_points,
    run_check,
)
from tests.runs.made_folders import COUNT, COUPLING, SPEED, ended, in_memory, sweep

HOLDS, CONTRADICTED, UNDECIDED = Verdict.HOLDS, Verdict.CONTRADICTED, Verdict.UNDECIDED


def check(**prediction) -> Check:
    return Check.model_validate({"test": "level", **prediction})


def finding(effect: Effect, **prediction) -> Finding:
    return Finding(check(**prediction), effect, (20, 20), 0.0)


def claimed(*checks: Finding, **more: str) -> tuple[Claim, list[Finding]]:
    has_trials = any(each.check.test != "formula" for each in checks)
    keys = {"id": "A1", "section": "9", "claim": "so", "sweep": "tiny" if has_trials else None}
    return Claim.model_validate({**keys, **more, "checks": [each.check for each in checks]}), list(checks)


def test_an_effect_decides_if_it_is_far_from_the_threshold() -> None:
    for value, prediction, verdict in [
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
    ]:
        found = finding(student(value, 1.0, 30), **prediction)
        (_, _, (judged,)), reading = judge_claims([claimed(found)])[0], judge_claims([claimed(found, reading="5")])[0]
        assert judged.verdict == verdict
        assert reading.verdict == (UNDECIDED if verdict == UNDECIDED else Verdict.READING)  # of a threshold of ours


def test_points_are_compared_up_to_the_lowest_of_their_limits() -> None:
    limit = "stop.max_cycles"
    trials = {100: ended([10, 20, 30, 40, 100], [True] * 4 + [False]), 1000: ended([10, 20, 30, 40, 900])}
    points = in_memory(sweep({limit: [100, 1000]}, trials=5), lambda point: trials[point.axes[limit]])
    ratio = Check.model_validate({"test": "ratio", "between": [{limit: 100}, {limit: 1000}], "above": 1})
    assert run_check(ratio, points).effect.estimate.value == pytest.approx(1)


def test_points_of_a_ratio_are_paired_by_their_other_axes() -> None:
    """Not by their order; and those without another do not count."""
    rows = [(0.1, 1, 3), (0.1, 10, 3), (0.1, 7, 3), (0.2, 10, 5), (0.2, 1, 5)]
    listed = [
        dict(zip((COUPLING, SPEED, COUNT), row, strict=True)) for row in rows
    ]  # the count is tied to the coupling
    times = {1: [10, 20, 30, 40, 50], 10: [1, 2, 3, 4, 5], 7: [60] * 5}
    points = in_memory(sweep(sweep={"points": listed}, trials=5), lambda point: ended(times[point.axes[SPEED]]))
    ratio = Check.model_validate({"test": "ratio", "between": [{COUPLING: 0.1}, {COUPLING: 0.2}], "above": 1})
    assert [tuple(p.number for p in pair) for pair in pair_points(ratio, points)] == [(0, 4), (1, 3)]
    assert run_check(ratio, points).effect.estimate.value == pytest.approx(1)


def test_what_one_test_decides_many_may_not() -> None:
    alone = finding(student(2.5, 1.0, 100), above=0)
    noise = [finding(student(0.1, 1.0, 100), above=0) for _ in range(9)]
    assert judge_claims([claimed(alone)])[0].verdict == HOLDS
    judged = judge_claims([claimed(alone), claimed(*noise)])
    assert judged[0].verdict == UNDECIDED
    (found,) = judged[0].checks
    assert found.p_holm == pytest.approx(10 * found.p_value)
    assert found.p_value == pytest.approx(2 * p_values(alone.check, alone.effect)[0])


def test_a_formula_is_not_corrected_and_corrects_nothing() -> None:
    formula = Check.model_validate({"test": "formula", "number": "sigma_a", "above": 0})
    exact = Finding(
        formula, Effect(student(1, 0, 0).estimate, lambda x: float(x > 1), lambda x: float(x < 1)), (0, 0), 0
    )
    alone = finding(student(2.1, 1.0, 100), above=0)
    first, second = judge_claims([claimed(exact, exact, alone), claimed(exact)])
    assert [each.verdict for each in first.checks] == [HOLDS] * 3
    assert first.checks[2].p_holm == first.checks[2].p_value
    assert second.verdict == HOLDS


def test_a_claim_holds_if_all_its_tests_do() -> None:
    claim, _ = claimed(finding(student(1, 1, 9), above=0))
    assert decide(claim, [HOLDS, HOLDS]) == HOLDS
    assert decide(claim, [HOLDS, UNDECIDED]) == UNDECIDED
    assert decide(claim, [HOLDS, CONTRADICTED, UNDECIDED]) == CONTRADICTED
    assert decide(claim, []) == Verdict.NOT_ASKED


def test_what_needs_no_trials_says_so_and_an_identity_that_fails_is_contradicted() -> None:
    for verdict in (Verdict.IDENTITY, Verdict.NO_CLAIM, Verdict.NOT_ASKED):
        reason = {verdict.replace(" ", "_"): "why"}
        claim = Claim.model_validate({"id": "A1", "section": "9", "claim": "so", **reason})
        assert judge_claims([(claim, [])])[0].verdict == verdict
    for above, verdict in ((1, CONTRADICTED), (0, Verdict.IDENTITY)):  # it then is the program that is wrong
        formula = Check.model_validate({"test": "formula", "number": "sigma_a", "above": above})
        assert judge_claims([claimed(run_check(formula, []), identity="why")])[0].verdict == verdict


# Growth of a small perturbation, on series that are made up


CYCLES = np.arange(300)


@given(st.floats(-0.02, 0.04))
def test_the_rate_of_an_exponential_is_found_but_no_factor_that_comes_once_nor_what_comes_when_large(rate) -> None:
    assert growth(1e-9 * np.exp(rate * CYCLES)) == pytest.approx(rate, abs=1e-9)
    assert growth(1e-9 * np.minimum(1 + 0.1 * CYCLES, 1.5)) == pytest.approx(0, abs=1e-12)
    assert growth(1e-9 * np.where(CYCLES < 5, 1, 1.5)) == pytest.approx(0, abs=1e-12)
    growing = np.minimum(1e-9 * np.exp(0.07 * CYCLES), 0.3)
    assert growing[-1] > LARGEST
    assert growth(growing) == pytest.approx(0.07, rel=0.02)

    assert growth(np.where(CYCLES < 40, 1e-9, 0)) < -0.05  # one that vanishes shrinks
    assert growth(1e-9 * np.exp(-0.5 * CYCLES)) == pytest.approx(-0.5, rel=0.05)
