"""Claims about the section `faults`: what is allowed, and what is said of the rest."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.faults import FAULTS
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


@pytest.mark.parametrize(
    ("fault", "others", "message"),
    [
        ({"kind": "ring_ded"}, {}, "allowed: a mapping with kind: ring_dead or"),
        ({"kind": "ring_dead", "robot": [1]}, {}, "faults.0.robot: unknown 'robot', did you mean 'robots'"),
        ({"kind": "ring_dead", "robots": [10]}, {}, r"faults.0.robots is \[10\]; allowed: 0 to 9"),
        ({"kind": "ring_dead", "robots": [1, 1]}, {}, "one number or more, each once"),
        ({"kind": "ring_dead", "count": 11}, {}, "faults.0.count is 11; allowed: 1 to 10"),
        ({"kind": "ring_dead", "count": 1, "share": 0.1}, {}, "share and count are given"),
        ({"kind": "ring_dead", "at_s": 3, "until_s": 3}, {}, "until_s is 3; allowed: above at_s, which is 3"),
        ({"kind": "ring_dead", "mean_s": 3}, {}, "mean_s is given without per_hour"),
        ({"kind": "ring_dead", "scheduled": True, "at_s": 1}, {}, "scheduled is true and at_s is given"),
        ({"kind": "restart", "until_s": 3}, {}, "a restart takes no time"),
        ({"kind": "camera_misses"}, {}, "faults.0.missed: is missing"),
        ({"kind": "clock_drift", "rate": 0}, {}, "faults.0.rate: is 0; allowed: at least 0.1"),
        ({"kind": "restart"}, {"robots": [{"controller": "constant"}]}, "robots.0 are no oscillators"),
        ({"kind": "camera_blind"}, {"robots": [{"signal": {"kind": "radio"}}]}, "robots.0 has no camera"),
        ({"kind": "ring_dead"}, {"model": "particles"}, "faults: belongs to model: embodied"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(fault, others, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario({**others, "faults": [fault]})


def test_faults_of_oscillators_may_befall_the_oscillators_among_others():
    robots = [{"count": 3, "controller": "constant"}, {"count": 3}]
    assert load_scenario({"robots": robots, "faults": [{"kind": "restart", "robots": [3, 5]}]}).faults
