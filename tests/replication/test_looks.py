"""`replicate --until-decided`: trials are added where claims are undecided, and every look at them is counted."""

import math
import re
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest

from epuck_sim.estimate import LEVEL
from epuck_sim.replication.claims import read_claims
from epuck_sim.replication.sweeps import LOOKS, Decider, begun, needed_sweeps, sweep_folder, trials_at_looks
from epuck_sim.replication.verdicts import Verdict
from epuck_sim.runs.reader import read_points
from epuck_sim.statistics.sequential import look_boundary, looks_p_value
from epuck_sim.sweep import run
from tests.replication.claim_files import FASTER, SPEED, SWEEP, claim, replicate, stop_at, write_claims
from tests.runs.made_folders import ended, store

pytestmark = pytest.mark.usefixtures("sweeps_run_here")

TINY = {**SWEEP, "keys": {**SWEEP["keys"], "trials": 6}}
NEAR = {**FASTER, "between": [{"response.coupling": 0.4}, {"response.coupling": 0.05}], "above": 2.4}
"""Six trials a point are too few to see it."""
NEVER = {**FASTER, "where": {}, "within": [0.192, 0.194]}  # the ratio is 0.193, of thousands of trials
AT_ONCE = {**FASTER, "where": {}, "below": 1}


def trials(folder: Path) -> set[int]:
    return {len(point.seeds) for point in read_points(folder / "runs/tiny")}


def test_chance_decides_as_often_as_one_look_would_though_there_are_many() -> None:
    sizes = np.array(trials_at_looks(20))
    steps = np.random.default_rng(1).normal(size=(50_000, len(sizes))) * np.sqrt(np.diff(sizes, prepend=0))
    largest = np.abs(steps.cumsum(axis=1) / np.sqrt(sizes)).max(axis=1)
    found = looks_p_value(2 * NormalDist().cdf(-np.quantile(largest, LEVEL)), LOOKS)
    assert found == pytest.approx(1 - LEVEL, abs=0.004)


def test_a_look_among_many_is_less_sure_but_no_less_than_bonferroni_makes_it() -> None:
    for p_value in [0.0, 1e-30, 1e-6, 0.01, 0.5, 1.0]:
        assert looks_p_value(p_value, 1) == pytest.approx(p_value)
        assert p_value <= looks_p_value(p_value, LOOKS) <= min(1, LOOKS * p_value)
        boundary = look_boundary(tuple(trials_at_looks(20)), LEVEL)
        assert looks_p_value(2 * NormalDist().cdf(-boundary), LOOKS) == pytest.approx(1 - LEVEL, abs=1e-3)


def test_trials_are_added_until_claims_are_decided_and_the_page_counts_looks(tmp_path) -> None:
    file = write_claims(tmp_path, [claim("B1", NEAR), claim("B2", AT_ONCE)], TINY)
    assert replicate(file, tmp_path / "out").exit_code == 0
    page = tmp_path / "out/replication.md"
    assert trials(tmp_path / "out") == {6}
    assert "undecided 1" in page.read_text()
    assert "looked at" not in page.read_text()
    result = replicate(file, tmp_path / "out", "--until-decided")
    assert result.exit_code == 0
    (count,) = trials(tmp_path / "out")
    assert count in trials_at_looks(6)[1:]
    assert "No claim is undecided that may be looked at again" in result.stdout
    assert "holds 2" in page.read_text()
    assert f"looked at up to {LOOKS} times" in page.read_text()
    before = page.read_bytes()
    for words in ((), ("--until-decided",)):
        assert replicate(file, tmp_path / "out", *words).exit_code == 0
        assert trials(tmp_path / "out") == {count}
        assert page.read_bytes() == before


def test_they_end_with_the_last_look_or_the_budget_and_what_is_left_is_said(tmp_path) -> None:
    file = write_claims(tmp_path, [claim("B1", NEVER), claim("B2", AT_ONCE)], TINY)
    result = replicate(file, tmp_path / "out", "--until-decided", "--cpu-hours", 0)
    assert trials(tmp_path / "out") == {6}
    assert re.search(rf"^B1 +tiny +9 .*more than {LOOKS} looks$", result.stdout, re.MULTILINE)
    assert not re.search("^B2 +tiny", result.stdout, re.MULTILINE)
    assert replicate(file, tmp_path / "out", "--until-decided").exit_code == 0
    assert trials(tmp_path / "out") == {trials_at_looks(6)[-1]}


def test_a_look_that_was_interrupted_is_completed_before_anything_is_judged(tmp_path, monkeypatch) -> None:
    file = write_claims(tmp_path, [claim("B1", NEVER)], TINY)
    assert replicate(file, tmp_path / "out").exit_code == 0
    run_sweep = run.run_sweep
    monkeypatch.setattr(run, "run_sweep", lambda *given, **named: run_sweep(*given[:3], stop_at(40), **named))
    page = tmp_path / "out/replication.md"
    page.unlink()
    assert replicate(file, tmp_path / "out", "--until-decided").exit_code == 130
    assert trials(tmp_path / "out") != {9}
    assert not page.exists()
    monkeypatch.setattr(run, "run_sweep", run_sweep)
    assert replicate(file, tmp_path / "out").exit_code == 0
    assert trials(tmp_path / "out") == {9}


def test_the_time_until_a_verdict_is_that_of_the_look_at_which_effects_as_they_are_decide(tmp_path) -> None:
    file = write_claims(tmp_path, [claim("B1", NEAR), claim("B2", NEVER)], TINY)
    assert replicate(file, tmp_path / "out").exit_code == 0
    claims, folder = read_claims(file), sweep_folder(tmp_path / "out", "tiny")
    scenarios = needed_sweeps(claims, claims.claims)
    assert begun(scenarios["tiny"], folder).trials == 6
    decider = Decider(claims.claims, scenarios, {"tiny": folder})
    near, never = decider.answers()
    assert (near.verdict, never.verdict) == (Verdict.UNDECIDED, Verdict.UNDECIDED)
    (look,) = decider.next_looks()
    assert look.scenario.trials == 9
    deviation = NormalDist().inv_cdf(1 - near.checks[0].p_value / 2)
    needed = 6 * (look_boundary(tuple(trials_at_looks(20)), 1 - (1 - LEVEL) / 2) / deviation) ** 2
    size = next((each for each in trials_at_looks(6) if each >= needed), math.inf)
    assert look.claims["B1"] == pytest.approx(look.cost_s * (size - 6) / 3)
    assert look.claims["B1"] < look.claims["B2"]


def test_no_trials_are_added_where_points_scatter_by_far_more_than_their_errors(tmp_path) -> None:
    slope = {"test": "power_exponent", "along": SPEED, "where": {"response.coupling": 0.4}, "above": 0}
    claims = read_claims(write_claims(tmp_path, [claim("B1", slope)], TINY))
    scenarios = needed_sweeps(claims, claims.claims)
    heights = {1: [9.0, 10.0, 11.0], 10: [270.0, 300.0, 330.0], 100: [18.0, 20.0, 22.0]}
    store(tmp_path / "tiny", scenarios["tiny"], lambda point: ended(2 * heights[point.axes[SPEED]]))
    decider = Decider(claims.claims, scenarios, {"tiny": tmp_path / "tiny"})
    (answer,) = decider.answers()
    assert answer.verdict == Verdict.UNDECIDED
    assert not decider.next_looks()
    assert "More points would decide B1, not more trials" in decider.table().to_text(200)
