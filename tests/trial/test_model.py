"""Claims about models and their trials: each is made and run as what it is, and shows how far it is."""

import math
import multiprocessing
import time
from types import SimpleNamespace
from typing import Annotated, Any, Literal

import numba
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from pydantic import Field

import epuck_sim
from epuck_sim import ParticleSimulation, Scenario, ScenarioError, Simulation, load_scenario, points, run_trial
from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.order_parameter import METRICS, Firing
from epuck_sim.page.robots import check_robots
from epuck_sim.page.writer import write_page
from epuck_sim.runs.compatibility import check_same_sweep, stored_point
from epuck_sim.scenario.base import Number
from epuck_sim.scenario.loader import SCENARIO_TYPES, write_scenario
from epuck_sim.scenario.particles import ParticleStop
from epuck_sim.scenario.scenario import StopSection
from epuck_sim.sweep.scheduler import local_pool
from epuck_sim.trial import particles
from epuck_sim.trial.measuring import Measuring
from epuck_sim.trial.model import MODELS, Model, register_model, simulate
from epuck_sim.trial.result import WINDOW, TrialResult, TrialState, _of_random_phases, hopelessness_watch, is_hopeless
from epuck_sim.util.yaml_io import parse_yaml
from tests.particles.simulations import KINDS, any_sections, make_resting, make_simulation
from tests.trial import without_wall


@pytest.mark.parametrize("name", ["pair", "particles"])
@pytest.mark.parametrize("entry", [-1, 1, 0.0])
def test_an_entry_that_a_schedule_does_not_have_is_refused(name: str, entry: float) -> None:
    simulation = simulate(load_scenario(name, ["schedule=[{at_s: 1, displace: {by_cycles: 0.1}}]"]), 1)
    with pytest.raises(ValueError, match=rf"entry is {entry}; allowed: 0 to 0"):
        simulation.carry_out_scheduled(entry)


@pytest.mark.parametrize("name", ["pair", "particles"])
def test_one_thread_at_a_time_takes_steps_and_none_is_taken_by_an_observer(name: str) -> None:
    simulation, other = (simulate(load_scenario(name), 1) for _ in range(2))
    with simulation._turn, pytest.raises(ValueError, match="another thread is taking steps"):
        list(zip(range(99), simulation, strict=False))
    for move in (simulation.reset, simulation.__next__):
        simulation.reset()
        with pytest.raises(EpuckSimError, match="an observer or a measure takes steps"):
            run_trial(simulation, [lambda event, _, move=move: event.time_s > 0.3 and move()])
    simulation.reset()
    assert without_wall(run_trial(simulation)) == without_wall(run_trial(other))


@pytest.mark.parametrize("name", ["pair", "particles"])
def test_what_is_compiled_within_a_trial_is_not_of_its_time(name: str) -> None:
    spent_s: list[float] = []

    def compile_anew(*_: object) -> None:
        began = time.perf_counter()
        if not spent_s:
            numba.njit(lambda number: math.sin(number) + 1)(1.0)
            spent_s.append(time.perf_counter() - began)

    simulation, began = simulate(load_scenario(name, ["stop.max_cycles=2"]), 3), time.perf_counter()
    result = run_trial(simulation, [compile_anew])
    assert result.wall_s < time.perf_counter() - began - spent_s[0] / 2


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
    with pytest.raises(TypeError, match=r"a trial needs a simulation, such as Simulation\('thesis', seed=1\)"):
        run_trial(name)
    times_s.clear()
    run_trial(simulate(scenario, 4), [lambda *_: seen.append(len(times_s))], progress=show)
    assert len(seen) == len(times_s)
    if name == "pair":
        assert times_s == pytest.approx([0.1 * step for step in range(expected.steps)])
        assert seen == list(range(1, expected.steps + 1))


@pytest.mark.parametrize(("name", "settings"), [("thesis", []), ("particles", ["speed_cm_s=50", "count=6"])])
def test_synchrony_at_the_very_limit_of_cycles_is_not_censored(name: str, settings: list[str]) -> None:
    free = run_trial(simulate(load_scenario(name, settings), 2))
    assert free.t_sync_cycles > 1
    limits = ([*settings, f"stop.max_cycles={limit}"] for limit in (free.cycles, free.cycles - 1))
    limited, stopped = (run_trial(simulate(load_scenario(name, each), 2)) for each in limits)
    assert without_wall(limited) == without_wall(free)
    assert (stopped.censored, stopped.t_sync_cycles, stopped.cycles) == (True, None, free.cycles - 1)


@pytest.mark.parametrize("metric", ["complex", "reference"])
def test_one_oscillator_alone_is_never_synchronised(metric: str) -> None:
    stop, rules = ["stop.max_cycles=5", f"stop.metric={metric}"], ("nearest", "all", "cone_of_vision, angle_deg: 90")
    alone = [["agents.count=1", f"neighbourhood={{kind: {rule}}}"] for rule in rules]
    for name, one in (("thesis", ["robots.0.count=1"]), *(("particles", each) for each in alone)):
        result = run_trial(simulate(load_scenario(name, [*one, *stop]), 1))
        assert (result.censored, result.t_sync_cycles, result.cycles, result.order_parameter) == (True, None, 5, 1)


AGENTS = {"model": "particles", "agents": {"count": 10}, "space": {"side_cm": 60}, "start": {"like": "thesis"}}


@pytest.mark.parametrize("seed", [0, 5])
def test_agents_start_where_the_robots_of_a_trial_with_the_same_seed_do(seed):
    robots = Simulation("thesis", seed)
    placed = robots.last_step
    assert placed.number == -1
    assert robots.steps == 0
    agents = simulate(load_scenario(AGENTS), seed)
    assert agents.positions().tobytes() == np.ascontiguousarray(placed.poses[:, :2]).tobytes()
    assert agents.scenario.start.phases == tuple((placed.phase_ms / 5000).tolist())
    np.testing.assert_allclose(agents.phases(), placed.phase_ms / 5000, atol=1e-15)  # agents keep when they fire
    x, y = np.array(agents.scenario.start.headings).T
    assert np.abs((np.arctan2(y, x) - placed.poses[:, 2] + np.pi) % (2 * np.pi) - np.pi).max() < 1e-14
    by_hand = ParticleSimulation({**AGENTS, "start": epuck_sim.start_like("thesis", seed)}, seed)
    assert by_hand.positions().tobytes() == agents.positions().tobytes()
    assert run_trial(by_hand).cycles == run_trial(agents).cycles
    assert next(iter(robots)).number == 0


def test_trials_differ_in_their_starts_and_sweeps_keep_the_key():
    scenario = load_scenario(AGENTS)
    with pytest.raises(ScenarioError, match=r"for a ParticleSimulation, give start_like\(robots, seed\)"):
        ParticleSimulation(AGENTS, 1)
    with pytest.raises(ScenarioError, match="some robots have no phase"):
        epuck_sim.start_like({"robots": [{"controller": "constant"}]}, 1)
    one, other = (simulate(scenario, seed).positions() for seed in (1, 2))
    assert (one != other).any()
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario
    swept = points(load_scenario(AGENTS, axes=["agents.speed_cm_s=1,2"]))
    assert [point.scenario.start.like for point in swept] == ["thesis"] * 2


def test_files_of_robots_are_found_beside_the_scenario(tmp_path):
    (tmp_path / "robots.yaml").write_text("robots: [{count: 3}]\n")
    agents = "model: particles\nagents: {count: 3}\nneighbourhood: {kind: all}\nspace: {side_cm: 60}\n"
    (tmp_path / "agents.yaml").write_text(f"{agents}start: {{like: robots.yaml}}\n")
    scenario = load_scenario(tmp_path / "agents.yaml")
    assert scenario.start.like == str(tmp_path / "robots.yaml")
    robots = Simulation(str(tmp_path / "robots.yaml"), 1)
    assert simulate(scenario, 1).positions().tolist() == robots.last_step.poses[:, :2].tolist()
    axis = points(load_scenario(tmp_path / "agents.yaml", axes=["start.like=robots.yaml"]))
    assert [point.scenario.start.like for point in axis] == [str(tmp_path / "robots.yaml")]
    before = stored_point(axis[0])
    (tmp_path / "robots.yaml").write_text("robots: [{count: 3, placement: grid}]\n")
    with pytest.raises(StoreError, match=r"start.like: 'robots.yaml with digest"):
        check_same_sweep(tmp_path, [before], [stored_point(axis[0])])


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("oscillators", [2, 3, 10, 200])
def test_the_order_of_random_phases_is_that_of_phases_drawn_at_random(metric: str, oscillators: int) -> None:
    phases = np.random.default_rng(1).uniform(size=(20_000, oscillators))
    phases[:, 0] = 0.0  # the reference fires
    orders = METRICS[metric](phases, 1.0)
    mean, deviation = _of_random_phases(oscillators, metric)
    assert mean == pytest.approx(orders.mean(), abs=0.02 * orders.std() + 0.016 * mean)
    assert deviation == pytest.approx(orders.std(), rel=0.08)


def test_a_new_measure_of_synchrony_is_refused_where_it_is_not_known_instead_of_taken_for_the_complex_one() -> None:
    assert "metric" in ParticleStop.__annotations__  # what is added for robots is not allowed for agents, too
    robots = load_scenario("thesis")
    robots = robots.model_copy(update={"stop": robots.stop.model_copy(update={"metric": "median"})})
    with pytest.raises(ScenarioError, match=r"thesis: stop\.metric: pages know complex and reference"):
        check_robots(robots)
    with pytest.raises(ValueError, match="metric is 'median'; allowed: complex or reference"):
        is_hopeless([0.5], 10, "median")


def test_what_comes_closer_to_synchrony_is_not_hopeless_and_what_stands_still_is() -> None:
    nearer = 1 - 0.5 * 0.99 ** np.arange(WINDOW)
    assert not is_hopeless(nearer, 10)
    assert not is_hopeless(1 - 1e-7 * (1 - nearer), 10)  # however near it is
    assert is_hopeless(np.full(WINDOW, 0.7), 10)
    assert is_hopeless(np.ones(WINDOW), 1)  # one oscillator alone
    threshold, deviation = _of_random_phases(10, "complex")
    threshold += 3.0902 * deviation / math.sqrt(WINDOW)
    swing = 0.1 * (-1.0) ** np.arange(WINDOW)
    assert is_hopeless(threshold - 0.001 + swing, 10)
    assert not is_hopeless(threshold + 0.001 + swing, 10)


def told(orders: list[float], **state: object) -> list[tuple[int, float]]:
    found: list[tuple[int, float]] = []
    now = SimpleNamespace(cycles=0, is_synchronised=False, oscillators=10, **state)
    watch = hopelessness_watch("complex", lambda mean: found.append((now.cycles, mean)))
    for now.order_parameter in orders:
        now.cycles += 1
        watch(now)
        watch(now)  # between two cycles it may be shown the same one again
    return found


def test_a_hopeless_trial_is_told_of_once_from_cycles_on_that_are_enough_as_one_of_robots_hardly_coupled() -> None:
    assert told([0.2] * (WINDOW - 1)) == []
    assert told([0.2] * 5 * WINDOW) == [(WINDOW, pytest.approx(0.2))]
    assert told([0.9, 0.7] * WINDOW + [0.2] * 5 * WINDOW) == [(3 * WINDOW, pytest.approx(0.2))]
    assert told([None] * 5 + [0.2] * WINDOW) == [(WINDOW + 5, pytest.approx(0.2))]
    found: list[float] = []
    simulation = simulate(load_scenario("thesis", ["coupling=1e-6", "max_cycles=201"]), 3)
    run_trial(simulation, progress=hopelessness_watch("complex", found.append))
    assert len(found) == 1


def test_whoever_watches_the_progress_of_point_agents_sees_order_parameters() -> None:
    seen: list[float | None] = []
    scenario = load_scenario("particles", ["coupling=1e-6", "max_cycles=30000"])
    run_trial(simulate(scenario, 3), progress=lambda state: seen.append(state.order_parameter))
    assert 2 * sum(order is not None for order in seen) >= len(seen) > 2


THRESHOLD = 1 - 1e-9


def test_t_sync_counts_the_references_firings_from_1_the_last_one_too():
    natural = make_resting([0.9, 0.85], stop={"order_parameter": THRESHOLD})  # it makes the other one fire
    elicited = make_resting([0.85, 0.9], stop={"order_parameter": THRESHOLD})  # the other one makes it fire
    for swarm in (natural, elicited):
        result = run_trial(swarm)
        assert (result.t_sync_cycles, result.cycles, result.steps, result.censored) == (1, 1, 1, False)
        assert result.simulated_s == pytest.approx(0.1)
        assert result.order_parameter == 1


def test_synchronised_is_the_threshold_reached_also_by_many_at_a_threshold_of_1():
    for threshold, synchronised in ((0.8, True), (0.82, False)):
        stop = {"order_parameter": threshold, "max_cycles": 3}
        result = run_trial(make_resting([0.9, 0.7], response={"coupling": 0}, stop=stop))  # cos(0.2 pi) = 0.809
        assert result.censored != synchronised
        assert (result.t_sync_cycles, result.cycles) == ((1, 1) if synchronised else (None, 3))
    sections = {"response": {"coupling": 0}, "neighbourhood": {"kind": "nearest"}, "stop": {"order_parameter": 1.0}}
    swarm = make_resting([0.9] * 9_999 + [0.9 - 1.5e-7], **sections)
    swarm.run(1)
    assert swarm.is_synchronised == (swarm.order_parameter >= 1.0)


@pytest.mark.parametrize("max_cycles", [1, 7, 1000])
def test_a_trial_is_censored_once_the_reference_has_fired_max_cycles_times(max_cycles):
    swarm = make_simulation(response={"coupling": 0}, stop={"order_parameter": THRESHOLD, "max_cycles": max_cycles})
    first = 1 - swarm.phases()[0]
    result = run_trial(swarm)
    assert (result.censored, result.t_sync_cycles, result.cycles) == (True, None, max_cycles)
    assert result.simulated_s == pytest.approx(first + max_cycles - 1)
    assert result.order_parameter < THRESHOLD
    assert result.steps == swarm.instants


def silenced(**stop):
    """Return a swarm whose reference, in the middle, is set back to 0 by three others and never fires.

    They are nearest to nobody, and a third of a cycle apart.
    """
    round_it = [[50 + 10 * math.cos(a), 50 + 10 * math.sin(a)] for a in (0, 2 * math.pi / 3, 4 * math.pi / 3)]
    phases, response = [0.1, 0.9, 0.9 - 1 / 3, 0.9 - 2 / 3], {"curve": "sawtooth", "coupling": 1.0}
    sections = {"neighbourhood": {"kind": "nearest"}, "stop": {"order_parameter": THRESHOLD, **stop}}
    return make_resting(phases, [[50.0, 50.0], *round_it], response=response, **sections)


def test_a_trial_whose_reference_never_fires_lasts_twice_max_cycles_observed_or_not_at_any_pace(monkeypatch):
    alone = run_trial(silenced(max_cycles=20))
    assert (alone.censored, alone.cycles, alone.order_parameter) == (True, 0, None)
    assert alone.simulated_s == pytest.approx(40, abs=1.01)
    watched = run_trial(silenced(max_cycles=20), [lambda _event, _swarm: None])
    monkeypatch.setattr(particles, "SLICE_S", 0.0)
    slowly = run_trial(silenced(max_cycles=20))
    assert without_wall(alone) == without_wall(watched) == without_wall(slowly)


@given(st.data(), st.integers(0, 2**32 - 1), st.sampled_from(KINDS))
@settings(max_examples=12)
def test_a_trial_is_the_same_with_observers_and_at_any_pace(data, seed, kind):
    sections = data.draw(any_sections(kind, most_agents=8))
    sections["stop"] |= {"max_cycles": 15}
    plain = make_simulation(seed, **sections)
    alone = run_trial(plain)
    if alone.cycles < 15 and alone.censored:
        return  # see above
    seen, shown = [], []
    look = [lambda event, swarm: seen.append((swarm.cycles, len(event.fired)))]
    watched = run_trial(make_simulation(seed, **sections), look)
    followed = run_trial(make_simulation(seed, **sections), progress=lambda swarm: shown.append(swarm.cycles))
    assert without_wall(watched) == without_wall(followed) == without_wall(alone)
    assert sum(fired > 0 for _, fired in seen) == alone.steps
    assert seen[-1][0] == shown[-1] == alone.cycles
    assert sum(fired for _, fired in seen) == plain.firings


@pytest.mark.parametrize("more", [{"clocks": {"jitter": 0.1}}, {"start": {"phases": "synchronised"}}])
def test_slices_of_a_large_swarm_are_few_pulses_even_where_all_fire_at_once(more):
    """A cycle of 20,000 agents, each of which reaches 10,000, takes many seconds; Ctrl-C is heard between slices."""
    agents, neighbourhood = {"count": 20_000, "speed_cm_s": 1.0}, {"kind": "nearest", "k": 10_000}
    swarm, instants = make_simulation(1, agents=agents, neighbourhood=neighbourhood, **more), []

    def interrupt(state):
        instants.append(state.instants)
        if len(instants) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_trial(swarm, progress=interrupt)
    assert instants[-1] < 100


# A third model, of thirty lines: it is read, run, swept, stored and summarised as the others


class DiceScenario(Scenario):
    """A swarm that is synchronised once a die says so."""

    model: Literal["dice"]
    chance: Annotated[Number, Field(gt=0, le=1)] = 0.2
    stop: StopSection = StopSection(order_parameter=0.95, max_cycles=50)

    @property
    def population(self) -> int:
        return 1


class Dice:
    """Throws once a cycle; it is its own TrialState."""

    def __init__(self, scenario: DiceScenario, seed: int) -> None:
        self.scenario, self.seed = scenario, seed
        self.random = np.random.default_rng(seed)
        self.time_s, self.cycles, self.order_parameter, self.is_synchronised = 0.0, 0, None, False

    @property
    def outcome(self) -> Firing:
        return Firing(self.cycles, self.order_parameter)


def run(dice: Dice, observers: Any, _: Any, measuring: Measuring) -> TrialResult:
    while not (dice.is_synchronised or dice.cycles >= dice.scenario.stop.max_cycles or measuring.is_over()):
        dice.cycles, dice.time_s = dice.cycles + 1, dice.time_s + 1.0
        dice.is_synchronised = bool(dice.random.random() < dice.scenario.chance)
        for observer in (*observers, *measuring.at_cycles):
            observer(dice.cycles, dice)
    t_sync = dice.cycles if dice.is_synchronised else None
    numbers = dice.cycles, None, dice.cycles, dice.time_s, 1e-3
    return TrialResult(dice.scenario.name, dice.seed, t_sync, t_sync is None, *numbers)


MODEL = Model(DiceScenario, lambda scenario, seed, _: Dice(scenario, seed), run, lambda _: None)

if multiprocessing.parent_process() is not None:  # a worker, which has to know the model to which a task belongs
    register_model("dice", MODEL)


def test_a_third_model_is_swept_by_worker_processes_stored_and_summarised_and_no_page(tmp_path, monkeypatch) -> None:
    for table in (SCENARIO_TYPES, MODELS):  # for this test alone: others list the models there are
        monkeypatch.setitem(table, "dice", None)
    register_model("dice", MODEL)
    dice = {"name": "dice", "model": "dice"}
    with pytest.raises(ScenarioError, match="dice: model: pages run embodied and particles alone; use `epuck-sim run`"):
        write_page(dice, tmp_path / "page.html")
    sweep = {**dice, "trials": 20, "seed": 3, "sweep": {"grid": {"chance": [0.1, 0.5]}}}
    progress = epuck_sim.run_sweep(sweep, tmp_path / "run", lambda: local_pool(1))
    assert (progress.stored, progress.failed) == (40, 0)
    stored = epuck_sim.read_points(tmp_path / "run")
    for point, results in zip(points(load_scenario(sweep)), stored, strict=True):
        expected = [run_trial(simulate(point.scenario, point.seed(trial))) for trial in range(20)]
        assert results.times.tolist() == [result.cycles for result in expected]
        assert results.observed.tolist() == [not result.censored for result in expected]
    slow, fast = epuck_sim.summarize(stored)
    assert slow.estimates["mean"].value > 2 * fast.estimates["mean"].value
