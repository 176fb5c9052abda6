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


def named(scenario) -> list[tuple[str, dict]]:
    return [(section.measure, section.parameters) for section in scenario.measures]


@pytest.mark.parametrize("model", ["embodied", "particles"])
def test_names_and_mappings_are_read_and_written_again(model, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = write(tmp_path / "mine.py", COUNTER)
    given = ["order_parameter", {"mine.py": {"offset": 3}}, {"near_walls": None}]
    scenario = load_scenario({"model": model, "measures": given, "stop": {"when": "Counter >= 3"}})
    assert load_scenario({"model": model, "measures": scenario.measures}).measures == scenario.measures
    parameters = {"weight": 1.0, "offset": 3, "loud": False, "label": "all"}
    assert named(scenario) == [
        *(("order_parameter", {}), (f"{path}:Counter", parameters), ("near_walls", {"within_cm": 5.0}))
    ]
    monkeypatch.chdir("/")
    assert load_scenario(parse_yaml(write_scenario(scenario), "again")) == scenario
    assert load_scenario(scenario) == scenario


def test_measures_of_the_command_come_after_those_of_the_file_and_take_settings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "mine.py", COUNTER)
    write(tmp_path / "scene.yaml", "measures: [order_parameter]\n")
    swept = load_scenario(
        "scene.yaml", axes=["measures.1={mine.py: {offset: 1}},{mine.py: {offset: 2}}"], measures=["mine.py"]
    )
    assert [point.scenario.measures[1].parameters["offset"] for point in points(swept)] == [1, 2]
    scenario = load_scenario("scene.yaml", ["measures.1={mine.py: {offset: 2}}"], measures=["mine.py"])
    assert [name.rpartition("/")[2] for name, _ in named(scenario)] == ["order_parameter", "mine.py:Counter"]
    assert scenario.measures[1].parameters["offset"] == 2
    once = load_scenario({}, measures=["degree: {direction: out}"])
    assert once.measures[0].parameters["direction"] == "out"
    assert load_scenario(once, measures=["degree", "degree: {direction: out}"]).measures == once.measures
