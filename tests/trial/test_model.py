"""Claims about models and their trials: each model is known by its name, written, read, made and run as what it is."""

import pytest

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ScenarioError
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import SCENARIO_TYPES, load_scenario, validate, write_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.yaml_io import parse_yaml, read_yaml
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.trial.result import TrialResult, TrialState
from epuck_sim.util.builtin import SWEEPS, builtin_files

OF_PARTICLES = [name for name, path in builtin_files(SWEEPS).items() if read_yaml(path).get("model") == "particles"]


class Shown:
    """Progress that keeps what it is shown."""

    def __init__(self) -> None:
        self.times_s: list[float] = []
        self.cycles: list[int] = []

    def __call__(self, state: TrialState) -> None:
        self.times_s.append(state.time_s)
        self.cycles.append(state.cycles)


def without_wall(result: TrialResult) -> TrialResult:
    return result._replace(wall_s=0.0)


# Models


@pytest.mark.parametrize(
    ("given", "kind"),
    [({}, EmbodiedScenario), ({"model": "embodied"}, EmbodiedScenario), ({"model": "particles"}, ParticleScenario)],
)
def test_a_scenario_is_of_the_model_that_it_names_and_of_robots_by_default(given: dict, kind: type) -> None:
    scenario = validate(given, "here")
    assert type(scenario) is kind
    assert SCENARIO_TYPES[scenario.model] is kind


@pytest.mark.parametrize("model", ["Particles", "", None, 0.5, True, ["particles"], {"particles": 1}])
def test_a_model_that_is_none_is_refused_with_those_there_are(model: object) -> None:
    with pytest.raises(ScenarioError) as caught:
        validate({"model": model, "seed": -1}, "here")
    assert str(caught.value) == f"here: model: is {model!r}; allowed: 'embodied' or 'particles'"


def test_every_line_of_what_is_refused_begins_with_the_origin() -> None:
    with pytest.raises(ScenarioError) as caught:
        validate({"model": "particles", "seed": -1, "agents": {"count": 0}, "robots": []}, "here")
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    assert all(line.startswith("here: ") for line in lines)


@pytest.mark.parametrize("name", OF_PARTICLES)
def test_a_quick_sweep_of_particles_is_the_same_when_it_is_written_and_read_again(name: str) -> None:
    scenario = load_scenario(name, quick=True)
    assert load_scenario(parse_yaml(write_scenario(scenario), "x")) == scenario
    assert validate(scenario.model_dump(mode="json"), "x") == scenario


# What is simulated


@pytest.mark.parametrize(("name", "kind"), [("pair", Simulation), ("particles", ParticleSimulation)])
def test_what_is_made_is_of_the_scenario_s_model_with_the_seed(name: str, kind: type) -> None:
    scenario = load_scenario(name)
    model = simulate(scenario, 17)
    assert type(model) is kind
    assert (model.scenario, model.seed) == (scenario, 17)


def test_particles_have_nothing_to_interpret() -> None:
    with pytest.raises(ScenarioError) as caught:
        simulate(load_scenario("particles"), 0, interpret=True)
    words = "particles: model: particles has no controllers to interpret; leave --interpret out"
    assert str(caught.value) == words


def test_robots_are_interpreted_if_wanted() -> None:
    scenario = load_scenario("pair", ["stop.max_cycles=2"])
    compiled, interpreted = (run_trial(simulate(scenario, 3, interpret=wanted)) for wanted in (False, True))
    assert without_wall(compiled) == without_wall(interpreted)


# Trials


def test_a_trial_of_robots_is_run_as_such_and_progress_is_shown_each_step_before_the_observers() -> None:
    scenario = load_scenario("pair")
    expected = run_trial(Simulation(scenario, 4))
    shown, seen = Shown(), []
    result = run_trial(
        simulate(scenario, 4), [lambda step, _: seen.append((step.number, len(shown.cycles)))], progress=shown
    )
    assert without_wall(result) == without_wall(expected) == without_wall(run_trial(simulate(scenario, 4)))
    assert shown.times_s == pytest.approx([0.1 * step for step in range(expected.steps)])
    assert shown.cycles[-1] == expected.cycles
    assert seen == [(step, step + 1) for step in range(expected.steps)]


def test_a_trial_of_particles_is_run_as_such_and_progress_is_shown_the_swarm_now_and_then() -> None:
    scenario = load_scenario("particles")
    expected = run_trial(ParticleSimulation(scenario, 4))
    shown = Shown()
    result = run_trial(simulate(scenario, 4), progress=shown)
    assert without_wall(result) == without_wall(expected)
    assert shown.cycles[-1] == expected.cycles
    assert shown.times_s[-1] == expected.simulated_s
    assert shown.cycles == sorted(shown.cycles)


def test_progress_of_a_long_trial_is_shown_more_than_once() -> None:
    scenario = load_scenario("particles", ["response.coupling=0", "stop.max_cycles=20000"])
    shown = Shown()
    run_trial(simulate(scenario, 4), progress=shown)
    assert len(shown.cycles) > 3
    assert (shown.cycles == sorted(shown.cycles), shown.cycles[-1]) == (True, 20000)


def test_every_observer_is_shown_the_swarm_and_its_event_in_turn() -> None:
    seen: list[tuple[str, float, int]] = []

    def watch(name: str):
        return lambda event, swarm: seen.append((name, event.time_s, swarm.cycles))

    model = simulate(load_scenario("particles", ["stop.max_cycles=3"]), 1)
    run_trial(model, [watch("a"), watch("b")])
    firsts, seconds = seen[::2], seen[1::2]
    assert {name for name, *_ in firsts} == {"a"}
    assert [rest for _, *rest in firsts] == [rest for _, *rest in seconds]
    times = [time for _, time, _ in firsts]
    assert times == sorted(times)
    assert firsts[-1][2] == 3
