"""Claims about the section `schedule`: what cannot change is refused, in words, when a scenario is read."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.yaml_io import parse_yaml

AGENTS = {"model": "particles"}
STILL = {"robots.0.parameters.speed_cm_s": 0}
DARK = {"kind": "ring_dead", "scheduled": True}


def test_schedules_are_written_and_read_again():
    entry = {"when": "order_parameter >= 0.9", "for_cycles": 3, "set": STILL, "begin": [0]}
    given = {"faults": [DARK], "schedule": [entry, {"at_s": 3, "displace": {"by_cycles": "random"}, "end": [0]}]}
    scenario = load_scenario(given)
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario


def test_schedules_of_agents_are_written_and_read_again_and_checked_at_each_point_of_a_sweep():
    entry = {"when": "order_parameter >= 0.9", "for_cycles": 3, "set": {"neighbourhood.k": 4}}
    given = {**AGENTS, "schedule": [entry, {"at_s": 3, "displace": {"by_cycles": "random", "agents": [2]}}]}
    scenario = load_scenario(given)
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario
    rules = [{"kind": "nearest", "k": 2}, {"kind": "all"}]
    swept = load_scenario({**given, "sweep": {"grid": {"neighbourhood": rules}}})
    with pytest.raises(ScenarioError, match=r"point 1 .*schedule\.0\.set: neighbourhood\.k: unknown 'k'"):
        points(swept)
