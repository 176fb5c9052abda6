"""Claims about the section `faults`: what is allowed, and what is said of the rest."""

import pytest

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
