"""Claims about schedules of trials: entries that wait for cycles or for the order parameter."""

import pytest

from epuck_sim import ParticleSimulation, Simulation, load_scenario
from epuck_sim.trial.model import run_trial, simulate

STOP = {"max_cycles": 12, "order_parameter": None}
SCHEDULE = [
    {"at_cycle": 3, "set": {"robots.0.parameters.speed_cm_s": 0}},
    {"at_cycle": 5, "displace": {"by_cycles": "random"}},
    {"at_s": 30, "set": {"robots.0.parameters.speed_cm_s": 5}},
]


class Firings:
    """Notes what it sees of a trial."""

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
        run_trial(
            simulate(scenario, 4), [lambda _, state, seen=seen: seen.update({state.cycles: state.order_parameter})]
        )
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


COUNTER = """
class Steps:
    def __init__(self, simulation):
        self.count = 0

    def step(self, step, state):
        self.count += 1

    def value(self):
        return self.count % 120
"""
"""A measure that is 60 or more, and then less, for some seconds each."""


def test_a_condition_on_a_measure_of_steps_acts_in_the_next_one_or_after_firings_in_a_row(tmp_path):
    (tmp_path / "mine.py").write_text(COUNTER)
    measures, stop = [f"{tmp_path / 'mine.py'}:Steps"], {"max_cycles": 12, "order_parameter": None}
    schedule = [
        {"when": "Steps >= 60", **STILL},
        {"when": "Steps >= 60", "for_cycles": 1, "displace": {"by_cycles": 0.1}},
        {"when": {"measure": "Steps", "relation": ">=", "value": 60}, "for_cycles": 9, **STILL},
    ]
    scenario = load_scenario({"schedule": schedule, "stop": stop, "measures": measures})
    seen = Firings()
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
    observed = run_trial(
        ParticleSimulation(scenario, seed), [lambda _, state: cycles.setdefault(state.cycles, (state.time_s, state))]
    )
    assert observed._replace(wall_s=0) == alone._replace(wall_s=0)
    times = {event.source: event.time_s for event in alone.events}
    assert alone.cycles < 5 or times["schedule.1"] == cycles[5][0]
    assert times["schedule.0"] == cycles[3][0]
    assert times.get("schedule.2", 7.3) == 7.3
    assert (alone.simulated_s == 9.1) == ("max_time_s" in end)


def test_a_displacement_may_bring_a_firing_before_the_end_of_a_trial():
    """Without it, the next firing would be after the end; with it, agent 1 fires before."""
    start = {"phases": [0.0, 0.1]}
    given = {"model": "particles", "agents": {"count": 2, "speed_cm_s": 0}, "start": start}
    schedule = [{"at_s": 0.4, "displace": {"agents": [1], "by_cycles": 0.4}}]
    scenario = load_scenario({**given, "schedule": schedule, "stop": {"order_parameter": None, "max_time_s": 0.55}})
    seen = []
    for observers in ([], [lambda event, _: seen.append(event.fired.tolist())]):
        result = run_trial(ParticleSimulation(scenario), observers)
        assert (result.steps, result.simulated_s, len(result.events)) == (1, 0.55, 1)
    assert seen == [[], [1]]


def test_a_condition_on_a_measure_of_events_changes_a_swarm_at_the_event(tmp_path):
    (tmp_path / "mine.py").write_text(COUNTER.replace("def step(self, step", "def event(self, event"))
    measures, schedule = [f"{tmp_path / 'mine.py'}:Steps"], [{"when": "Steps >= 8", "set": {"agents.speed_cm_s": 0}}]
    scenario = load_scenario({**AGENTS, "schedule": schedule, "measures": measures})
    events = ParticleSimulation({**AGENTS}, 3)
    for _ in range(8):
        next(events)
    result = run_trial(ParticleSimulation(scenario, 3))
    assert [(event.time_s, event.step) for event in result.events] == [(events.time_s, events.instants)]
