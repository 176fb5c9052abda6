"""From trials to effects, and from effects to verdicts; and the claims that are shipped, with their tables."""

import math
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from docs.trials import DOCS, PAGE, TABLES, Tables, write_page
from epuck_sim.errors import EpuckSimError
from epuck_sim.order_parameter import order_parameter, reference_order_parameter
from epuck_sim.replication import verdicts
from epuck_sim.replication.claims import FORMULAS, Check, Claim, read_claims
from epuck_sim.replication.criteria import Effect, student
from epuck_sim.replication.page import describe_check
from epuck_sim.replication.sweeps import check_claim, needed_sweeps, sweep_scenario
from epuck_sim.replication.verdicts import Finding, Verdict, decide, growth, judge_claims, run_check, taken
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.loader import Point, points
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.sweep.demand import check_sweep
from epuck_sim.trial.model import run_trial, simulate
from tests.runs.made_folders import COUNT, COUPLING, SPEED, ended, in_memory, rows, sweep

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


def test_points_of_a_ratio_are_compared_up_to_their_lowest_limit_and_paired_by_their_other_axes() -> None:
    """Not by their order; and those without another do not count."""
    limit = "stop.max_cycles"
    trials = {100: ended([10, 20, 30, 40, 100], [True] * 4 + [False]), 1000: ended([10, 20, 30, 40, 900])}
    points = in_memory(sweep({limit: [100, 1000]}, trials=5), lambda point: trials[point.axes[limit]])
    ratio = Check.model_validate({"test": "ratio", "between": [{limit: 100}, {limit: 1000}], "above": 1})
    assert run_check(ratio, points).effect.estimate.value == pytest.approx(1)
    rows = [(0.1, 1, 3), (0.1, 10, 3), (0.1, 7, 3), (0.2, 10, 5), (0.2, 1, 5)]
    listed = [dict(zip((COUPLING, SPEED, COUNT), row, strict=True)) for row in rows]  # the count is tied to the first
    times = {1: [10, 20, 30, 40, 50], 10: [1, 2, 3, 4, 5], 7: [60] * 5}
    points = in_memory(sweep(sweep={"points": listed}, trials=5), lambda point: ended(times[point.axes[SPEED]]))
    ratio = Check.model_validate({"test": "ratio", "between": [{COUPLING: 0.1}, {COUPLING: 0.2}], "above": 1})
    assert [tuple(p.number for p in pair) for pair in verdicts.pair_points(ratio, points)] == [(0, 4), (1, 3)]
    assert run_check(ratio, points).effect.estimate.value == pytest.approx(1)


def test_what_a_check_takes_is_of_series_and_no_threshold_stands_for_one_that_was_not_reached() -> None:
    (point,) = in_memory(sweep({SPEED: [1]}, trials=2), lambda _: ended([1, 2]))
    series, numbers = (point._replace(measured=values) for values in (([0.5, 1.0], [2.0]), (0.5, None)))
    assert taken(check(of="x", take="largest", above=1), [series])[0].measured == (1.0, 2.0)
    assert taken(check(of="x", take="growth", above=1), [series])[0].measured == (None, None)
    for keys, has, said in [({}, series, "x is a series"), ({"take": "final"}, numbers, "x is no series")]:
        with pytest.raises(EpuckSimError, match=said):
            taken(check(of="x", above=1, **keys), [has])
    scenario = sweep({SPEED: [1]}, trials=2, measures=["threshold_cycles"])
    (point,) = in_memory(scenario, lambda _: ended([1, 2]))
    thresholds = point._replace(of="threshold_cycles", measured=([3, 5], [4, None]))
    for take, values in (("first", (3, 4)), ("final", (5, None)), ("largest", (5, None))):
        assert taken(check(of="threshold_cycles", take=take, above=1), [thresholds])[0].measured == values


def test_what_one_test_decides_many_may_not_but_a_formula_is_not_corrected_and_corrects_nothing() -> None:
    alone = finding(student(2.5, 1.0, 100), above=0)
    noise = [finding(student(0.1, 1.0, 100), above=0) for _ in range(9)]
    assert judge_claims([claimed(alone)])[0].verdict == HOLDS
    judged = judge_claims([claimed(alone), claimed(*noise)])
    assert judged[0].verdict == UNDECIDED
    (found,) = judged[0].checks
    assert found.p_holm == pytest.approx(10 * found.p_value)
    assert found.p_value == pytest.approx(2 * verdicts.p_values(alone.check, alone.effect)[0])
    formula = Check.model_validate({"test": "formula", "number": "sigma_a", "above": 0})
    effect = Effect(student(1, 0, 0).estimate, lambda x: float(x > 1), lambda x: float(x < 1))
    exact = Finding(formula, effect, (0, 0), 0)
    alone = finding(student(2.1, 1.0, 100), above=0)
    first, second = judge_claims([claimed(exact, exact, alone), claimed(exact)])
    assert [each.verdict for each in first.checks] == [HOLDS] * 3
    assert first.checks[2].p_holm == first.checks[2].p_value
    assert second.verdict == HOLDS


def test_a_claim_holds_if_all_its_tests_do_or_needs_no_trials_and_an_identity_that_fails_is_contradicted() -> None:
    claim, _ = claimed(finding(student(1, 1, 9), above=0))
    assert decide(claim, [HOLDS, HOLDS]) == HOLDS
    assert decide(claim, [HOLDS, UNDECIDED]) == UNDECIDED
    assert decide(claim, [HOLDS, CONTRADICTED, UNDECIDED]) == CONTRADICTED
    assert decide(claim, []) == Verdict.NOT_ASKED
    for verdict in (Verdict.IDENTITY, Verdict.NO_CLAIM, Verdict.NOT_ASKED):
        reason = {verdict.replace(" ", "_"): "why"}
        claim = Claim.model_validate({"id": "A1", "section": "9", "claim": "so", **reason})
        assert judge_claims([(claim, [])])[0].verdict == verdict
    for above, verdict in ((1, CONTRADICTED), (0, Verdict.IDENTITY)):  # it then is the program that is wrong
        formula = Check.model_validate({"test": "formula", "number": "sigma_a", "above": above})
        assert judge_claims([claimed(run_check(formula, []), identity="why")])[0].verdict == verdict


CYCLES = np.arange(300)


@given(st.floats(-0.02, 0.04))
def test_the_rate_of_an_exponential_is_found_but_no_factor_that_comes_once_nor_what_comes_when_large(rate) -> None:
    assert growth(1e-9 * np.exp(rate * CYCLES)) == pytest.approx(rate, abs=1e-9)
    assert growth(1e-9 * np.minimum(1 + 0.1 * CYCLES, 1.5)) == pytest.approx(0, abs=1e-12)
    assert growth(1e-9 * np.where(CYCLES < 5, 1, 1.5)) == pytest.approx(0, abs=1e-12)
    growing = np.minimum(1e-9 * np.exp(0.07 * CYCLES), 0.3)
    assert growing[-1] > verdicts.LARGEST
    assert growth(growing) == pytest.approx(0.07, rel=0.02)
    assert growth(np.where(CYCLES < 40, 1e-9, 0)) < -0.05  # one that vanishes shrinks
    assert growth(1e-9 * np.exp(-0.5 * CYCLES)) == pytest.approx(-0.5, rel=0.05)


CLAIMS = read_claims()


@cache
def swept() -> dict[str, tuple[Point, ...]]:
    return {name: points(sweep_scenario(CLAIMS, name)) for name in CLAIMS.sweeps}


def test_every_test_finds_its_points_in_a_sweep_that_can_be_run_and_keys_may_leave_out_that_of_a_scenario() -> None:
    asked = {"scenario": "two-nearest", "keys": {"sweep": None}}
    claim = {"id": "A", "section": "9", "claim": "so", "no_claim": "-"}
    claims = CLAIMS.model_validate({"sweeps": {"one": asked}, "claims": [claim]})
    assert len(points(sweep_scenario(claims, "one"))) == 1
    none = np.array([]), np.array([], bool), ()
    found = {name: [PointTrials(*point[:4], *none) for point in of_sweep] for name, of_sweep in swept().items()}
    assert found.keys() == {claim.sweep for claim in CLAIMS.claims if claim.checks and claim.sweep}
    for each in swept().values():
        check_sweep(each)
    for claim in CLAIMS.claims:
        for check in claim.checks:
            if check.test != "formula":
                stored = [point._replace(of=check.of) for point in found[claim.sweep]]
                assert math.isnan(run_check(check, stored).effect.estimate.low), claim.id


def test_all_claims_are_short_sentences_of_the_text_in_order_and_what_trials_cannot_decide_is_named() -> None:
    lines: dict[str, set[int]] = {}
    for claim in CLAIMS.claims:
        if claim.id == "R14":  # which no sentence says
            assert claim.no_claim
            continue
        assert 10 <= len(claim.quote) <= 260, claim.id
        assert claim.quote == " ".join(claim.quote.split()), claim.id
        assert claim.line is not None
        lines.setdefault(claim.section, set()).add(claim.line)
        assert claim.quantifier or claim.no_claim, claim.id
        assert "et al." not in claim.quote or claim.source, claim.id
    at = {section: (min(found), max(found)) for section, found in lines.items()}
    ordered = sorted(at, key=lambda section: [(not part.isdigit(), part.zfill(3)) for part in section.split(".")])
    assert all(at[one][1] <= at[other][0] for one, other in pairwise(ordered))
    assert [claim.id for claim in CLAIMS.claims] == [f"R{number}" for number in range(1, 77)]
    assert sum(bool(claim.checks) for claim in CLAIMS.claims) >= 58
    by_kind = {kind: {c.id for c in CLAIMS.claims if getattr(c, kind)} for kind in ("identity", "no_claim", "reading")}
    assert by_kind["identity"] == {"R6", "R8", "R32", "R37", "R64"}
    assert by_kind["no_claim"] == {"R14", "R28", "R34", "R71"}
    assert by_kind["reading"] == {"R29", "R35", "R45", "R46", "R50", "R52", "R54", "R55", "R57", "R63"}
    for claim in CLAIMS.claims:
        for check in claim.checks:
            if check.test == "largest_rise" and claim.id not in ("R3", "R61"):  # of which another number is asked
                assert check.rises is not None, claim.id
            if check.test == "ratio":
                assert all(each > 0 for each in check.predicted if each is not None)


def test_sweeps_have_a_seed_that_no_earlier_page_and_no_figure_had() -> None:
    seeds = {name: first.scenario.seed for name, (first, *_) in swept().items()}
    others = {name: seed for name, seed in seeds.items() if seed != CLAIMS.seed}
    assert others == {"recipe": 25, "short-cones": 25}
    assert not {CLAIMS.seed, *others.values()} & {0, 1, 19, 20, 21, 22, 23}
    assert f"one seed, {CLAIMS.seed}, but recipe and short-cones 25" in CLAIMS.pooled


def test_two_groups_that_look_at_opposite_walls_never_synchronise_with_300_degrees() -> None:
    """The swarm with which R43 is asked; with 360 degrees it does."""
    _, blind = swept()["static-cones"]
    assert isinstance(blind.scenario, ParticleScenario)
    for angle, is_observed in ((300, False), (360, True)):
        cone = blind.scenario.neighbourhood.model_copy(update={"angle_deg": angle})
        scenario = blind.scenario.model_copy(update={"neighbourhood": cone})
        assert {run_trial(simulate(scenario, seed)).censored for seed in range(2)} == {not is_observed}


def test_numbers_that_follow_from_equations_fulfil_these() -> None:
    largest_shift, order_zero, sigma_a, sigma_b = FORMULAS.values()
    one_of_twenty = np.array([0.0] * 19 + [largest_shift])
    assert reference_order_parameter(one_of_twenty, 1.0) == pytest.approx(0.95)
    for phase, is_lowered in ((order_zero - 0.01, True), (order_zero + 0.01, False)):  # by a pulse
        before, after = (order_parameter(np.array([0, each]), 1.0) for each in (phase, 1.1 * phase))
        assert (after < before) == is_lowered
    assert order_parameter(np.repeat([-sigma_a, sigma_a], 5), 5.0) == pytest.approx(0.95)
    robots = 10
    assert sigma_b == pytest.approx(math.sqrt(2 / (5 * robots) * robots / 2 * (4**2 + 3**2 + 2**2 + 1**2)))


# read in each run of the tests
SMALL = sorted(file.name.removesuffix(".csv.gz") for file in TABLES.glob("*.gz") if file.stat().st_size < 20_000)


@pytest.mark.parametrize("sweep", SMALL)
def test_a_table_gives_the_effects_of_its_claims(sweep: str) -> None:
    tables = Tables({sweep: sweep_scenario(CLAIMS, sweep)})
    found = {
        (claim.id, describe_check(finding.check)): finding.effect.estimate.value
        for claim in CLAIMS.claims
        if claim.sweep == sweep
        for finding in check_claim(claim, tables)
        if finding.check.test != "formula"
    }
    table = rows(DOCS / "replication-tests.csv")
    written = {(row["claim"], row["test"]): float(row["ours"] or "nan") for row in table}
    assert found
    assert found == pytest.approx({key: written[key] for key in found}, rel=1e-3, nan_ok=True)


@pytest.mark.slow
def test_the_tables_give_the_page_to_the_byte(tmp_path: Path) -> None:
    write_page(CLAIMS, needed_sweeps(CLAIMS, CLAIMS.claims), tmp_path)
    for file in PAGE:
        assert (tmp_path / file.name).read_text(encoding="utf-8") == file.read_text(encoding="utf-8")
