"""Sections of scenarios: floors, lamps and walls of `arena`, kinds of `robot`, when trials end, and `measures`."""

import math
import subprocess
import sys

import cv2
import numpy as np
import pytest
from hypothesis import given, strategies as st

from epuck_sim import ScenarioError, Simulation, epuck, points
from epuck_sim.arena import brightness_at, light_at
from epuck_sim.scenario.arena import LONGEST_SIDE
from epuck_sim.scenario.base import ConfigModel
from epuck_sim.scenario.embodied import arena_after, arena_entries, largest_cm
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.robot_kind import EPUCK, cell_cm
from epuck_sim.scenario.scenario import Condition
from epuck_sim.util.yaml_io import parse_yaml
from tests.control.bench import with_sense
from tests.measures.files import COUNTER, write

DISC = {"shape": "circle", "x_cm": 20, "y_cm": 40, "radius_cm": 30, "brightness": 0}
BOX = {"shape": "box", "x_cm": 40, "y_cm": 10, "width_cm": 8, "height_cm": 2, "heading_rad": 1.5707963, "brightness": 1}
WEDGE = {"shape": "polygon", "corners_cm": [[30, 30], [50, 30], [40, 50]], "brightness": 0.5}
LAMP = {"x_cm": 0, "y_cm": 60}


def again(scenario):
    """Return a scenario that was written and is read again."""
    return load_scenario(parse_yaml(write_scenario(scenario), "written"))


@pytest.fixture
def ground(tmp_path):
    """Return the path of a picture, 0 beside 1, in a folder with a scenario that names it."""
    cv2.imwrite(str(tmp_path / "ground.png"), np.array([[0, 255]], np.uint8))
    (tmp_path / "on_it.yaml").write_text("arena: {floor: {picture: ground.png}}")
    return tmp_path / "ground.png"


def test_defaults_that_are_sections_which_nothing_validates_would_be_accepted():
    todo = [load_scenario("thesis"), load_scenario("particles"), *map(load_scenario, ({}, {"model": "particles"}))]
    while todo:
        for value in dict(section := todo.pop()).values():
            parts = value if isinstance(value, tuple) else [value]
            todo.extend(each for each in parts if isinstance(each, ConfigModel))
        assert type(section).model_validate(section.model_dump()) == section


def test_floors_and_lamps_are_built_as_given():
    scenario = load_scenario({"arena": {"floor": {"brightness": 0.25, "patches": [DISC, BOX, WEDGE]}, "lamps": [LAMP]}})
    arena = scenario.arena.build()
    assert brightness_at(arena, [58, 20, 40, 43, 40], [58, 20, 13, 10, 35]).tolist() == [0.25, 0, 1, 0.25, 0.5]
    assert light_at(arena, 0, 60) == 1
    assert arena.lamps.tolist() == [[0, 60, 30, 1]]
    assert again(scenario) == scenario


def test_a_picture_is_found_beside_the_scenario_and_read_again_when_it_changes(ground, monkeypatch):
    scenario = load_scenario(ground.with_name("on_it.yaml"))
    assert scenario.arena.floor.picture == str(ground)
    assert brightness_at(scenario.arena.build(), [10, 50], 10).tolist() == [0, 1]
    assert again(scenario) == scenario
    cv2.imwrite(str(ground), np.array([[255, 0, 0]], np.uint8))
    assert brightness_at(scenario.arena.build(), [10, 50], 10).tolist() == [1, 0]
    monkeypatch.chdir(ground.parent)
    assert load_scenario({"arena": {"floor": {"picture": "ground.png"}}}).arena.floor.picture == str(ground)
    ground.unlink()
    with pytest.raises(ScenarioError, match=f"arena.floor.picture: is .*there is no file {ground}"):
        scenario.arena.build()


def test_pictures_that_cannot_be_read_are_refused_with_file_and_key(ground):
    file = ground.with_name("on_it.yaml")
    cut_off = cv2.imencode(".png", np.eye(90, dtype=np.uint8))[1].tobytes()[:99]
    too_wide = cv2.imencode(".png", np.zeros((1, LONGEST_SIDE + 1), np.uint8))[1].tobytes()
    allowed = "a picture of 4001 x 1 pixels; allowed: up to 4000 x 4000"
    broken = ((each, "no picture that can") for each in (b"", b"a letter", cut_off))
    for content, said in (*broken, (too_wide, allowed)):
        ground.write_bytes(content)
        with pytest.raises(ScenarioError, match=f"^{file}: arena.floor.picture: {ground} is {said}"):
            load_scenario(file)


def test_pictures_may_be_the_axis_of_a_sweep_and_are_known_by_their_names(ground):
    ground.with_name("other.png").write_bytes(ground.read_bytes())
    file = ground.with_name("sweep.yaml")
    file.write_text("sweep: {grid: {arena.floor.picture: [ground.png, other.png, null]}}")
    named = [(point.axes["arena.floor.picture"], point.scenario.arena.floor.picture) for point in points(file)]
    assert named == [("ground.png", str(ground)), ("other.png", str(ground.with_name("other.png"))), (None, None)]
    file.write_text("sweep: {grid: {arena.floor: [{picture: ground.png}, {brightness: 0}]}}")
    assert points(file)[0].axes["arena.floor"] == {"picture": "ground.png"}


def test_floor_and_lamps_stay_where_a_schedule_moves_walls_and_each_entry_makes_the_arena_that_its_values_say(ground):
    arena = {"floor": {"patches": [DISC]}, "lamps": [LAMP]}
    narrow = [{"at_s": 1, "set": {"arena.height_cm": 35}}]
    after = arena_after(load_scenario({"arena": arena, "schedule": narrow}), 0)
    assert (after.height_cm, after.floor.patches[0].y_cm, after.lamps[0].y_cm) == (35, 40, 60)
    pictured = {"arena": {"floor": {"picture": str(ground)}}}
    load_scenario({**pictured, "schedule": [{"at_s": 1, "set": {"arena.obstacles": []}}]})
    with pytest.raises(ScenarioError, match=r"schedule\.0\.set: sets arena\.height_cm, but arena\.floor\.picture is"):
        load_scenario({**pictured, "schedule": narrow})
    wall = {"shape": "box", "x_cm": 30, "y_cm": 30, "width_cm": 2, "height_cm": 60}
    pushed = {"x_cm": 40, "y_cm": 30, "radius_cm": 3, "mass_kg": 1, "friction": 0.1}
    schedule = [
        {"at_s": 1, "set": {"arena.obstacles": [], "arena.width_cm": 90}},
        {"at_s": 2, "displace": {"by_cycles": 0.1}},
        {"at_cycle": 3, "set": {"arena.width_cm": 50, "arena.obstacles": [{**wall, "x_cm": 20}]}},
    ]
    scenario = load_scenario({"arena": {"obstacles": [wall], "movables": [pushed]}, "schedule": schedule})
    assert arena_entries(scenario) == [0, 2]
    wide, narrow = (arena_after(scenario, entry) for entry in (0, 2))
    assert (wide.width_cm, wide.height_cm, wide.obstacles) == (90, 60, ())
    assert (narrow.width_cm, narrow.height_cm, narrow.obstacles[0].x_cm) == (50, 60, 20)
    assert wide.movables == narrow.movables == scenario.arena.movables
    assert largest_cm(scenario) == (90, 60)
    assert again(scenario) == scenario


def test_opencv_is_imported_for_a_picture_alone(ground):
    asks = "for name in sys.argv[1:]: load_scenario(name); print('cv2' in sys.modules)"
    program = [sys.executable, "-c", f"import sys; from epuck_sim import load_scenario\n{asks}"]
    said = subprocess.check_output([*program, "thesis", ground.with_name("on_it.yaml")], text=True)
    assert said.split() == ["False", "True"]


RADIO = [{"count": 3, "signal": {"kind": "radio"}}]


def test_keys_that_are_given_change_a_kind_and_the_others_stay_or_are_those_of_e_pucks() -> None:
    robot = load_scenario("thesis").robot
    assert robot == EPUCK
    assert (robot.radius_cm, robot.mass_g, robot.wheels) == (3.7, 152, (12.8, 5.1))
    assert robot.camera_forward_cm == 3.7
    assert robot.infrared.sensors[0] == (3.35, -1.05, -18)
    assert robot.ray_reach_cm == pytest.approx(math.hypot(3.35, 1.05) + 12)
    given = {"kind": "kilobot", "mass_g": 10, "camera": {}, "infrared": {"sensors": [[1.5, 0, 0]], "range_cm": 3}}
    robot = load_scenario({"robot": given}).robot
    assert (robot.mass_g, robot.radius_cm, robot.wheel_base_cm) == (10, 1.65, 2.5)
    assert robot.camera_forward_cm == 1.65
    assert (robot.infrared.range_cm, robot.infrared.peak_counts) == (3, epuck.INFRARED_PEAK_COUNTS)
    changed = load_scenario({"robot": {"wheel_base_cm": 6}}).robot
    assert changed == EPUCK.model_copy(update={"wheel_base_cm": 6})


def test_groups_have_kinds_of_their_own_or_that_of_all_and_the_sensors_of_their_kind_or_others(tmp_path) -> None:
    (tmp_path / "cart.yaml").write_text("radius_cm: 5\nwheel_base_cm: 8\n")
    kinds = [None, "kilobot", {"kind": "kilobot", "mass_g": 9}, str(tmp_path / "cart.yaml")]
    groups = [{**RADIO[0], **({} if kind is None else {"kind": kind})} for kind in kinds]
    scenario = load_scenario({"robot": {"radius_cm": 4}, "robots": groups})
    assert [kind.radius_cm for kind in scenario.group_kinds] == [4, 1.65, 1.65, 5]
    assert [kind.mass_g for kind in scenario.group_kinds] == [152, 24, 9, 152]
    assert [kind.radius_cm for kind in scenario.robot_kinds] == [4] * 3 + [1.65] * 6 + [5] * 3
    (tmp_path / "cart.yaml").unlink()
    assert again(scenario) == scenario
    found = points({"robots": groups[:2], "sweep": {"grid": {"robots.1.kind": ["kilobot", "pogobot"]}}})
    assert [point.scenario.group_kinds[1].radius_cm for point in found] == [1.65, 2.65]
    groups = [{**RADIO[0], "kind": kind} for kind in ("pogobot", "kilobot")]
    scenario = load_scenario({"robots": groups})
    assert [list(group.sensors) for group in scenario.robots] == [["photosensors"], []]
    swapped = load_scenario(scenario, ["robots.0.kind=kilobot", "robots.1.kind=pogobot"])
    assert [list(group.sensors) for group in swapped.robots] == [[], ["photosensors"]]
    for robot in ({"radius_cm": 4}, {"kind": 3}):
        assert load_scenario({"robot": robot, "robots": RADIO}, ["robot=kilobot"]).robot.radius_cm == 1.65
    assert load_scenario({"robots": [{**groups[0], "sensors": []}]}).robots[0].sensors == {}


def test_scales_are_of_the_first_group_all_robots_and_the_area() -> None:
    groups = [{"count": 2, "parameters": {"coupling": 0.2, "period_s": 4}}, {"count": 3}]
    scenario = load_scenario({"arena": {"width_cm": 160, "height_cm": 40}, "robots": groups})
    assert scenario.scales == {"epsilon": 0.2, "L": 80, "N": 5, "tau": 4}


def test_a_swept_kind_has_the_values_of_its_own_and_numbers_of_resamples_without_the_section_stay() -> None:
    given = {"robots": RADIO, "timing": {"physics_hz": 200}}
    kinds = ["epuck", "kilobot", {"kind": "kilobot", "radius_cm": 2}, {"wheel_limit_cm_s": 20}]
    robots = [point.scenario.robot for point in points({**given, "sweep": {"grid": {"robot": kinds}}})]
    assert [robot.radius_cm for robot in robots] == [3.7, 1.65, 2, 3.7]
    assert [robot.wheel_limit_cm_s for robot in robots] == [12.8, 1, 1, 20]
    assert (robots[1].infrared, robots[1].camera, cell_cm([robots[1]]) >= 3.3) == (None, None, True)
    speeds = points({"robot": "kilobot", **given, "sweep": {"grid": {"robot.wheel_limit_cm_s": [0.5, 2]}}})
    assert [each.scenario.robot.wheel_limit_cm_s for each in speeds] == [0.5, 2]
    assert {each.scenario.robot.mass_g for each in speeds} == {24}
    assert load_scenario("thesis").later_defaults()["robot"] is True
    assert "robot" not in load_scenario("kilobots").later_defaults()


def test_a_robot_is_a_file_with_its_sensors_beside_it(here) -> None:
    cart = "description: mine\nradius_cm: 5\nwheel_base_cm: 8\ninfrared: null\nsensors: [{clock.py: {step: 2.0}}]\n"
    clock = with_sense("readings.clock += parameters.step", "{'clock': float}", "{'step': 1.0}")
    carts = "robot: {kind: cart.yaml, mass_g: 700}\nrobots: [{count: 2}]\nquick: {trials: 2}\n"
    (here / "lab").mkdir()
    for name, text in {"cart.yaml": cart, "clock.py": clock, "carts.yaml": carts}.items():
        (here / "lab" / name).write_text(text)
    scenario = load_scenario("lab/carts.yaml")
    robot = scenario.robot
    assert (robot.radius_cm, robot.wheel_base_cm, robot.mass_g, robot.infrared) == (5, 8, 700, None)
    assert Simulation(scenario, 1, interpret=True).advance(5).readings["clock"].tolist() == [10, 10]
    (here / "lab" / "cart.yaml").unlink()
    assert again(scenario) == scenario


def test_a_pogobot_tells_how_bright_it_is_on_three_sides() -> None:
    lamp = {"x_cm": 0, "y_cm": 20, "height_cm": 5}
    given = {"robot": "pogobot", "arena": {"width_cm": 40, "height_cm": 40, "lamps": [lamp]}, "noise": "off"}
    group = {"poses": [[20, 20, math.pi]], "controller": "external", "signal": {"kind": "radio"}}
    light = Simulation({**given, "robots": [group]}, 1, interpret=True).advance(1).readings["light"][0]
    assert light[0] > light[1] == pytest.approx(light[2])


MODELS = pytest.mark.parametrize("model", ["embodied", "particles"])
NEAR = {"measure": "near_walls", "relation": "<", "value": 0.25}


@MODELS
@pytest.mark.parametrize("written", [NEAR, "near_walls < 0.25", " near_walls<2.5e-1 "])
def test_a_condition_is_read_from_text_or_a_mapping_and_written_again(model, written):
    found = load_scenario({"model": model, "measures": ["near_walls"], "stop": {"when": written}})
    assert found.stop.when.model_dump() == NEAR
    assert str(found.stop.when) == "near_walls < 0.25"
    assert found.stop.order_parameter is None
    assert again(found) == found


@given(st.sampled_from([">", ">=", "<", "<="]), st.integers(-2, 2), st.integers(-2, 2))
def test_a_condition_holds_as_python_says(relation, value, limit):
    condition = Condition(measure="x", relation=relation, value=limit)
    assert condition.holds(value) == eval(f"{value} {relation} {limit}")


def named(scenario) -> list[tuple[str, dict]]:
    return [(section.measure, section.parameters) for section in scenario.measures]


@MODELS
def test_names_and_mappings_are_read_and_written_again(model, here, monkeypatch):
    path = write(here / "mine.py", COUNTER)
    given = ["order_parameter", {"mine.py": {"offset": 3}}, {"near_walls": None}]
    scenario = load_scenario({"model": model, "measures": given, "stop": {"when": "Counter >= 3"}})
    assert load_scenario({"model": model, "measures": scenario.measures}).measures == scenario.measures
    parameters = {"weight": 1.0, "offset": 3, "loud": False, "label": "all"}
    expected = [("order_parameter", {}), (f"{path}:Counter", parameters), ("near_walls", {"within_cm": 5.0})]
    assert named(scenario) == expected
    monkeypatch.chdir("/")
    assert again(scenario) == scenario
    assert load_scenario(scenario) == scenario


def test_measures_of_the_command_come_after_those_of_the_file_and_take_settings(here):
    write(here / "mine.py", COUNTER)
    write(here / "scene.yaml", "measures: [order_parameter]\n")
    axes = ["measures.1={mine.py: {offset: 1}},{mine.py: {offset: 2}}"]
    swept = load_scenario("scene.yaml", axes=axes, measures=["mine.py"])
    assert [point.scenario.measures[1].parameters["offset"] for point in points(swept)] == [1, 2]
    scenario = load_scenario("scene.yaml", ["measures.1={mine.py: {offset: 2}}"], measures=["mine.py"])
    assert [name.rpartition("/")[2] for name, _ in named(scenario)] == ["order_parameter", "mine.py:Counter"]
    assert scenario.measures[1].parameters["offset"] == 2
    once = load_scenario({}, measures=["degree: {direction: out}"])
    assert once.measures[0].parameters["direction"] == "out"
    assert load_scenario(once, measures=["degree", "degree: {direction: out}"]).measures == once.measures
