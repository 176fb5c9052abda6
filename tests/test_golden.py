"""Claims about golden values: outcomes are the same to the bit as when golden.json was written (see golden.py).

The bits hold for one kind of machine and one version of each engine. Elsewhere the first second of a trial must agree
to 1e-9, before contacts and firings magnify the last digit, and the times of synchronisation as samples of one
distribution.

Of the cases (golden_cases.yaml), robots also start anew with `reset`, and go on as copies and from snapshots, to the
same bits.
"""

import copy
import json
import pickle
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from epuck_sim import EmbodiedScenario, ParticleScenario, Simulation
from epuck_sim.scenario.changes import NOT_OF_AGENTS
from epuck_sim.scenario.particles import SHIPPED
from epuck_sim.util.builtin import ARENAS, builtin_files
from tests import golden

GOLDEN = json.loads(golden.FILE.read_text())
SAME_PLATFORM = golden.here() == GOLDEN["platform"]


@pytest.fixture(autouse=True, scope="module")
def _platform(record_testsuite_property) -> None:
    """Say which of the two comparisons this is."""
    record_testsuite_property("golden", "bits" if SAME_PLATFORM else "tolerances")
    if not SAME_PLATFORM:
        print(f"golden values are of {GOLDEN['platform']}, this is {golden.here()}: compared within tolerances")


def test_every_shipped_scenario_has_golden_values_and_no_two_cases_the_same_so_that_none_is_without_effect() -> None:
    assert set(GOLDEN["scenarios"]) == set(builtin_files(ARENAS))
    held, made = ({kind: {*cases} for kind, cases in each.items()} for each in (GOLDEN["cases"], golden.CASES))
    assert held == made
    values = [each for cases in GOLDEN["cases"].values() for each in cases.values()]
    assert len({json.dumps([each["digest"], each["trials"]]) for each in values}) == len(values)


@pytest.mark.parametrize("name", GOLDEN["scenarios"])
def test_a_shipped_scenario_runs_as_it_did(name: str) -> None:
    found, expected = golden.scenario(name), GOLDEN["scenarios"][name]
    for key in {"poses", "phases"} & set(expected):
        np.testing.assert_allclose(found[key], expected[key], rtol=0, atol=1e-9)
    if SAME_PLATFORM:
        assert found == expected


@pytest.mark.parametrize("name", GOLDEN["outcomes"])
def test_trials_end_as_they_did(name: str) -> None:
    expected = GOLDEN["outcomes"][name]
    found = golden.outcomes(name, range(len(expected)))
    if SAME_PLATFORM:
        assert found == expected
    assert mannwhitneyu([row[0] for row in found], [row[0] for row in expected]).pvalue > 1e-3


@pytest.mark.parametrize("model", golden.SWEEPS)
def test_a_small_sweep_has_the_same_table_and_statistics(tmp_path, model: str) -> None:
    found, expected = golden.sweep(model, tmp_path / "run"), GOLDEN["sweeps"][model]
    if SAME_PLATFORM:
        assert [row["times"] for row in found] == [row["times"] for row in expected]
        statistics = [[[row["weibull_mean"] or 0, row["median"] or 0] for row in rows] for rows in (found, expected)]
        np.testing.assert_allclose(*statistics, rtol=1e-9)
    assert len(found) == len(expected)


def test_a_recording_and_a_film_hold_the_same(tmp_path) -> None:
    found = golden.pictures(tmp_path)
    assert set(found) == set(GOLDEN["pictures"])
    if SAME_PLATFORM:
        assert found == GOLDEN["pictures"]


@pytest.mark.parametrize("name", golden.CASES["agents"])
def test_agents_of_a_case_do_as_they_did(name: str) -> None:
    found, expected = golden.case_values("agents", name), GOLDEN["cases"]["agents"][name]
    np.testing.assert_allclose(found["phases"], expected["phases"], rtol=0, atol=1e-9)
    if SAME_PLATFORM:
        assert found == expected


def choices(schema: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the keys of a model that take one of some words, or a truth value, with each of these values."""
    without_outcome = ("OverheadSection", "FigureSection", "Condition", "SweepAxes")
    for name, section in {"": schema, **schema["$defs"]}.items():
        for key, value in section.get("properties", {}).items() if name not in without_outcome else ():
            for choice in (value, value.get("items", {}), *value.get("anyOf", ())):
                words = choice.get("enum", [choice["const"]] if "const" in choice else [])
                values = [False, True] if choice.get("type") == "boolean" else words
                yield from ((key, each) for each in values)


def chosen(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the plain values in a scenario with the keys that they are at."""
    if isinstance(value, dict | list | tuple):
        for name, part in value.items() if isinstance(value, dict) else ((key, part) for part in value):
            yield from chosen(part, name)
    else:
        yield key, value


@pytest.mark.parametrize(("kind", "model"), [("robots", EmbodiedScenario), ("agents", ParticleScenario)])
def test_cases_have_every_word_that_a_scenario_can_choose(kind: str, model: type[Any]) -> None:
    dumps = [golden.case(kind, name).model_dump() for name in golden.CASES[kind]]
    held = {pair for dump in dumps for pair in chosen(dump)}
    refused = {("kind", each) for each in NOT_OF_AGENTS if kind == "agents"}
    missing = set(choices(model.model_json_schema())) - held
    assert missing == refused, "give tests/golden_cases.yaml a case with each; then python -m tests.golden"
    curves = {dump["response"]["curve"] for dump in dumps if kind == "agents"}
    assert kind == "robots" or set(SHIPPED) < curves


@pytest.mark.parametrize("name", golden.CASES["robots"])
def test_robots_of_a_case_do_as_they_did_also_reset_copied_restored_and_with_all_steps_at_once(name: str) -> None:
    """Half of the steps follow a reset, a quarter each a copy and a snapshot, which went through pickle."""
    scenario, golden_values = golden.case("robots", name), GOLDEN["cases"]["robots"][name]
    at_once = Simulation(scenario, seed=1)
    second = round(1 / at_once.step_s) + 1
    early = at_once.advance(second)
    np.testing.assert_allclose(early.poses[early.present][:3], golden_values["poses"], rtol=0, atol=1e-9)
    used = Simulation(scenario, seed=2)
    used.advance(golden.STEPS // 3)
    earlier = used.snapshot()
    used.reset(1)
    half, quarter = golden.STEPS // 2, golden.STEPS // 4

    def felt(simulation: Simulation, steps: int) -> list[np.ndarray]:
        return [array for step in islice(simulation, steps) for array in golden.felt(step)]

    arrays = felt(used, half)
    copied = copy.copy(used)
    arrays += felt(copied, quarter)
    snapshot = pickle.loads(pickle.dumps(copied.snapshot()))
    copied.restore(earlier)
    assert copied.steps == golden.STEPS // 3
    copied.restore(snapshot)
    arrays += felt(copied, quarter)
    expected = golden_values if SAME_PLATFORM else golden.robots(scenario, golden.felt)
    assert golden.digest(arrays) == expected["digest"]
    last = [*golden.felt(at_once.advance(golden.STEPS - second))]
    assert golden.digest(last) == golden.digest(arrays[-len(last) :])
    if SAME_PLATFORM:
        assert golden.endings(scenario) == golden_values["trials"]


@pytest.mark.parametrize("stop_at", [None, 40])
def test_robots_that_are_driven_from_outside_go_on_as_they_did(stop_at: int | None) -> None:
    assert golden.commanded(stop_at=stop_at) == (GOLDEN["commanded"] if SAME_PLATFORM else golden.commanded())
