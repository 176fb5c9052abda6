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
        self.steps, self.orders, self.speeds = {}, {}, []

    def __call__(self, step, state):
        if state.cycles not in self.steps:
            self.steps[state.cycles], self.orders[state.cycles] = step.number, state.order_parameter
        self.speeds.append(step.wheels_cm_s.max())


def test_changes_after_a_cycle_act_in_the_next_step_whether_trials_are_observed_or_not():
    scenario = load_scenario({"schedule": SCHEDULE, "stop": STOP})
    seen, seed = Firings(), 4
    observed = run_trial(Simulation(scenario, seed), [seen])
    alone = run_trial(Simulation(scenario, seed))
    assert observed._replace(wall_s=0) == alone._replace(wall_s=0)
    steps = {event["entry"]: event["step"] for event in alone.events}
    assert steps == {0: seen.steps[3] + 1, 1: seen.steps[5] + 1, 2: 300}
    assert seen.speeds[steps[0] - 1] > 0
    assert seen.speeds[steps[0]] == 0


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


@pytest.mark.parametrize("for_cycles", [1, 3])
def test_a_condition_must_hold_at_firings_in_a_row(for_cycles):
    entry = {"when": "order_parameter >= 0.6", "for_cycles": for_cycles}
    schedule = [{**entry, "set": {"robots.0.parameters.speed_cm_s": 0}}]
    scenario = load_scenario({"schedule": schedule, "stop": {"max_cycles": 60, "order_parameter": None}})
    seen = Firings()
    result = run_trial(Simulation(scenario, 1), [seen])
    rows = [cycle for cycle in seen.orders if cycle >= for_cycles]
    first = next(cycle for cycle in rows if all(seen.orders[cycle - back] >= 0.6 for back in range(for_cycles)))
    assert [event["step"] for event in result.events] == [seen.steps[first] + 1]


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
    assert json.loads(result.stdout)["events"] == [{"entry": 0, "step": 20, "time_s": 2.0}]
