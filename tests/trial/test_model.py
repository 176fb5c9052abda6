"""Claims about models and their trials: each is made and run as what it is, and shows how far it is."""

import pytest

from epuck_sim import ParticleSimulation, ScenarioError, Simulation
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.trial.result import TrialState
from tests.trial import without_wall


def test_robots_are_interpreted_if_wanted_and_particles_have_nothing_to_interpret() -> None:
    scenario = load_scenario("pair", ["stop.max_cycles=2"])
    compiled, interpreted = (run_trial(simulate(scenario, 3, interpret=wanted)) for wanted in (False, True))
    assert without_wall(compiled) == without_wall(interpreted)
    with pytest.raises(ScenarioError, match="model: particles has no controllers to interpret; leave --interpret out"):
        simulate(load_scenario("particles"), 0, interpret=True)


@pytest.mark.parametrize(("name", "kind"), [("pair", Simulation), ("particles", ParticleSimulation)])
def test_a_trial_is_run_as_its_model_s_once_and_progress_is_shown_before_observers(name: str, kind: type) -> None:
    scenario = load_scenario(name)
    simulation = simulate(scenario, 4)
    assert type(simulation) is kind
    expected = run_trial(kind(scenario, 4))
    times_s, cycles, seen = [], [], []

    def show(state: TrialState) -> None:
        times_s.append(state.time_s)
        cycles.append(state.cycles)

    result = run_trial(simulation, progress=show)
    assert without_wall(result) == without_wall(expected)
    assert (result.scenario, result.seed) == (name, 4)
    assert result.real_time_factor == pytest.approx(result.simulated_s / result.wall_s)
    assert (cycles, cycles[-1]) == (sorted(cycles), expected.cycles)
    with pytest.raises(ValueError, match="a trial needs a fresh simulation"):
        run_trial(simulation)
    times_s.clear()
    run_trial(simulate(scenario, 4), [lambda *_: seen.append(len(times_s))], progress=show)
    assert len(seen) == len(times_s)
    if name == "pair":
        assert times_s == pytest.approx([0.1 * step for step in range(expected.steps)])
        assert seen == list(range(1, expected.steps + 1))


def test_what_is_no_simulation_is_refused() -> None:
    with pytest.raises(TypeError, match=r"a trial is of a simulation, such as Simulation\('thesis', seed=1\)"):
        run_trial("thesis")


@pytest.mark.parametrize(
    ("name", "settings"), [("thesis", []), ("particles", ["agents.speed_cm_s=50", "agents.count=6"])]
)
def test_synchrony_at_the_very_limit_of_cycles_is_not_censored(name: str, settings: list[str]) -> None:
    free = run_trial(simulate(load_scenario(name, settings), 2))
    assert free.t_sync_cycles > 1
    limited, stopped = (
        run_trial(simulate(load_scenario(name, [*settings, f"stop.max_cycles={limit}"]), 2))
        for limit in (free.cycles, free.cycles - 1)
    )
    assert without_wall(limited) == without_wall(free)
    assert (stopped.censored, stopped.t_sync_cycles, stopped.cycles) == (True, None, free.cycles - 1)


@pytest.mark.parametrize("metric", ["complex", "reference"])
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("thesis", ["robots.0.count=1"]),
        *(
            ("particles", ["agents.count=1", f"neighbourhood={{kind: {rule}}}"])
            for rule in ("nearest", "all", "cone_of_vision, angle_deg: 90")
        ),
    ],
)
def test_one_oscillator_alone_is_never_synchronised(name: str, settings: list[str], metric: str) -> None:
    stop = ["stop.max_cycles=5", f"stop.metric={metric}"]
    result = run_trial(simulate(load_scenario(name, [*settings, *stop]), 1))
    assert (result.censored, result.t_sync_cycles, result.cycles, result.order_parameter) == (True, None, 5, 1)
