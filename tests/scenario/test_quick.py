"""Claims about quick versions: what they change, where they are refused, and that those that are shipped fit."""

from pathlib import Path

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.keys import quick_version, without_quick
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import points
from tests.cli.commands import call, refused

pytestmark = pytest.mark.usefixtures("sweeps_run_here")


TINY = """
name: tiny
model: particles
agents: {count: 5, speed_cm_s: 30}
stop: {max_cycles: 40}
trials: 3
sweep: {grid: {agents.speed_cm_s: [3, 30, 90]}}
quick:
  trials: 2
  stop: {max_cycles: 20}
  sweep: {grid: {agents.speed_cm_s: [3, 90]}}
"""


@pytest.fixture
def tiny(tmp_path) -> Path:
    path = tmp_path / "tiny.yaml"
    path.write_text(TINY)
    return path


# What is merged


GIVEN = {
    "name": "full",
    "trials": 100,
    "agents": {"count": 20, "speed_cm_s": 3},
    "stop": {"max_cycles": 1000},
    "sweep": {"grid": {"a": [1, 2, 3], "b": [4, 5]}},
}


@pytest.mark.parametrize(
    ("quick", "changed"),
    [
        ({}, {}),
        ({"trials": 5}, {"trials": 5}),
        ({"stop": {"max_cycles": 9}}, {"stop": {"max_cycles": 9}}),
        ({"stop": {"order_parameter": None}}, {"stop": {"max_cycles": 1000, "order_parameter": None}}),
        ({"agents": {"count": 6}}, {"agents": {"count": 6, "speed_cm_s": 3}}),
        ({"sweep": {"grid": {"a": [1]}}}, {"sweep": {"grid": {"a": [1], "b": [4, 5]}}}),
        ({"sweep": {"zip": {"c": [1]}}}, {"sweep": {"grid": {"a": [1, 2, 3], "b": [4, 5]}, "zip": {"c": [1]}}}),
        ({"sweep": None}, {"sweep": None}),
        ({"agents": None}, {"agents": None}),
        ({"agents": [1]}, {"agents": [1]}),
        ({"trials": {"x": 1}}, {"trials": {"x": 1}}),
        ({"figure": {"form": "map"}}, {"figure": {"form": "map"}}),
    ],
)
def test_sections_are_merged_key_by_key_and_everything_else_is_replaced(quick: dict, changed: dict) -> None:
    given = {**GIVEN, "quick": quick}
    assert quick_version(given, "here") == {**GIVEN, **changed}
    assert given == {**GIVEN, "quick": quick}


def test_nothing_of_what_was_given_is_changed() -> None:
    given = {"sweep": {"grid": {"a": [1, 2, 3]}}, "quick": {"sweep": {"grid": {"a": [1]}}}}
    quick_version(given, "here")
    assert given == {"sweep": {"grid": {"a": [1, 2, 3]}}, "quick": {"sweep": {"grid": {"a": [1]}}}}


@pytest.mark.parametrize("quick", [{"trials": 5}, {}, None])
def test_without_the_option_the_full_version_is_loaded(quick: object) -> None:
    assert without_quick({**GIVEN, "quick": quick}) == GIVEN
    loaded = load_scenario({"model": "particles", "trials": 7, "quick": quick})
    assert loaded == load_scenario({"model": "particles", "trials": 7})


def test_changes_by_key_and_axes_count_beside_the_quick_version() -> None:
    given = {"model": "particles", "trials": 9, "quick": {"trials": 2, "stop": {"max_cycles": 5}}}
    scenario = load_scenario(given, ["trials=4"], ["agents.count=3,4"], quick=True)
    assert (scenario.trials, scenario.stop.max_cycles) == (4, 5)
    assert list(scenario.sweep.rows()) == [{"agents.count": 3}, {"agents.count": 4}]


def test_a_scenario_that_is_loaded_has_forgotten_its_quick_version() -> None:
    for quick in (False, True):
        with pytest.raises(ScenarioError, match="fig-5-3: has no quick version"):
            load_scenario(load_scenario("fig-5-3", quick=quick), quick=True)


def test_a_scenario_of_robots_may_have_a_quick_version_too() -> None:
    given = {"arena": {"width_cm": 50, "height_cm": 40}, "quick": {"arena": {"width_cm": 40}}}
    arena = load_scenario(given, quick=True).arena
    assert (arena.width_cm, arena.height_cm) == (40, 40)


# What is shipped


# The command


def test_run_runs_the_quick_version_and_its_folder_holds_that_alone(tiny, tmp_path) -> None:
    folder = tmp_path / "run"
    result = call("run", tiny, "--quick", "--out", folder, "--workers", 1)
    assert result.exit_code == 0, result.stderr
    assert "tiny: 2 points, 4 of 4 trials have a result" in result.stdout
    written = (folder / "scenario.yaml").read_text()
    assert "quick" not in written
    assert written == write_scenario(load_scenario(tiny, quick=True))
    assert load_scenario(folder) == load_scenario(tiny, quick=True)
    assert refused("run", folder, "--status") == ("error: --status is a command of its own: epuck-sim status FOLDER\n")
    assert refused("run", folder, "--quick").endswith("scenario.yaml: has no quick version; leave --quick out\n")
    full = call("run", tiny, "--out", folder)
    assert full.exit_code == 2
    assert "stop.max_cycles: 20 in the folder, 40 now" in full.stderr


def test_run_takes_the_quick_version_of_one_trial(tiny) -> None:
    result = call("run", tiny, "--quick", "--point", 1, "--trial", 1, "--json")
    assert result.exit_code == 0
    point = points(load_scenario(tiny, quick=True))[1]
    assert point.axes == {"agents.speed_cm_s": 90}
    assert f'"seed": {point.seed(1)},' in result.stdout
    assert "allowed: 0 to 1" in refused("run", tiny, "--quick", "--point", 2, "--trial", 0)
