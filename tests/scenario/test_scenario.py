"""Scenarios as Python objects: their short form, how copies of them are completed, and their types."""

import subprocess
import sys
from pathlib import Path

import pytest

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario import robots
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.robots import RobotGroup


@pytest.mark.parametrize(
    ("source", "short"),
    [
        ("thesis", "EmbodiedScenario(name='thesis', model='embodied', population=10)"),
        ("particles", "ParticleScenario(name='particles', model='particles', population=20)"),
        ("fig-4-2a", "EmbodiedScenario(name='fig-4-2a', model='embodied', population=10, points=100)"),
    ],
)
def test_a_scenario_is_shown_on_one_line(source: str, short: str) -> None:
    scenario = load_scenario(source)
    assert repr(scenario) == str(scenario) == f"{scenario}" == short


def test_a_point_is_shown_on_one_line() -> None:
    (point,) = points(load_scenario("pair"))
    assert "scenario=EmbodiedScenario(name='pair', model='embodied', population=2)" in repr(point)


def test_what_a_user_has_changed_in_a_copy_is_completed_when_it_is_simulated() -> None:
    loaded = load_scenario("thesis")
    groups = (RobotGroup(count=2, controller="oscillator"),)
    simulation = Simulation(loaded.model_copy(update={"robots": groups}), seed=0)
    assert simulation.scenario.robots[0].parameters["period_s"] == 5.0
    assert simulation.scenario.robots == load_scenario({"robots": [{"count": 2, "controller": "oscillator"}]}).robots


@pytest.mark.parametrize(
    ("group", "message"),
    [
        (RobotGroup(controller="fierfly"), r"thesis: robots\.0\.controller: unknown 'fierfly', did you mean 'firefly'"),
        (RobotGroup(parameters={"pace": 1}), r"thesis: robots\.0\.parameters: unknown 'pace'"),
        (RobotGroup(parameters={"period_s": 0.01}), r"thesis: robots\.0\.parameters: period_s is 0.01"),
    ],
)
def test_mistakes_in_a_copy_are_found_when_it_is_simulated(group: RobotGroup, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        Simulation(load_scenario("thesis").model_copy(update={"robots": (group,)}))


def test_a_loaded_scenario_is_completed_without_a_look_into_folders(monkeypatch) -> None:
    scenario = load_scenario("thesis")
    looked: list[Path] = []
    monkeypatch.setattr(Path, "glob", lambda folder, _: looked.append(folder) or [])
    assert load_scenario(scenario) == scenario
    assert looked == []


def test_a_model_without_controllers_has_nothing_to_complete(monkeypatch) -> None:
    scenario = load_scenario("particles")
    monkeypatch.setattr(robots, "find_controller", None)
    assert load_scenario(scenario) is scenario


TYPED = """
from typing import assert_type

from epuck_sim import EmbodiedScenario, ParticleScenario, Scenario, Simulation, load_scenario

loaded = load_scenario("thesis")
assert_type(loaded, EmbodiedScenario | ParticleScenario)
if isinstance(loaded, EmbodiedScenario):
    assert_type(loaded.arena.width_cm, float)
if loaded.model == "embodied":
    assert_type(loaded, EmbodiedScenario)
else:
    assert_type(loaded.agents.count, int)
assert_type(load_scenario({"model": "particles"}, ["agents.count=3"]), EmbodiedScenario | ParticleScenario)


def smaller(scenario: EmbodiedScenario, other: Scenario) -> float:
    assert_type(load_scenario(scenario, ["arena.width_cm=50"]), EmbodiedScenario)
    assert_type(load_scenario(other), Scenario)
    return load_scenario(scenario).arena.width_cm


print(smaller(EmbodiedScenario(), loaded), Simulation(loaded).scenario.arena.width_cm)
"""


def test_type_checkers_know_the_class_that_is_loaded(tmp_path) -> None:
    (tmp_path / "typed.py").write_text(TYPED)
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(tmp_path / "typed.py")],
        cwd=Path(__file__).parents[2],  # where mypy's settings and its cache are
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_an_embodied_scenario_keeps_its_class() -> None:
    assert isinstance(load_scenario(EmbodiedScenario(), ["arena.width_cm=50"]), EmbodiedScenario)
