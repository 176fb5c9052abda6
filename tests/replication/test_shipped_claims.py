"""The claims that are shipped can be asked: their sweeps are scenarios, and hold the points of their tests."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from epuck_sim.order_parameter import order_parameter, reference_order_parameter
from epuck_sim.replication.claims import largest_shift, order_zero, read_claims, sigma_a, sigma_b
from epuck_sim.replication.sweeps import sweep_scenario
from epuck_sim.replication.verdicts import run_check
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.points import Point, points
from epuck_sim.sweep.checks import check_sweep
from epuck_sim.trial.model import run_trial, simulate

CLAIMS = read_claims()


@cache
def swept() -> dict[str, tuple[Point, ...]]:
    return {name: points(sweep_scenario(CLAIMS, name)) for name in CLAIMS.sweeps}


def test_every_test_finds_its_points_in_a_sweep_that_can_be_run() -> None:
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


def test_each_is_a_short_sentence_of_a_line_of_the_text_in_the_order_of_its_sections() -> None:
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


def test_all_72_claims_are_there_and_what_cannot_be_true_or_false_by_trials_is_named() -> None:
    assert [claim.id for claim in CLAIMS.claims] == [f"R{number}" for number in range(1, 73)]
    assert sum(bool(claim.checks) for claim in CLAIMS.claims) >= 58
    by_kind = {kind: {c.id for c in CLAIMS.claims if getattr(c, kind)} for kind in ("identity", "no_claim", "reading")}
    assert by_kind["identity"] == {"R6", "R8", "R32", "R37", "R64"}
    assert by_kind["no_claim"] == {"R14", "R28", "R34", "R71"}
    assert by_kind["reading"] == {"R29", "R35", "R45", "R50", "R54", "R55", "R57", "R63"}


def test_rises_have_one_margin_and_thresholds_of_ratios_are_positive() -> None:
    for claim in CLAIMS.claims:
        for check in claim.checks:
            if check.test == "largest_rise" and claim.id not in ("R3", "R61"):  # of which another number is asked
                assert check.rises is not None, claim.id
            if check.test == "ratio":
                assert all(each > 0 for each in check.predicted if each is not None)


def test_sweeps_have_a_seed_that_no_earlier_page_and_no_figure_had() -> None:
    seeds = {name: first.scenario.seed for name, (first, *_) in swept().items()}
    others = {name: seed for name, seed in seeds.items() if seed != CLAIMS.seed}
    assert others == {"short-cones": 25}
    assert not {CLAIMS.seed, *others.values()} & {0, 1, 19, 20, 21, 22, 23}
    assert f"one seed, {CLAIMS.seed}, but short-cones 25" in CLAIMS.pooled


def test_two_groups_that_look_at_opposite_walls_never_synchronise_with_300_degrees() -> None:
    """The swarm with which R43 is asked; with 360 degrees it does."""
    _, blind = swept()["static-cones"]
    assert isinstance(blind.scenario, ParticleScenario)
    for angle, is_observed in ((300, False), (360, True)):
        cone = blind.scenario.neighbourhood.model_copy(update={"angle_deg": angle})
        scenario = blind.scenario.model_copy(update={"neighbourhood": cone})
        assert {run_trial(simulate(scenario, seed)).censored for seed in range(2)} == {not is_observed}


def test_numbers_that_follow_from_equations_fulfil_these() -> None:
    one_of_twenty = np.array([0.0] * 19 + [largest_shift()])
    assert reference_order_parameter(one_of_twenty, 1.0) == pytest.approx(0.95)
    for phase, is_lowered in ((order_zero() - 0.01, True), (order_zero() + 0.01, False)):  # by a pulse
        before, after = (order_parameter(np.array([0, each]), 1.0) for each in (phase, 1.1 * phase))
        assert (after < before) == is_lowered
    assert order_parameter(np.repeat([-sigma_a(), sigma_a()], 5), 5.0) == pytest.approx(0.95)
    robots = 10
    assert sigma_b() == pytest.approx(math.sqrt(2 / (5 * robots) * robots / 2 * (4**2 + 3**2 + 2**2 + 1**2)))
