"""When a trial ends: how the keys of `stop` are read, written again, swept and refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.stop import Condition
from epuck_sim.scenario.yaml_io import parse_yaml
from tests.measures.files import COUNTER, write

MODELS = ["embodied", "particles"]
NEAR = {"measure": "near_walls", "relation": "<", "value": 0.25}


def scenario(model, **stop):
    return load_scenario({"model": model, "measures": ["near_walls", "order_parameter"], "stop": stop})


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("written", [NEAR, "near_walls < 0.25", " near_walls<2.5e-1 "])
def test_a_condition_is_read_from_text_or_a_mapping_and_written_again(model, written):
    found = scenario(model, when=written)
    assert found.stop.when.model_dump() == NEAR
    assert str(found.stop.when) == "near_walls < 0.25"
    assert found.stop.order_parameter is None
    assert load_scenario(parse_yaml(write_scenario(found), "again")) == found


@pytest.mark.parametrize("model", MODELS)
def test_without_a_condition_trials_end_with_synchrony(model):
    assert scenario(model).stop.order_parameter is not None
    assert scenario(model, order_parameter=None, max_time_s=3).stop.max_time_s == 3


def test_the_value_of_a_condition_and_the_whole_of_it_can_be_swept():
    base = {"measures": ["near_walls"], "stop": {"when": "near_walls < 0.25"}}
    found = points(load_scenario(base, axes=["stop.when.value=0.1,0.2"]))
    assert [str(point.scenario.stop.when) for point in found] == ["near_walls < 0.1", "near_walls < 0.2"]
    found = points(load_scenario(base, axes=["stop.when=near_walls > 0.1,near_walls >= 0.2"]))
    assert [str(point.scenario.stop.when) for point in found] == ["near_walls > 0.1", "near_walls >= 0.2"]


@given(st.sampled_from([">", ">=", "<", "<="]), st.integers(-2, 2), st.integers(-2, 2))
def test_a_condition_holds_as_python_says(relation, value, limit):
    condition = Condition(measure="x", relation=relation, value=limit)
    assert condition.holds(value) == eval(f"{value} {relation} {limit}")


def test_a_condition_on_a_measure_of_ones_own(tmp_path):
    path = write(tmp_path / "mine.py", COUNTER)
    found = load_scenario({"measures": [str(path)], "stop": {"when": "Counter >= 3"}})
    assert found.stop.when.measure == "Counter"
