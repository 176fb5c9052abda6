"""`epuck-sim replicate`, on claims whose sweeps take a second, and trials that are added where these are undecided."""

import math
import re
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from matplotlib import image

from epuck_sim.estimate import LEVEL
from epuck_sim.replication.claims import read_claims
from epuck_sim.replication.sweeps import LOOKS, Decider, begun, needed_sweeps, sweep_folder, trials_at_looks
from epuck_sim.replication.verdicts import Verdict
from epuck_sim.runs.reader import read_points, read_wall_times
from epuck_sim.statistics.sequential import look_boundary, looks_p_value
from epuck_sim.sweep import run
from tests.cli.commands import call
from tests.replication.claim_files import FASTER, OURS, SPEED, SWEEP, claim, replicate, write_claims
from tests.runs.made_folders import ended, rows, store

pytestmark = pytest.mark.usefixtures("sweeps_run_here")

IDS = [f"A{number}" for number in range(1, 9)]
VERDICTS = ["holds", "contradicted", "undecided", "not asked", "holds", "identity", "reading", "no claim"]


@pytest.fixture(scope="module")
def replicated(tmp_path_factory, sweeps_run_here) -> tuple[Path, Path]:  # noqa: ARG001
    """Return a file of claims and the folder of its replication, in which every verdict occurs."""
    folder = tmp_path_factory.mktemp("replicated")
    file = write_claims(folder)
    result = replicate(file, folder / "out")
    told = [re.match(r"(A\d)   (.*?) +Claim \1$", line) for line in result.stdout.splitlines()[:8]]
    assert [line and line.group(1, 2) for line in told] == [*zip(IDS, VERDICTS, strict=True)]
    return file, folder / "out"


def test_the_page_has_a_row_for_each_claim_and_tables_beside_it_have_all_that_is_known(replicated) -> None:
    _, folder = replicated
    page = (folder / "replication.md").read_text()
    found = re.findall(r"^\[?(A\d)(?:\]\(#a\d\))? \| (.*) \| (.*) \| (.*)$", page, re.MULTILINE)
    assert [(row[0], row[-1]) for row in found] == [*zip(IDS, VERDICTS, strict=True)]
    assert found[0][1] == '"Sentence A1"'
    assert found[3] == ("A4", "Claim A4", "It takes 900 CPU hours.", "not asked")
    assert found[4][2].startswith("sigma a: 0.253 (0.2 to 0.3)")
    assert found[6][1] == '"Sentence A7" (Doe (2009))'
    assert re.match(r"T\\_sync at ε = 0\.4 over 0\.05: .* \(>1\.1\)$", found[6][2])
    headings = ["Contradicted", "A2", "Undecided", "A3", "Reading", "A7", "Slips in the text"]
    assert re.findall(r"^##+ (.*)$", page, re.MULTILINE) == headings
    counts = "holds 2, contradicted 1, undecided 1, not asked 1, identity 1, reading 1, no claim 1"
    assert f"8 claims: {counts}." in page
    assert "of which there are 4. Seed 5 alone counts." in page
    assert "Would change it: Slower ones \\| of another kind." in page
    assert "Ours: the margin" in page
    assert "- A misprint." in page
    assert page.count("epuck-sim replicate") == 1
    assert page.startswith("# Replication, claim by claim\n")
    assert "thesis" not in page
    assert re.findall(r"^!\[(A\d)\]\((.*)\)$", page, re.MULTILINE) == [("A3", "figures/claim-A3.png")]
    assert image.imread(folder / "figures/claim-A3.png").shape[1] == pytest.approx(8.5 / 2.54 * 120, abs=1)
    claims = {row["id"]: row for row in rows(folder / "replication.csv")}
    assert list(claims) == IDS
    assert (claims["A1"]["section"], claims["A1"]["line"], claims["A1"]["quote"]) == ("9", "7", "Sentence A1")
    assert claims["A7"].items() >= {**OURS, "verdict": "reading", "sweep": "tiny"}.items()
    assert claims["A6"]["identity"] == "A definition"
    tests = rows(folder / "replication-tests.csv")
    assert [row["claim"] for row in tests] == ["A1", "A2", "A3", "A5", "A6", "A7"]
    assert [row["verdict"] for row in tests][:3] == ["holds", "contradicted", "undecided"]
    assert (tests[-1]["predicted_above"], tests[-1]["predicted_below"]) == ("1.1", "")
    assert (tests[3]["ours_low"], tests[3]["p"]) == ("", "")
    (sweep,) = rows(folder / "replication-sweeps.csv")
    assert [sweep[name] for name in ("sweep", "points", "trials", "stored", "failed")] == ["tiny", "6", "72", "72", "0"]
    points = read_points(folder / "runs/tiny")
    assert {point.scenario.seed for point in points} == {5}
    means = {point.axes["response.coupling"]: point.times.mean() for point in points if point.axes[SPEED] == 1}
    ratios = [float(row["ours"]) for row in tests if row["test"].endswith("at ε = 0.4 over 0.05 where V = 1 cm/s")]
    assert ratios == pytest.approx([means[0.4] / means[0.05]] * 3, rel=1e-5)


def test_the_same_command_runs_nothing_again_and_chosen_claims_have_a_page_of_their_own(replicated) -> None:
    file, folder = replicated
    page = folder / "replication.md"
    before, contents = read_wall_times(folder / "runs/tiny"), page.read_bytes()
    replicate(file, folder)
    assert page.read_bytes() == contents
    replicate(file, folder, "A2", "A5")
    assert read_wall_times(folder / "runs/tiny") == before
    chosen = (folder / "chosen.md").read_text()
    assert "2 claims: holds 1, contradicted 1." in chosen
    assert f"`epuck-sim replicate A2 A5 --claims {file} --out {folder}`" in chosen
    assert page.read_bytes() == contents
    assert [row["id"] for row in rows(folder / "chosen.csv")] == ["A2", "A5"]
    assert (folder / "chosen-sweeps.csv").is_file()
    replicate(file, folder, "A5")
    assert "chosen-sweeps.csv" not in (folder / "chosen.md").read_text()
    assert not (folder / "chosen-sweeps.csv").exists()


def test_texts_of_several_lines_are_cells_and_an_identity_that_fails_has_its_number(tmp_path) -> None:
    sums = {"sweep": None, "quote": "One line\nand another\n", "identity": "A\ndefinition"}
    file = write_claims(tmp_path, [claim("A6", {"test": "formula", "number": "sigma_b", "below": 2}, **sums)])
    folder = tmp_path / "my page"
    replicate(file, folder)
    page = (folder / "replication.md").read_text()
    assert '\n[A6](#a6) | "One line and another" | sigma b: 2.45 (\\<2) | contradicted\n' in page
    assert "Why: A definition" in page
    assert f"`epuck-sim replicate --claims {file} --out '{folder}'`" in page


def test_the_list_runs_nothing(tmp_path) -> None:
    file = write_claims(tmp_path)
    result = call("replicate", "--claims", file, "--list", "--out", tmp_path / "out")
    said = ["A4   9            Claim A4 (no trials)", "A5   9            Claim A5"]
    assert result.stdout.splitlines()[3:5] == said
    assert not (tmp_path / "out").exists()
    assert len(call("replicate", "--list").stdout.splitlines()) == 76


def test_a_value_of_a_series_stands_for_a_trial(tmp_path) -> None:
    sweep = {**SWEEP, "keys": {**SWEEP["keys"], "measures": ["order_parameter"]}}
    final = {"test": "level", "of": "order_parameter", "where": {"response.coupling": 0.4, SPEED: 1}}
    checks = [{**final, "take": "largest", "above": 0.99}, {**final, "take": "first", "below": 0.99}]
    replicate(write_claims(tmp_path, [claim("A1", *checks)], sweep), tmp_path / "out")
    series = next(p for p in read_points(tmp_path / "out/runs/tiny", "order_parameter") if p.number == 3).measured
    found = {row["test"]: float(row["ours"]) for row in rows(tmp_path / "out" / "replication-tests.csv")}
    for take, values in (("largest", map(max, series)), ("first", [values[0] for values in series])):
        assert found[f"{take} order_parameter where ε = 0.4, V = 1 cm/s"] == pytest.approx(np.mean(list(values)))


def test_each_test_is_named_on_the_page_with_what_it_finds_or_why_it_finds_no_number(tmp_path) -> None:
    longer = {"neighbourhood": {"k": 1}, "measures": ["neighbour_change"], "trials": 20, "stop": {"max_cycles": 2000}}
    sweep = {**SWEEP, "keys": {**SWEEP["keys"], **longer}}
    checks = [
        {"test": "superiority", "between": FASTER["between"], "where": {SPEED: 1}, "below": 0.5},
        {"test": "share_difference", "between": FASTER["between"], "where": {SPEED: 1}, "above": 0},
        {"test": "rank_trend", "along": SPEED, "where": {"response.coupling": 0.4}, "below": 0},
        {"test": "likelier", "law": "Weibull", "than": "log-normal", "above": 0},
        {"test": "collapse", "along": SPEED, "of": "neighbour_change", "below": 0.5},
        {"test": "place_exponent", "place": "V_p", "along": SPEED, "over": "response.coupling", "above": 0},
    ]
    replicate(write_claims(tmp_path, [claim("A1", *checks)], sweep), tmp_path / "out")
    found = {row["test"]: row["ours"] for row in rows(tmp_path / "out" / "replication-tests.csv")}
    assert list(found) == [
        "chance that T_sync is larger at ε = 0.4 than at 0.05 where V = 1 cm/s",
        "share synchronised at ε = 0.4 minus 0.05 where V = 1 cm/s",
        "rank correlation of T_sync with V where ε = 0.4",
        "nats a trial by which Weibull distributions make T_sync likelier than log-normal ones",
        "distance of curves of T_sync over neighbour_change, relative to that over V",
        "power of ε in V_p",
    ]
    assert found.popitem()[1] == ""  # three speeds have no peak
    assert all(np.isfinite(float(value)) for value in found.values())
    few = write_claims(tmp_path, [claim("A1", checks[0])], {**SWEEP, "keys": {**SWEEP["keys"], "trials": 3}})
    replicate(few, tmp_path / "few")
    assert "V = 1 cm/s; it has no number: too few trials or points, " in (tmp_path / "few/replication.md").read_text()


TINY = {**SWEEP, "keys": {**SWEEP["keys"], "trials": 6}}
NEAR = {**FASTER, "between": [{"response.coupling": 0.4}, {"response.coupling": 0.05}], "above": 2.4}
"""Six trials a point are too few to see it."""
NEVER = {**FASTER, "where": {}, "within": [0.192, 0.194]}  # the ratio is 0.193, of thousands of trials
AT_ONCE = {**FASTER, "where": {}, "below": 1}


def trials(folder: Path) -> set[int]:
    return {len(point.seeds) for point in read_points(folder / "runs/tiny")}


def test_chance_decides_as_often_as_one_look_would_though_there_are_many_which_are_less_sure_each() -> None:
    sizes = np.array(trials_at_looks(20))
    steps = np.random.default_rng(1).normal(size=(50_000, len(sizes))) * np.sqrt(np.diff(sizes, prepend=0))
    largest = np.abs(steps.cumsum(axis=1) / np.sqrt(sizes)).max(axis=1)
    found = looks_p_value(2 * NormalDist().cdf(-np.quantile(largest, LEVEL)), LOOKS)
    assert found == pytest.approx(1 - LEVEL, abs=0.004)
    for p_value in [0.0, 1e-30, 1e-6, 0.01, 0.5, 1.0]:
        assert looks_p_value(p_value, 1) == pytest.approx(p_value)
        assert p_value <= looks_p_value(p_value, LOOKS) <= min(1, LOOKS * p_value)
        boundary = look_boundary(tuple(trials_at_looks(20)), LEVEL)
        assert looks_p_value(2 * NormalDist().cdf(-boundary), LOOKS) == pytest.approx(1 - LEVEL, abs=1e-3)


def test_trials_are_added_until_claims_are_decided_and_the_page_counts_looks(tmp_path) -> None:
    file = write_claims(tmp_path, [claim("B1", NEAR), claim("B2", AT_ONCE)], TINY)
    replicate(file, tmp_path / "out")
    page = tmp_path / "out/replication.md"
    assert trials(tmp_path / "out") == {6}
    assert "undecided 1" in page.read_text()
    assert "looked at" not in page.read_text()
    result = replicate(file, tmp_path / "out", "--until-decided")
    (count,) = trials(tmp_path / "out")
    assert count in trials_at_looks(6)[1:]
    assert "No undecided claim may be looked at again" in result.stdout
    assert "holds 2" in page.read_text()
    assert f"looked at up to {LOOKS} times" in page.read_text()
    before = page.read_bytes()
    for words in ((), ("--until-decided",)):
        replicate(file, tmp_path / "out", *words)
        assert trials(tmp_path / "out") == {count}
        assert page.read_bytes() == before


def test_they_end_with_the_last_look_or_the_budget_and_what_is_left_is_said(tmp_path) -> None:
    file = write_claims(tmp_path, [claim("B1", NEVER), claim("B2", AT_ONCE)], TINY)
    result = replicate(file, tmp_path / "out", "--until-decided", "--cpu-hours", 0)
    assert trials(tmp_path / "out") == {6}
    assert re.search(rf"^B1 +tiny +9 .*more than {LOOKS} looks$", result.stdout, re.MULTILINE)
    assert not re.search("^B2 +tiny", result.stdout, re.MULTILINE)
    replicate(file, tmp_path / "out", "--until-decided")
    assert trials(tmp_path / "out") == {trials_at_looks(6)[-1]}


def test_a_look_that_was_interrupted_is_completed_before_anything_is_judged(tmp_path, monkeypatch) -> None:
    file = write_claims(tmp_path, [claim("B1", NEVER)], TINY)
    replicate(file, tmp_path / "out")
    run_sweep = run.run_sweep

    def interrupt(progress) -> None:
        if progress.stored >= 40:
            raise KeyboardInterrupt

    monkeypatch.setattr(run, "run_sweep", lambda *given, **named: run_sweep(*given[:3], interrupt, **named))
    page = tmp_path / "out/replication.md"
    page.unlink()
    replicate(file, tmp_path / "out", "--until-decided", code=130)
    assert trials(tmp_path / "out") != {9}
    assert not page.exists()
    monkeypatch.setattr(run, "run_sweep", run_sweep)
    replicate(file, tmp_path / "out")
    assert trials(tmp_path / "out") == {9}


def test_the_time_until_a_verdict_is_that_of_the_look_at_which_effects_as_they_are_decide(tmp_path) -> None:
    file = write_claims(tmp_path, [claim("B1", NEAR), claim("B2", NEVER)], TINY)
    replicate(file, tmp_path / "out")
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
