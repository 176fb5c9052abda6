"""Claims about schedules of trials: entries that wait for cycles or for the order parameter."""

import copy
import json

import pytest
from typer.testing import CliRunner

from epuck_sim.cli.app import app
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial

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


def test_the_phases_that_a_cycle_displaces_were_in_the_order_that_was_measured_at_it():
    plain = load_scenario({"stop": {"max_cycles": 6, "order_parameter": None}})
    schedule = [{"at_cycle": 5, "displace": {"by_cycles": "random"}}]
    displaced = load_scenario({**plain.model_dump(), "schedule": schedule})
    orders = []
    for scenario in (plain, displaced):
        seen = Firings()
        run_trial(Simulation(scenario, 4), [seen])
        orders.append(seen.orders)
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


def test_trials_end_by_the_order_parameter_without_its_being_among_the_measures():
    listed, alone = (
        run_trial(Simulation({"stop": {"when": "order_parameter >= 0.6", "max_cycles": 60}, "measures": measures}, 1))
        for measures in (["order_parameter"], [])
    )
    assert listed._replace(measures={}, wall_s=0) == alone._replace(wall_s=0)
    assert alone.order_parameter >= 0.6
    assert alone.cycles < 60


def test_a_copy_of_a_simulation_knows_what_a_trial_has_changed():
    scenario = load_scenario({"schedule": SCHEDULE[:2], "stop": STOP})
    simulation = Simulation(scenario, 4)
    run_trial(simulation)
    made = copy.deepcopy(simulation)
    assert made.events == simulation.events
    assert made.advance(50).phase_ms.tolist() == simulation.advance(50).phase_ms.tolist()


def test_json_tells_what_was_carried_out(tmp_path):
    path = tmp_path / "stops.yaml"
    stop = "stop: {max_cycles: 2, order_parameter: null}"
    path.write_text(f"schedule: [{{at_s: 2, set: {{robots.0.parameters.speed_cm_s: 0}}}}]\n{stop}\n")
    result = CliRunner().invoke(app, ["run", str(path), "--json"])
    assert json.loads(result.stdout)["events"] == [
        {"step": 20, "time_s": 2.0, "source": "schedule.0", "what": "robots.0.parameters.speed_cm_s: 0", "robots": []}
    ]
