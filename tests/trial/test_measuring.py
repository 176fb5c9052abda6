"""Measures of a trial: what they are told, that they change nothing, how they fail; what changes and ends trials."""

import json

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import MeasureError, ParticleSimulation, Simulation, load_scenario, read_points, run_sweep
from epuck_sim.embodied.loop import MOST_STEPS
from epuck_sim.measures.measure import SHIPPED, find_measure
from epuck_sim.statistics.statistic import estimate_mean, measure
from epuck_sim.trial import particles
from epuck_sim.trial.measuring import as_value
from epuck_sim.trial.model import run_trial, simulate
from tests.measures.files import COUNTER, TELLTALE, write
from tests.sweep.pool_here import pool_here
from tests.trial import without_wall

SHORT = ["stop.max_cycles=6"]
MODELS = ["thesis", "particles"]

CYCLES = """
class Cycles:
    def __init__(self, simulation):
        self.seen = []

    def cycle(self, event, state):
        self.seen += [event.time_s, state.time_s, state.cycles, state.order_parameter]

    def value(self):
        return self.seen
"""

BATCHES = """
class Batches:
    def __init__(self, simulation):
        self.seen = []

    def batch(self, batch, state):
        for row, (time_s, order) in enumerate(zip(batch.time_s, batch.order_parameter)):
            self.seen += [time_s, time_s, batch.first + row, order]

    def value(self):
        return self.seen
"""

KEEPER = """
class Keeper:
    def __init__(self, simulation):
        self.kept = []

    def METHOD(self, step, state):
        self.kept += [(part, part.copy()) for part in (*step[2:11], *step.memories)]

    def value(self):
        return all((part == copy).all() for part, copy in self.kept)
"""


def measured(scenario, measures, seed=3, observers=(), settings=SHORT):
    loaded = load_scenario(scenario, settings, measures=measures)
    return run_trial(simulate(loaded, seed), observers)


def onlooking(*_) -> None: ...


def without_measures(result):
    return result._replace(measures={}, wall_s=0.0)


@pytest.mark.parametrize("scenario", MODELS)
def test_cycles_are_the_same_whether_or_not_every_event_is_seen(scenario, tmp_path):
    cycles, steps = write(tmp_path / "cycles.py", CYCLES), write(tmp_path / "steps.py", TELLTALE)
    count = write(tmp_path / "count.py", COUNTER)
    plain, counted = measured(scenario, []), measured(scenario, [str(count)])
    assert (plain.measures, counted.measures) == ({}, {"Counter": float(plain.cycles)})
    assert without_measures(counted) == without_measures(plain)
    fast = measured(scenario, [str(cycles)])
    slow = measured(scenario, [str(cycles), str(steps)])
    watched = measured(scenario, [str(cycles)], observers=[onlooking])
    assert fast.measures["Cycles"] == slow.measures["Cycles"] == watched.measures["Cycles"]
    batches = measured(scenario, [str(write(tmp_path / "batches.py", BATCHES))])
    assert batches.measures["Batches"] == pytest.approx(fast.measures["Cycles"], rel=1e-12)
    assert len(fast.measures["Cycles"]) == 4 * fast.cycles
    assert fast.measures["Cycles"][-1] == fast.order_parameter
    assert without_measures(slow) == without_measures(fast)


@pytest.mark.parametrize("method", ["cycle", "step"])
def test_a_measure_may_keep_the_arrays_of_cycles_and_steps(method, tmp_path):
    keeper = write(tmp_path / "keeper.py", KEEPER.replace("METHOD", method))
    assert measured("thesis", [str(keeper)]).measures["Keeper"]


@pytest.mark.parametrize("scenario", MODELS)
def test_a_measure_is_told_of_every_event_as_observers_are(scenario, tmp_path):
    seen = []
    key = (lambda step: step.number) if scenario == "thesis" else (lambda event: len(event.fired))
    path = write(tmp_path / "mine.py", TELLTALE)
    result = measured(scenario, [str(path)], observers=[lambda event, _: seen.append(key(event))])
    assert result.measures["Telltale"] == seen
    assert len(seen) > result.cycles


@pytest.mark.parametrize("hz", [10, 25, 40])
def test_cycles_of_robots_without_oscillators_last_five_seconds(hz, tmp_path):
    path = write(tmp_path / "mine.py", CYCLES)
    settings = [*SHORT, "robots.0={controller: obstacle_avoidance}", f"timing.control_hz={hz}", "timing.physics_hz=200"]
    fast = measured("thesis", [str(path)], settings=settings).measures["Cycles"]
    assert fast[::4] == pytest.approx([5 * cycle - 1 / hz for cycle in range(1, 7)])
    assert fast[2::4] == list(range(1, 7))
    assert fast[3::4] == [None] * 6
    slow = measured("thesis", [str(path)], settings=settings, observers=[onlooking])
    assert slow.measures["Cycles"] == fast


@pytest.mark.parametrize("scenario", MODELS)
def test_a_function_is_called_with_the_simulation_at_the_end_and_its_error_has_a_class(scenario, tmp_path):
    path = write(tmp_path / "mine.py", "def product(simulation, *, factor=2): return factor * simulation.seed")
    assert measured(scenario, [str(path)], seed=21).measures == {"product": 42}
    wrong = write(tmp_path / "wrong.py", "def wrong(simulation): return 1 / 0")
    with pytest.raises(MeasureError, match="ZeroDivisionError"):
        measured(scenario, [str(wrong)])


def test_a_value_is_a_number_of_python_a_truth_value_or_none_and_so_are_those_of_lists():
    assert repr(as_value((np.bool_(True), np.float32(0.5), np.nan))) == "[True, 0.5, None]"
    assert repr(as_value(np.array([1.0, np.nan]))) == "[1.0, None]"


TOLD = [name for name in SHIPPED if hasattr(find_measure(name).make, "stretch")]

BASE = {
    "robots": [{"count": 6, "parameters": {"speed_cm_s": 8.0, "period_s": 2.0}}],
    "arena": {"width_cm": 35, "height_cm": 35},
    "stop": {"order_parameter": 1.0, "max_cycles": 12},
}

DEAD = {"kind": "ring_dead", "robots": [1], "at_s": 3.05}
MOVABLE = {"x_cm": 17, "y_cm": 17, "radius_cm": 2, "mass_kg": 0.1, "friction": 0.5}

CASES = {
    "plain": {},
    "faults": {"faults": [DEAD, {"kind": "oscillator_frozen", "robots": [2], "at_s": 5, "until_s": 9}]},
    "movables": {"arena": {**BASE["arena"], "movables": [MOVABLE]}},
    "schedule": {"schedule": [{"at_s": 4.3, "set": {"arena.width_cm": 60}}]},
    "groups": {"robots": [*BASE["robots"], {"count": 2, "signal": {"kind": "cone"}}]},
    "no oscillators": {"robots": [{"count": 6, "controller": "obstacle_avoidance"}], "stop": {"max_time_s": 30}},
}


def values(case: str, observers=(), *, interpret: bool = False) -> dict:
    """Return the values of all measures that are told of stretches, in a trial of a case."""
    sections = {**BASE, **CASES[case], "measures": TOLD}
    return run_trial(simulate(load_scenario(sections), 3, interpret=interpret), observers)


@pytest.mark.parametrize("case", CASES)
def test_they_find_what_they_find_step_by_step_and_where_controllers_are_interpreted(case: str) -> None:
    at_once, one_by_one = values(case), values(case, [onlooking])
    assert at_once.steps == one_by_one.steps > 2 * MOST_STEPS
    for name, value in at_once.measures.items():
        found, expected = np.array(value, float), np.array(one_by_one.measures[name], float)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12, err_msg=name)
    assert without_measures(at_once) == without_measures(one_by_one)
    assert values(case, interpret=True).measures == at_once.measures


OF_AGENTS = [name for name in SHIPPED if hasattr(find_measure(name).make, "batch")]

AGENT_CASES = {
    "plain": {},
    "walks in a cube": {"agents.walk": {"kind": "brownian", "run_s": 20}, "space.dimensions": 3},
    "cones": {"neighbourhood": {"kind": "cone_of_vision", "angle_deg": 150}, "clocks.jitter": 0.02},
    "changes": {
        "schedule": [
            {"at_s": 310, "set": {"neighbourhood.k": 3, "agents.speed_cm_s": 9}},
            {"at_s": 333.3, "displace": {"by_cycles": 0.3, "agents": [2]}},
        ],
    },
    "a change at a cycle": {"schedule": [{"at_cycle": 170, "set": {"neighbourhood.k": 3}}]},
    "ends by a measure": {"stop.when": "degree < 0", "stop.max_cycles": 40},
}


@pytest.mark.parametrize("case", AGENT_CASES)
def test_many_cycles_at_once_are_as_one_by_one_and_as_those_of_short_slices(case: str, monkeypatch) -> None:
    names = [name for name in OF_AGENTS if not (name.startswith("perturb") and case == "a change at a cycle")]
    measures = [{name: {"displacement": 1e-6}} if name.startswith("perturb") else name for name in names]
    given = {"agents.speed_cm_s": 4.0, "stop": {"order_parameter": None, "max_cycles": 300}, **AGENT_CASES[case]}
    changes = [f"{key}={json.dumps(value)}" for key, value in given.items()]
    scenario = load_scenario({"model": "particles", "measures": measures}, changes)
    at_once, one_by_one = (run_trial(simulate(scenario, 3), observers) for observers in ([], [onlooking]))
    monkeypatch.setattr(particles, "FIRST_SLICE", 1)
    in_slices = run_trial(simulate(scenario, 3))
    assert without_wall(at_once) == without_wall(one_by_one) == without_wall(in_slices)
    assert at_once.cycles >= 40
    assert len(at_once.measures) == len(names) > 15


def test_a_trial_that_is_broken_off_records_no_more() -> None:
    def interrupt(_) -> None:
        raise KeyboardInterrupt

    stop = {"order_parameter": None, "max_cycles": 1000}
    simulation = simulate(load_scenario({"model": "particles", "stop": stop, "measures": ["degree"]}), 3)
    with pytest.raises(KeyboardInterrupt):
        run_trial(simulation, progress=interrupt)
    simulation.run(500)
    assert simulation.cycles == 500


STOP = {"max_cycles": 12, "order_parameter": None}
SCHEDULE = [
    {"at_cycle": 3, "set": {"robots.0.parameters.speed_cm_s": 0}},
    {"at_cycle": 5, "displace": {"by_cycles": "random"}},
    {"at_s": 30, "set": {"robots.0.parameters.speed_cm_s": 5}},
]


class Firings:
    def __init__(self):
        self.steps, self.orders, self.ahead = {}, {}, []

    def __call__(self, step, state):
        if state.cycles not in self.steps:
            self.steps[state.cycles], self.orders[state.cycles] = step.number, state.order_parameter
        self.ahead.append((step.wheels_cm_s == 12.8).all(axis=1).any())  # robots that turn finish their turn


def test_changes_after_a_cycle_act_in_the_next_step_whether_trials_are_observed_or_not():
    scenario = load_scenario({"schedule": SCHEDULE, "stop": STOP})
    seen, seed = Firings(), 4
    observed = run_trial(Simulation(scenario, seed), [seen])
    alone = run_trial(Simulation(scenario, seed))
    for other in (observed, run_trial(Simulation(scenario, seed, interpret=True))):
        assert other._replace(wall_s=0) == alone._replace(wall_s=0)
    steps = [event.step for event in sorted(alone.events, key=lambda event: event.source)]
    assert steps == [seen.steps[3] + 1, seen.steps[5] + 1, 300]
    assert seen.ahead[steps[0] - 1]
    assert not any(seen.ahead[steps[0] :])


AGENTS = {"model": "particles", "agents": {"count": 6, "speed_cm_s": 20}, "stop": STOP}


@pytest.mark.parametrize("given", [{"stop": STOP}, AGENTS], ids=["robots", "agents"])
def test_the_phases_that_a_cycle_displaces_were_in_the_order_that_was_measured_at_it(given):
    orders = []
    for schedule in ([], [{"at_cycle": 5, "displace": {"by_cycles": "random"}}]):
        seen, scenario = {}, load_scenario({**given, "schedule": schedule, "measures": ["order_parameter"]})
        look = [lambda _, state, seen=seen: seen.update({state.cycles: state.order_parameter})]
        run_trial(simulate(scenario, 4), look)
        orders.append(seen)
    assert [orders[0][cycle] for cycle in range(6)] == [orders[1][cycle] for cycle in range(6)]
    assert orders[0][6] != orders[1][6]


STILL = {"set": {"robots.0.parameters.speed_cm_s": 0}}


@pytest.mark.parametrize(("for_cycles", "measures"), [(1, []), (3, []), (3, ["order_parameter"]), (None, [])])
def test_a_condition_must_hold_at_firings_in_a_row(for_cycles, measures):
    schedule = [{"when": "order_parameter >= 0.6", "for_cycles": for_cycles, **STILL}]
    stop = {"max_cycles": 60, "order_parameter": None}
    scenario, for_cycles = load_scenario({"schedule": schedule, "stop": stop, "measures": measures}), for_cycles or 1
    seen = Firings()
    result = run_trial(Simulation(scenario, 1), [seen])
    rows = [cycle for cycle in seen.orders if cycle >= for_cycles]
    first = next(cycle for cycle in rows if all(seen.orders[cycle - back] >= 0.6 for back in range(for_cycles)))
    assert [event.step for event in result.events] == [seen.steps[first] + 1]


STEPS = TELLTALE.replace("return self.seen", "return len(self.seen) % 120")  # less than 60, then more, by turns


def test_a_condition_on_a_measure_of_steps_acts_in_the_next_one_or_after_firings_in_a_row(tmp_path):
    (tmp_path / "mine.py").write_text(STEPS)
    measures = [str(tmp_path / "mine.py")]
    schedule = [
        {"when": "Telltale >= 60", **STILL},
        {"when": "Telltale >= 60", "for_cycles": 1, "displace": {"by_cycles": 0.1}},
        {"when": {"measure": "Telltale", "relation": ">=", "value": 60}, "for_cycles": 9, **STILL},
    ]
    scenario, seen = load_scenario({"schedule": schedule, "stop": STOP, "measures": measures}), Firings()
    steps = {event.source: event.step for event in run_trial(Simulation(scenario, 3), [seen]).events}
    holds = [step for cycle, step in seen.steps.items() if cycle and (step + 1) % 120 >= 60]
    assert steps == {"schedule.0": 60, "schedule.1": holds[0] + 1}
    assert holds[0] > 60


CHANGES = [
    {"at_cycle": 3, "set": {"agents.speed_cm_s": 0, "neighbourhood.k": 2}},
    {"at_cycle": 5, "displace": {"by_cycles": "random"}},
    {"at_s": 7.3, "set": {"response.coupling": 0.3}},
    {"when": "order_parameter > 0.5", "for_cycles": 2, "displace": {"agents": [1], "by_cycles": 0.4}},
]


@pytest.mark.parametrize("end", [{}, {"max_time_s": 9.1}, {"when": "order_parameter > 0.97"}])
@pytest.mark.parametrize("seed", range(2))
def test_swarms_change_at_the_same_instants_whether_trials_are_observed_or_not(seed, end):
    scenario = load_scenario({**AGENTS, "schedule": CHANGES, "stop": {**STOP, **end}})
    alone = run_trial(ParticleSimulation(scenario, seed))
    cycles = {}
    look = [lambda _, state: cycles.setdefault(state.cycles, (state.time_s, state))]
    observed = run_trial(ParticleSimulation(scenario, seed), look)
    assert observed._replace(wall_s=0) == alone._replace(wall_s=0)
    times = {event.source: event.time_s for event in alone.events}
    assert alone.cycles < 5 or times["schedule.1"] == cycles[5][0]
    assert times["schedule.0"] == cycles[3][0]
    assert times.get("schedule.2", 7.3) == 7.3
    assert (alone.simulated_s == 9.1) == ("max_time_s" in end)


def test_a_displacement_may_bring_a_firing_before_the_end_of_a_trial():
    """Without it, the next firing would be after the end; with it, agent 1 fires before."""
    given = {"model": "particles", "agents": {"count": 2, "speed_cm_s": 0}, "start": {"phases": [0.0, 0.1]}}
    schedule = [{"at_s": 0.4, "displace": {"agents": [1], "by_cycles": 0.4}}]
    scenario = load_scenario({**given, "schedule": schedule, "stop": {"order_parameter": None, "max_time_s": 0.55}})
    seen = []
    for observers in ([], [lambda event, _: seen.append(event.fired.tolist())]):
        result = run_trial(ParticleSimulation(scenario), observers)
        assert (result.steps, result.simulated_s, len(result.events)) == (1, 0.55, 1)
    assert seen == [[], [1]]


def test_a_condition_on_a_measure_of_events_changes_a_swarm_at_the_event(tmp_path):
    (tmp_path / "mine.py").write_text(STEPS)
    schedule = [{"when": "Telltale >= 8", "set": {"agents.speed_cm_s": 0}}]
    scenario = load_scenario({**AGENTS, "schedule": schedule, "measures": [str(tmp_path / "mine.py")]})
    events = ParticleSimulation({**AGENTS}, 3)
    for _ in range(8):
        next(events)
    result = run_trial(ParticleSimulation(scenario, 3))
    assert [(event.time_s, event.step) for event in result.events] == [(events.time_s, events.instants)]


KINDS = ["embodied", "particles"]
SERIES = """
class Series:
    def __init__(self, simulation):
        self.seen = []

    def cycle(self, event, state):
        self.seen.append(None if len(self.seen) == 1 else state.cycles % 4)

    def value(self):
        return {kind}(self.seen)
"""


def trial(model, stop, measures=(), seed=3, observers=(), **sections):
    given = {"model": model, "measures": list(measures), "stop": {"max_cycles": 12, **stop}, **sections}
    return run_trial(simulate(load_scenario(given), seed), observers)


@pytest.mark.parametrize("model", KINDS)
@pytest.mark.parametrize("observers", [(), (onlooking,)])
@pytest.mark.parametrize(("kind", "when", "cycles"), [("list", "> 2", 3), ("tuple", "<= 0", 4), ("list", "> 3", 12)])
def test_a_trial_ends_at_the_cycle_at_which_a_series_satisfies_it(model, observers, kind, when, cycles, tmp_path):
    path = write(tmp_path / "mine.py", SERIES.format(kind=kind))
    result = trial(model, {"when": f"Series {when}"}, [str(path)], observers=observers)
    assert (result.cycles, len(result.measures["Series"])) == (cycles, cycles)
    assert (result.t_sync_cycles, result.censored) == (None, None)
    assert result.order_parameter is not None
    plain = trial(model, {"order_parameter": None, "max_cycles": cycles})
    assert without_measures(result) == without_measures(plain)


@pytest.mark.parametrize("model", KINDS)
def test_a_condition_on_the_order_parameter_listed_or_not_ends_trials_where_synchrony_would(model):
    stop = {"order_parameter": 0.9, "max_cycles": 400}
    usual = [trial(model, stop, seed=seed) for seed in range(4)]
    when = {"when": "order_parameter >= 0.9", "max_cycles": 400}
    ended = [trial(model, when, ["order_parameter"], seed=seed) for seed in range(4)]
    assert without_measures(trial(model, when, seed=3)) == without_measures(ended[3])
    assert not all(result.censored for result in usual)
    for one, other in zip(usual, ended, strict=True):
        assert one.t_sync_cycles in (None, other.cycles)
        assert other.measures["order_parameter"][-1] == other.order_parameter == one.order_parameter
        assert (one.cycles, one.steps, one.simulated_s) == (other.cycles, other.steps, other.simulated_s)
    known = [trial(model, {**when, "gives_t_sync": True, "max_cycles": cycles}) for cycles in (400, 2)]
    assert without_measures(known[0]) == without_measures(usual[3])
    assert (known[1].t_sync_cycles, known[1].censored, known[1].cycles) == (None, True, 2)


def test_points_of_a_sweep_have_the_t_sync_that_a_condition_gives(tmp_path):
    stop = ["stop={when: order_parameter >= 0.9, gives_t_sync: true, max_cycles: 200}", "trials=3"]
    scenario = load_scenario("particles", stop, axes=["agents.count=5,10"])
    run_sweep(scenario, tmp_path / "run", pool_here)
    few, many = read_points(tmp_path / "run")
    usual = load_scenario("particles", ["stop={order_parameter: 0.9, max_cycles: 200}", "trials=3", "agents.count=10"])
    assert few.has_t_sync
    assert estimate_mean(measure(many)).value == np.mean([run_trial(simulate(usual, s)).cycles for s in many.seeds])


@pytest.mark.parametrize("model", KINDS)
def test_a_measure_that_is_told_of_every_event_ends_the_trial_after_any(model, tmp_path):
    path = write(tmp_path / "mine.py", TELLTALE.replace("return self.seen", "return len(self.seen)"))
    result = trial(model, {"when": "Telltale >= 7"}, [str(path)])
    assert result.measures["Telltale"] == 7
    if model == "embodied":
        assert result.steps == 7


@pytest.mark.parametrize("model", KINDS)
@pytest.mark.parametrize(("value", "cycles"), [("self.told > 4", 5), ("None", 12), ("[]", 12), ("float('nan')", 12)])
def test_true_counts_as_one_and_what_is_undetermined_ends_nothing(model, value, cycles, tmp_path):
    path = write(tmp_path / "mine.py", COUNTER.replace("self.offset + self.weight * self.told", value))
    assert trial(model, {"when": "Counter >= 1"}, [str(path)]).cycles == cycles


@settings(max_examples=15, deadline=None)
@given(st.floats(0.01, 30), st.integers(0, 5), st.floats(0.2, 3))
def test_agents_end_at_a_time_observed_or_not(time_s, seed, period_s):
    clocks, measures, events = {"period_s": period_s}, [{"density": {"cells": 2}}], []
    stop = {"order_parameter": None, "max_time_s": time_s, "max_cycles": 1000}
    fast = trial("particles", stop, measures, seed=seed, clocks=clocks)
    seen = [lambda event, _: events.append(event.time_s)]
    slow = trial("particles", stop, measures, seed=seed, observers=seen, clocks=clocks)
    assert without_wall(fast) == without_wall(slow)
    assert fast.simulated_s == pytest.approx(time_s, rel=1e-12)
    assert all(time <= time_s * (1 + 1e-12) for time in events)
    simulation = simulate(load_scenario({"model": "particles", "stop": stop, "clocks": clocks}), seed)
    simulation.run_to(time_s)
    assert (fast.cycles, fast.steps) == (simulation.cycles, simulation.instants)
    assert fast.order_parameter == simulation.order_parameter


def test_agents_that_are_synchronised_before_the_time_end_then_and_a_trial_may_have_no_time_at_all():
    stop = {"order_parameter": 0.5, "max_cycles": 10_000}
    usual = trial("particles", stop)
    later = trial("particles", {**stop, "max_time_s": 2 * usual.simulated_s})
    assert without_wall(later) == without_wall(usual)
    cut = trial("particles", {**stop, "max_time_s": usual.simulated_s / 2})
    assert (cut.censored, cut.t_sync_cycles) == (True, None)
    assert cut.cycles < usual.cycles
    for model in KINDS:  # no time at all is a trial, too
        result = trial(model, {"order_parameter": None, "max_time_s": 1e-3})
        assert (result.cycles, result.order_parameter, result.censored) == (0, None, None)
