"""The section `robot`: shipped kinds, kinds that differ from them, and what is refused."""

import math

import pytest

from epuck_sim import ScenarioError, Simulation, epuck
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.robot_kind import EPUCK, cell_cm
from epuck_sim.scenario.yaml_io import parse_yaml

RADIO = [{"count": 3, "signal": {"kind": "radio"}}]


def test_robots_are_e_pucks_unless_a_scenario_says_otherwise() -> None:
    robot = load_scenario("thesis").robot
    assert robot == EPUCK
    assert (robot.radius_cm, robot.mass_g, robot.wheels) == (3.7, 152, (12.8, 5.1))
    assert robot.camera_forward_cm == 3.7
    assert robot.infrared is not None
    assert robot.infrared.sensors[0] == (3.35, -1.05, -18)
    assert robot.ray_reach_cm == pytest.approx(math.hypot(3.35, 1.05) + 12)


def test_keys_that_are_given_change_a_kind_and_the_others_stay() -> None:
    given = {"kind": "kilobot", "mass_g": 10, "camera": {}, "infrared": {"sensors": [[1.5, 0, 0]], "range_cm": 3}}
    robot = load_scenario({"robot": given}).robot
    assert (robot.mass_g, robot.radius_cm, robot.wheel_base_cm) == (10, 1.65, 2.5)
    assert robot.camera_forward_cm == 1.65
    assert robot.infrared is not None
    assert (robot.infrared.range_cm, robot.infrared.peak_counts) == (3, epuck.INFRARED_PEAK_COUNTS)
    changed = load_scenario({"robot": {"wheel_base_cm": 6}}).robot
    assert changed == EPUCK.model_copy(update={"wheel_base_cm": 6})


def test_groups_have_kinds_of_their_own_or_that_of_all(tmp_path) -> None:
    (tmp_path / "cart.yaml").write_text("radius_cm: 5\nwheel_base_cm: 8\n")
    kinds = [None, "kilobot", {"kind": "kilobot", "mass_g": 9}, str(tmp_path / "cart.yaml")]
    groups = [{**RADIO[0], **({} if kind is None else {"kind": kind})} for kind in kinds]
    scenario = load_scenario({"robot": {"radius_cm": 4}, "robots": groups})
    assert [kind.radius_cm for kind in scenario.group_kinds] == [4, 1.65, 1.65, 5]
    assert [kind.mass_g for kind in scenario.group_kinds] == [152, 24, 9, 152]
    assert [kind.radius_cm for kind in scenario.robot_kinds] == [4] * 3 + [1.65] * 6 + [5] * 3
    (tmp_path / "cart.yaml").unlink()
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario
    found = points({"robots": groups[:2], "sweep": {"grid": {"robots.1.kind": ["kilobot", "pogobot"]}}})
    assert [point.scenario.group_kinds[1].radius_cm for point in found] == [1.65, 2.65]


def test_each_kind_brings_its_own_sensors_unless_its_group_has_others() -> None:
    groups = [{**RADIO[0], "kind": kind} for kind in ("pogobot", "kilobot")]
    scenario = load_scenario({"robots": groups})
    assert [list(group.sensors) for group in scenario.robots] == [["photosensors"], []]
    swapped = load_scenario(scenario, ["robots.0.kind=kilobot", "robots.1.kind=pogobot"])
    assert [list(group.sensors) for group in swapped.robots] == [[], ["photosensors"]]
    bare = load_scenario({"robots": [{**groups[0], "sensors": []}]})
    assert list(bare.robots[0].sensors) == []


def test_a_swept_kind_has_the_values_of_its_own() -> None:
    given = {"robots": RADIO, "timing": {"physics_hz": 200}}
    kinds = ["epuck", "kilobot", {"kind": "kilobot", "radius_cm": 2}, {"wheel_limit_cm_s": 20}]
    robots = [point.scenario.robot for point in points({**given, "sweep": {"grid": {"robot": kinds}}})]
    assert [robot.radius_cm for robot in robots] == [3.7, 1.65, 2, 3.7]
    assert [robot.wheel_limit_cm_s for robot in robots] == [12.8, 1, 1, 20]
    assert (robots[1].infrared, robots[1].camera, cell_cm([robots[1]]) >= 3.3) == (None, None, True)
    speeds = points({"robot": "kilobot", **given, "sweep": {"grid": {"robot.wheel_limit_cm_s": [0.5, 2]}}})
    assert [(each.scenario.robot.wheel_limit_cm_s, each.scenario.robot.mass_g) for each in speeds] == [
        (0.5, 24),
        (2, 24),
    ]


def test_numbers_of_resamples_of_folders_without_the_section_stay() -> None:
    assert load_scenario("thesis").later_defaults()["robot"] is True
    assert "robot" not in load_scenario("kilobots").later_defaults()


def test_a_robot_is_a_file_with_its_sensors_beside_it(tmp_path, monkeypatch) -> None:
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "cart.yaml").write_text(
        "description: mine\nradius_cm: 5\nwheel_base_cm: 8\ninfrared: null\nsensors: [{clock.py: {step: 2.0}}]\n"
    )
    (tmp_path / "lab" / "clock.py").write_text(
        "PARAMETERS = {'step': 1.0}\nREADINGS = {'clock': float}\n\n\n"
        "def sense(world, robot, readings, parameters, random):\n    readings.clock += parameters.step\n"
    )
    (tmp_path / "lab" / "carts.yaml").write_text("robot: {kind: cart.yaml, mass_g: 700}\nrobots: [{count: 2}]\n")
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario("lab/carts.yaml")
    robot = scenario.robot
    assert (robot.radius_cm, robot.wheel_base_cm, robot.mass_g, robot.infrared) == (5, 8, 700, None)
    assert Simulation(scenario, 1, interpret=True).advance(5).readings["clock"].tolist() == [10, 10]
    (tmp_path / "lab" / "cart.yaml").unlink()
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario


def test_a_pogobot_tells_how_bright_it_is_on_three_sides() -> None:
    lamp = {"x_cm": 0, "y_cm": 20, "height_cm": 5}
    given = {"robot": "pogobot", "arena": {"width_cm": 40, "height_cm": 40, "lamps": [lamp]}, "noise": "off"}
    group = {"poses": [[20, 20, math.pi]], "controller": "external", "signal": {"kind": "radio"}}
    light = Simulation({**given, "robots": [group]}, 1, interpret=True).advance(1).readings["light"][0]
    assert light[0] > light[1] == pytest.approx(light[2])


def test_a_list_with_a_wrong_element_is_not_said_to_be_too_short() -> None:
    with pytest.raises(ScenarioError, match=r"infrared\.sensors\.0\.2: is missing$"):
        load_scenario({"robot": {"infrared": {"sensors": [[1, 2]]}}})
