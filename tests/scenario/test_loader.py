"""Scenarios: what is read, what is refused and in which words, and that what is written is read again."""

import math
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.overrides import apply_override
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.util.builtin import ARENAS, SWEEPS, builtin_files

SHIPPED = [*builtin_files(ARENAS), *builtin_files(SWEEPS)]


def test_an_empty_mapping_is_the_base_case_of_the_thesis() -> None:
    scenario = load_scenario({})
    shipped = load_scenario("thesis")
    assert scenario == shipped.model_copy(update={"description": ""})
    assert scenario.robots[0].parameters["speed_cm_s"] == 12.8
    assert (scenario.stop.order_parameter, scenario.stop.max_cycles) == (0.95, 10_000)


@pytest.mark.parametrize("arena", SHIPPED)
def test_what_is_written_is_read_again(arena: str) -> None:
    scenario = load_scenario(arena)
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario
    assert load_scenario(scenario) == scenario


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
    assert apply_override(apply_override(given, "trials=2"), "trials=3")["trials"] == 3
    assert given == {"trials": 1}
    assert load_scenario(load_scenario("pair"), ["trials=7"]).trials == 7


REFUSED = [
    ({"robots": [{"controler": "firefly"}]}, "robots.0.controler: unknown 'controler', did you mean 'controller'?"),
    ({"areena": {}}, "areena: unknown 'areena', did you mean 'arena'?"),
    ({"stop": {"max_cyles": 3}}, "stop.max_cyles: unknown 'max_cyles', did you mean 'max_cycles'?"),
    ({"arena": {"width_cm": "wide"}}, "arena.width_cm: is 'wide'; allowed: a number"),
    ({"arena": {"width_cm": -60}}, "arena.width_cm: is -60; allowed: above 0"),
    ({"arena": {"width_cm": math.nan}}, "arena.width_cm: is nan; allowed: a finite number"),
    ({"arena": {"width_cm": 7}}, "arena.width_cm: is 7; allowed: at least 7.4"),
    ({"robots": [{"count": 0}]}, "robots.0.count: is 0; allowed: at least 1"),
    ({"robots": [{"count": 2.5}]}, "robots.0.count: is 2.5; allowed: a whole number"),
    ({"robots": [{"count": True}]}, "robots.0.count: is True; allowed: a number, not true or false"),
    ({"robots": []}, "robots is []; allowed: at least one group"),
    ({"robots": {}}, "robots: is {}; allowed: a list"),
    ({"robots": [{"count": 200}]}, "200 robots of 7.4 cm do not fit into the arena of 60 x 60 cm"),
    ({"robots": [{"placement": "line"}]}, "robots.0.placement: is 'line'; allowed: 'random', 'grid' or 'poses'"),
    ({"robots": [{"placement": "poses"}]}, "robots.0: placement is 'poses' but there are none"),
    ({"robots": [{"count": 3, "poses": [[10, 10, 0]]}]}, "count is 3 but there are 1 poses"),
    ({"robots": [{"poses": [[10, 10]]}]}, "robots.0.poses.0.2: "),
    ({"robots": [{"camera": {"central_pixels": 7}}]}, "central_pixels is 7; allowed: 2 to 60 in steps of 2"),
    ({"robots": [{"camera": {"central_pixels": 62}}]}, "central_pixels is 62; allowed: 2 to 60"),
    ({"robots": [{"parameters": {"sped_cm_s": 1}}]}, "robots.0.parameters: unknown 'sped_cm_s', did you mean"),
    ({"robots": [{"parameters": {"speed_cm_s": 99}}]}, "robots.0.parameters: speed_cm_s is 99.0; allowed: 0 to 12.8"),
    ({"robots": [{"parameters": {"speed_cm_s": math.inf}}]}, "speed_cm_s is inf; allowed: a number"),
    ({"robots": [{"parameters": {"speed_cm_s": "fast"}}]}, "speed_cm_s is 'fast'; allowed: a number"),
    ({"robots": [{"parameters": 3}]}, "robots.0.parameters: is 3; allowed: a mapping of keys to values"),
    ({"robots": [{"controller": "firefli"}]}, "robots.0.controller: unknown 'firefli', did you mean 'firefly'?"),
    ({"robots": [{"controller": "gone.py"}]}, "robots.0.controller: no controller file 'gone.py'"),
    ({"timing": {"control_hz": 3}}, "control_hz is 3; a control step must be whole milliseconds"),
    ({"timing": {"physics_hz": 105}}, "physics_hz is 105; allowed: a multiple of control_hz, 10"),
    ({"stop": {"reference_robot": 10}}, "stop.reference_robot is 10; allowed: 0 to 9"),
    ({"stop": {"order_parameter": 1.5}}, "stop.order_parameter: is 1.5; allowed: at most 1"),
    ({"seed": -1}, "seed: is -1; allowed: at least 0"),
    ({"noise": {"wheel_speed": 1}}, "noise.wheel_speed: is 1; allowed: below 1"),
    ({"noise": "loud"}, "noise: is 'loud'; allowed:"),
    ({"spread": {"wheel_speed": 1}}, "spread.wheel_speed: is 1; allowed: below 1"),
    ({"spread": {"wheel_imbalance": -0.1}}, "spread.wheel_imbalance: is -0.1; allowed: at least 0"),
    ({"spread": {"clock_rate": 0.2}}, "spread.clock_rate: is 0.2; allowed: at most 0.1"),
    ({"spread": {"infrared_gain": 1}}, "spread.infrared_gain: is 1; allowed: below 1"),
    ({"spread": {"camera": 1}}, "spread.camera: unknown 'camera'; allowed: wheel_speed, wheel_imbalance, clock_"),
    ({"stuck": {"per_hour": -1}}, "stuck.per_hour: is -1; allowed: at least 0"),
    ({"stuck": {"mean_s": 0}}, "stuck.mean_s: is 0; allowed: above 0"),
    ({"stop": {"further_cycles": -1}}, "stop.further_cycles: is -1; allowed: at least 0"),
    ({"robots": [{"camera": {"frames_per_s": 0}}]}, "robots.0.camera.frames_per_s: is 0; allowed: at least"),
    (
        {"robots": [{}, {"count": 1, "camera": {"frames_per_s": 10.5}}]},
        "robots.1.camera.frames_per_s is 10.5; allowed: 0.1 to timing.control_hz, which is 10",
    ),
    ({"robots": [{"camera": {"reflection_range_cm": -1}}]}, "camera.reflection_range_cm: is -1; allowed: at least 0"),
    ({"robots": [{"camera": {"reflection_range_cm": "far"}}]}, "camera.reflection_range_cm: is 'far'; allowed: a num"),
    (
        {"robots": [{"camera": {"range_cm": 40, "reflection_range_cm": 50}}]},
        "robots.0.camera: reflection_range_cm is 50; allowed: 0 to range_cm, which is 40: no mirror image is seen",
    ),
    (
        {"robots": [{"signal": {"kind": "radio"}, "camera": {"reflection_range_cm": 50}}]},
        "signal.kind is 'radio' and a camera is given; leave the camera out, or choose camera",
    ),
    (
        {"robots": [{"camera": {"latency_ms": 30}}]},
        "robots.0.camera: latency_ms is 30, frames_per_s is null; give frames_per_s, or leave latency_ms out",
    ),
    (
        {"robots": [{"camera": {"frames_per_s": 8, "latency_ms": 126}}]},
        "robots.0.camera: latency_ms is 126; allowed: 0 to the time from one picture to the next, 125 ms at 8 frames_",
    ),
    ({"robots": [{"poses": 3}]}, "robots.0.poses: is 3; allowed: a list"),
    ({"arena": None}, "arena: is None; allowed: a mapping of keys to values"),
    ({"model": "quantum"}, "model: is 'quantum'; allowed: 'embodied' or 'particles'"),
    ({"arena": {"obstacles": [{"shape": "star"}]}}, "arena.obstacles.0: is {'shape': 'star'}; allowed:"),
    ({"arena": {"obstacles": [{"shape": "circle", "x_cm": 1, "y_cm": 1}]}}, "arena.obstacles.0.radius_cm: "),
    (
        {"arena": {"obstacles": [{"shape": "circle", "x_cm": 1, "y_cm": 30, "radius_cm": 3}]}},
        "arena: an obstacle or movable reaches from (-2, 27) to (4, 33) cm, beyond the walls of the 60 x 60 cm arena",
    ),
    (
        {"arena": {"obstacles": [{"shape": "polygon", "corners_cm": [[10, 10], [10, 20], [20, 10]]}]}},
        "corners_cm must bound a convex polygon, listed counter-clockwise",
    ),
]


@pytest.mark.parametrize(("given", "message"), REFUSED, ids=lambda case: case[:50] if isinstance(case, str) else "")
def test_a_mistake_is_named_with_key_value_and_what_is_allowed(given: dict, message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(given)
    assert message in str(caught.value)
    assert str(caught.value).startswith("scenario: ")


def test_all_mistakes_are_named_at_once() -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario({"seed": -1, "trials": 0})
    assert str(caught.value).count("\n") == 1


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("seed", "give it as key=value"),
        ("=3", "give it as key=value"),
        ("robots.3.count=1", "'3' is not an index into a list of 1"),
        ("robots.x.count=1", "'x' is not an index into a list of 1"),
        ("seed.x=1", "'x' is inside 0, which has no keys"),
        ("stop.max_cycles=[1", "cannot be read as YAML"),
        ("stop.max_cyles=1", "did you mean 'max_cycles'"),
    ],
)
def test_a_mistake_in_set_is_named(setting: str, message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("thesis", [setting])
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "is empty"), ("- 1", "is [1]; a scenario is a mapping"), ("hello", "is 'hello'; a scenario is a mapping")],
)
def test_yaml_that_is_no_mapping_is_refused(tmp_path, text: str, message: str) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)


def test_a_scenario_that_is_not_there_is_named_with_the_nearest_one() -> None:
    with pytest.raises(ScenarioError, match=r"unknown 'thesi', did you mean 'thesis'\?; shipped scenarios: arc, "):
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
