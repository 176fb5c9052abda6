"""The claims that are shipped can be asked: their sweeps are scenarios, and hold the points of their tests."""

import math
from functools import cache

import numpy as np
import pytest

from epuck_sim.replication.checks import FormulaCheck, RatioCheck
from epuck_sim.replication.claims import read_claims
from epuck_sim.replication.evaluation import run_check
from epuck_sim.replication.sweeps import Version, needed_sweeps
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.points import Point, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.sweep.checks import check_sweep

CLAIMS = read_claims()


@cache
def sweeps_of(version: Version) -> dict[str, Scenario]:
    return needed_sweeps(CLAIMS, CLAIMS.claims, version)


@cache
def points_of(version: Version) -> dict[str, tuple[Point, ...]]:
    return {name: points(scenario) for name, scenario in sweeps_of(version).items()}


def without_trials(point) -> PointTrials:
    none = np.array([])
    return PointTrials(point.number, point.key, point.axes, point.scenario, none, none == 1, ())


@pytest.mark.parametrize("version", Version)
def test_every_test_finds_its_points(version: Version) -> None:
    sweeps = {name: [without_trials(point) for point in found] for name, found in points_of(version).items()}
    assert sweeps.keys() == CLAIMS.sweeps.keys()
    for claim in CLAIMS.claims:
        for check in claim.checks:
            if not isinstance(check, FormulaCheck):
                stored = [point._replace(of=check.of) for point in sweeps[claim.sweep]]
                assert math.isnan(run_check(check, stored).effect.estimate.low), claim.id
                measured = [section.name for section in stored[0].scenario.measures]
                assert check.of in (None, *measured), claim.id


def test_all_72_claims_are_there_and_each_is_asked_or_says_why_not() -> None:
    assert [claim.id for claim in CLAIMS.claims] == [f"R{number}" for number in range(1, 73)]
    assert all(bool(claim.checks) != bool(claim.not_asked) for claim in CLAIMS.claims)
    assert sum(bool(claim.checks) for claim in CLAIMS.claims) >= 55


@pytest.mark.parametrize("version", Version)
def test_every_sweep_can_be_run(version: Version) -> None:
    for found in points_of(version).values():
        check_sweep(found)


def test_thresholds_of_ratios_are_positive() -> None:
    for claim in CLAIMS.claims:
        for check in claim.checks:
            if isinstance(check, RatioCheck):
                assert min(check.within or (check.above or check.below,)) > 0


def test_sweeps_have_a_seed_that_the_docs_did_not_use() -> None:
    for version in Version:
        assert all(scenario.seed in (19, 20, 21) for scenario in sweeps_of(version).values())
