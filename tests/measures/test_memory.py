"""A field of a controller's MEMORY, by name, as a measure; and two measures of one kind under two names."""

import json

import pytest

from epuck_sim import load_scenario, points
from epuck_sim.runs.compatibility import stored_point
from tests.measures.test_shipped import CYCLES, ROBOTS, at_cycles, run

MIXED = {**ROBOTS, "robots": [{"controller": "obstacle_avoidance", "count": 2}, {"count": 3}], "stop": {}}


def test_a_field_of_one_robot_is_that_of_its_memory():
    observer, seen = at_cycles(lambda step, _: float(step.memories[0]["rotation_time"][4]))
    field = {"name": "rotation_time", "robot": 4}
    first, *more = ({"memory": {**field, "take": take, "as": take}} for take in ("final", "mean", "series"))
    _, *values = run(first, observer, more=more, **ROBOTS)
    assert values == [seen[-1], sum(seen) / CYCLES, seen]
    assert max(seen) > 0


def test_a_field_of_all_is_the_mean_over_those_who_have_it():
    observer, seen = at_cycles(lambda step, _: step.memories[1]["phase_ms"].mean())
    _, value = run({"memory": {"take": "series"}}, observer, **MIXED)
    assert value == pytest.approx(seen)


def test_one_measure_may_be_there_twice_under_two_names():
    measures = [{"memory": {"as": "phase"}}, {"memory": {"name": "rotation_time", "as": "turning"}}, "memory"]
    scenario = load_scenario({"measures": measures})
    assert load_scenario(scenario.model_dump()) == scenario
    (point,) = points(scenario)
    assert list(json.loads(stored_point(point).measures)) == ["phase", "turning", "memory"]
