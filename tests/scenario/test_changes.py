"""Claims about the section `faults`: what is allowed, and what is said of the rest."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.changes import FAULTS
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.yaml_io import parse_yaml

NEEDED = {"clock_drift": {"rate": 1.1}, "clock_jitter": {"jitter": 0.1}, "camera_misses": {"missed": 0.5}}


@pytest.mark.parametrize("kind", [kind for kind in FAULTS if kind != "sensor_dead"])
def test_every_kind_is_written_and_read_again(kind):
    scenario = load_scenario({"faults": [{"kind": kind, "count": 2, "per_hour": 3, **NEEDED.get(kind, {})}]})
    assert type(scenario.faults[0]) is FAULTS[kind]
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario


def test_keys_of_faults_can_be_axes():
    sweep = load_scenario({"faults": [{"kind": "ring_dead", "share": 0.1}]}, axes=["faults.0.share=0.1,0.5"])
    assert [point.scenario.faults[0].share for point in points(sweep)] == [0.1, 0.5]


def test_faults_of_oscillators_may_befall_the_oscillators_among_others():
    robots = [{"count": 3, "controller": "constant"}, {"count": 3}]
    assert load_scenario({"robots": robots, "faults": [{"kind": "restart", "robots": [3, 5]}]}).faults


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
