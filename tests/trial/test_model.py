"""Claims about models and their trials: each model is known by its name, written, read, made and run as what it is."""

import itertools

import pytest

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ScenarioError
from epuck_sim.particles.simulation import Event, ParticleSimulation
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.validation import SCENARIO_TYPES, validate
from epuck_sim.scenario.yaml_io import parse_yaml, read_yaml
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.trial.observer import TrialState
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.builtin import ARENAS, SWEEPS, builtin_files

SHIPPED = {**builtin_files(ARENAS), **builtin_files(SWEEPS)}
OF_PARTICLES = [name for name, path in SHIPPED.items() if read_yaml(path).get("model") == "particles"]


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


@pytest.mark.parametrize(
    ("model", "shown"),
    [
        ("quantum", "'quantum'"),
        ("Particles", "'Particles'"),
        ("", "''"),
        (None, "None"),
        (5, "5"),
        (0.5, "0.5"),
        (True, "True"),
        (["particles"], "['particles']"),
        ({"particles": 1}, "{'particles': 1}"),
    ],
)
def test_a_model_that_is_none_is_refused_with_those_there_are(model: object, shown: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        validate({"model": model, "seed": -1}, "here")
    assert str(caught.value) == f"here: model: is {shown}; allowed: 'embodied' or 'particles'"


@pytest.mark.parametrize(("model", "place"), [("embodied", "stop.reference"), ("particles", "stop.reference_robot")])
def test_a_key_of_the_other_model_is_refused_as_such(model: str, place: str) -> None:
    with pytest.raises(ScenarioError, match=f"here: {place}: belongs to model: {({*SCENARIO_TYPES} - {model}).pop()}"):
        validate({"model": model, "stop": {place.removeprefix("stop."): 0}}, "here")


def test_every_line_of_what_is_refused_begins_with_the_origin() -> None:
    with pytest.raises(ScenarioError) as caught:
        validate({"model": "particles", "seed": -1, "agents": {"count": 0}, "robots": []}, "here")
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    assert all(line.startswith("here: ") for line in lines)


def test_there_are_shipped_sweeps_of_particles_and_of_robots() -> None:
    assert len(OF_PARTICLES) >= 15
    assert len(SHIPPED) - len(OF_PARTICLES) >= 10


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("name", [name for name in OF_PARTICLES if name != "particles"])
def test_a_shipped_sweep_of_particles_is_the_same_when_it_is_written_and_read_again(name: str, quick: bool) -> None:
    scenario = load_scenario(name, quick=quick)
    assert isinstance(scenario, ParticleScenario)
    assert load_scenario(parse_yaml(write_scenario(scenario), "x")) == scenario
    assert validate(scenario.model_dump(mode="json"), "x") == scenario


@pytest.mark.parametrize("name", ["thesis", "obstacles", "particles"])
def test_a_shipped_arena_is_the_same_when_it_is_written_and_read_again(name: str) -> None:
    scenario = load_scenario(name)
    assert load_scenario(parse_yaml(write_scenario(scenario), "x")) == scenario


@pytest.mark.parametrize(
    "neighbourhood",
    [
        {"kind": "nearest", "k": 3},
        {"kind": "range", "radius_cm": 40},
        {"kind": "cone_of_vision", "angle_deg": 60},
        {"kind": "cone_of_emission", "radius_cm": 3.5, "angle_deg": 360},
        {"kind": "all"},
    ],
)
def test_every_neighbourhood_is_the_same_when_it_is_written_and_read_again(neighbourhood: dict) -> None:
    given = {"model": "particles", "neighbourhood": neighbourhood, "agents": {"reorient_on": ["emitting"]}}
    scenario = load_scenario(given)
    again = load_scenario(parse_yaml(write_scenario(scenario), "x"))
    assert again == scenario
    assert again.neighbourhood.kind == neighbourhood["kind"]


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


@pytest.mark.parametrize("neighbourhood", ["{kind: nearest}", "{kind: cone_of_vision, angle_deg: 90}", "{kind: all}"])
@pytest.mark.parametrize("stop", ["order_parameter=0.999999999", "order_parameter=null"])
def test_a_trial_of_particles_is_the_same_with_and_without_observers_and_progress(
    neighbourhood: str, stop: str
) -> None:
    settings = [f"neighbourhood={neighbourhood}", f"stop.{stop}", "stop.max_cycles=60", "clocks.jitter=0.001"]
    scenario = load_scenario("particles", settings)
    events: list[Event] = []
    looks = [[], [lambda event, _: events.append(event)], [lambda *_: None] * 2]
    results = [
        without_wall(run_trial(simulate(scenario, 8), observers, progress))
        for observers, progress in itertools.product(looks, (None, Shown()))
    ]
    assert results == [results[0]] * 6
    assert sum(event.turned is None for event in events) == 2 * results[0].steps


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
