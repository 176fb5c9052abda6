"""Scenarios: what is read, what is refused and in which words, and that what is written is read again."""

from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.keys import set_value
from epuck_sim.scenario.loader import load_scenario, validate
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario


def test_an_empty_mapping_is_the_base_case_of_the_thesis() -> None:
    scenario = load_scenario({})
    shipped = load_scenario("thesis")
    assert scenario == shipped.model_copy(update={"description": ""})
    assert scenario.robots[0].parameters["speed_cm_s"] == 12.8
    assert (scenario.stop.order_parameter, scenario.stop.max_cycles) == (0.95, 10_000)


def test_a_file_without_a_name_is_called_after_itself(tmp_path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("trials: 3")
    assert load_scenario(path).name == "mine"
    assert load_scenario(str(path)).trials == 3


def test_poses_take_the_place_of_count_and_placement() -> None:
    scenario = load_scenario({"robots": [{"poses": [[10, 10, 0], [30, 30, 1]]}]})
    assert (scenario.robots[0].count, scenario.robots[0].placement) == (2, "poses")


def test_noise_is_off_and_on_by_a_word() -> None:
    off = load_scenario({"noise": "off"}).noise
    assert (off.wheel_speed, off.infrared_counts) == (0, 0)
    assert load_scenario({"noise": "on"}).noise == load_scenario({}).noise


@pytest.mark.parametrize(
    ("setting", "read"),
    [
        ("robots.0.parameters.speed_cm_s=1.0", lambda s: s.robots[0].parameters["speed_cm_s"] == 1.0),
        ("robots.0.parameters.period_s=8", lambda s: s.robots[0].parameters["period_s"] == 8.0),
        ("arena.width_cm=1e2", lambda s: s.arena.width_cm == 100.0),
        ("stop.metric=reference", lambda s: s.stop.metric == "reference"),
        ("noise=off", lambda s: s.noise.wheel_speed == 0),
        ("robots.0.poses=[[10, 10, 0]]", None),
        ("seed=123456789012345678901234567890", lambda s: s.seed == 123456789012345678901234567890),
    ],
)
def test_set_changes_one_value(setting: str, read) -> None:
    if read is None:
        with pytest.raises(ScenarioError, match="poses are given"):
            load_scenario("thesis", [setting])
    else:
        assert read(load_scenario("thesis", [setting]))
        assert read(load_scenario({}, [setting]))


def test_later_settings_win_and_the_original_stays() -> None:
    given = {"trials": 1}
    assert set_value(set_value(given, "trials", 2, "x"), "trials", 3, "x")["trials"] == 3
    assert given == {"trials": 1}
    assert load_scenario(load_scenario("pair"), ["trials=7"]).trials == 7


def test_all_mistakes_are_named_at_once() -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario({"seed": -1, "trials": 0})
    assert str(caught.value).count("\n") == 1


def test_a_scenario_that_is_not_there_is_named_with_the_nearest_one() -> None:
    with pytest.raises(ScenarioError, match=r"unknown 'thesi', did you mean 'thesis'\?; scenarios: thesis, "):
        load_scenario("thesi")
    with pytest.raises(ScenarioError, match=r"gone\.yaml: there is no such file"):
        load_scenario("gone.yaml")


def test_a_controller_is_looked_for_beside_the_scenario(tmp_path) -> None:
    (tmp_path / "mine.py").write_text(
        "PARAMETERS = {'pace': 2.0}\nMEMORY = {}\n"
        "def start(memory, parameters, random): pass\n"
        "def step(sensors, memory, actuators, parameters, random): actuators.left_cm_s = parameters.pace\n"
    )
    path = tmp_path / "scene.yaml"
    path.write_text("robots: [{controller: mine.py, count: 1}]")
    group = load_scenario(path).robots[0]
    assert group.controller == str(tmp_path / "mine.py")
    assert group.parameters == {"pace": 2.0}


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda children: st.lists(children, max_size=3) | st.dictionaries(st.text(max_size=5), children, max_size=3),
    max_leaves=8,
)


@given(
    st.dictionaries(
        st.sampled_from([*EmbodiedScenario.model_fields, *ParticleScenario.model_fields, "other"]), JUNK, max_size=4
    )
)
def test_junk_is_refused_or_read_but_never_ends_in_a_traceback(given: dict) -> None:
    with suppress(ScenarioError):
        assert isinstance(load_scenario(given), Scenario)


# The description


@pytest.mark.parametrize(
    ("settings", "axes", "notes"),
    [
        (["robots.0.count=5"], [], "; with robots.0.count=5"),
        (["noise=off"], ["arena.width_cm=60,80"], "; with noise=off, sweep arena.width_cm=60,80"),
        (["trials=5", "seed=3", "name=mine", "figure.form=violins"], [], ""),
    ],
)
def test_a_description_is_followed_by_the_changes_that_may_have_made_it_untrue(settings, axes, notes: str) -> None:
    shipped = load_scenario("thesis").description
    assert shipped != ""
    assert load_scenario("thesis", settings, axes).description == shipped + notes


def test_a_description_that_is_given_stays_as_it_is() -> None:
    assert load_scenario("thesis", ["robots.0.count=5", "description=mine"]).description == "mine"


def test_a_scenario_without_a_description_gets_none() -> None:
    assert load_scenario({}, ["robots.0.count=5"]).description == ""


PYDANTIC_S_WORDS = (
    "input",
    "Input",
    "valid ",
    "should",
    "Field",
    "dictionary",
    "tuple",
    "another kind",
    "instance",
    "<",
)


LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just("9" * 5000)
NESTED = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3) | st.integers(), inner, max_size=2),
    max_leaves=6,
)
SECTIONS = sorted({*EmbodiedScenario.model_fields, *ParticleScenario.model_fields} - {"name", "description", "model"})
KEYS = sorted(
    {
        key
        for kind in (EmbodiedScenario, ParticleScenario)
        for field in kind.model_fields.values()
        for key in getattr(type(field.default), "model_fields", ())
    }
)


@settings(max_examples=300)
@given(
    model=st.sampled_from(["embodied", "particles"]),
    section=st.sampled_from(SECTIONS),
    value=NESTED | st.dictionaries(st.sampled_from(KEYS), NESTED, min_size=1, max_size=3),
)
def test_no_message_shows_words_of_the_library_that_checks(model: str, section: str, value) -> None:
    try:
        validate({"model": model, section: value}, "x")
    except ScenarioError as error:
        for line in str(error).splitlines():
            allowed = line.rpartition("; allowed: ")[2] if "; allowed: " in line else ""
            assert not any(word in allowed for word in PYDANTIC_S_WORDS), line
