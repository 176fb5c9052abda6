"""Floors and lamps, as scenarios give them: where a picture is found, what is refused, and what stays."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from epuck_sim.arena import brightness_at, light_at
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import arena_after, arena_entries, largest_cm
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.yaml_io import parse_yaml, write_yaml
from epuck_sim.util.pictures import LONGEST_SIDE

DISC = {"shape": "circle", "x_cm": 20, "y_cm": 40, "radius_cm": 30, "brightness": 0}
BOX = {"shape": "box", "x_cm": 40, "y_cm": 10, "width_cm": 8, "height_cm": 2, "heading_rad": 1.5707963, "brightness": 1}
WEDGE = {"shape": "polygon", "corners_cm": [[30, 30], [50, 30], [40, 50]], "brightness": 0.5}
LAMP = {"x_cm": 0, "y_cm": 60}


def scenario_with(**arena):
    return load_scenario({"arena": arena})


@pytest.fixture
def ground(tmp_path):
    """Return the path of a picture, 0 beside 1, in a folder with a scenario that names it."""
    cv2.imwrite(str(tmp_path / "ground.png"), np.array([[0, 255]], np.uint8))
    (tmp_path / "on_it.yaml").write_text("arena: {floor: {picture: ground.png}}")
    return tmp_path / "ground.png"


def test_floors_and_lamps_are_built_as_given():
    scenario = scenario_with(floor={"brightness": 0.25, "patches": [DISC, BOX, WEDGE]}, lamps=[LAMP])
    arena = scenario.arena.build()
    assert brightness_at(arena, [58, 20, 40, 43, 40], [58, 20, 13, 10, 35]).tolist() == [0.25, 0, 1, 0.25, 0.5]
    assert light_at(arena, 0, 60) == 1
    assert arena.lamps.tolist() == [[0, 60, 30, 1]]
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario


def test_a_picture_is_found_beside_the_scenario_and_read_again_when_it_changes(ground, monkeypatch):
    scenario = load_scenario(ground.with_name("on_it.yaml"))
    assert scenario.arena.floor.picture == str(ground)
    assert brightness_at(scenario.arena.build(), [10, 50], 10).tolist() == [0, 1]
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario
    cv2.imwrite(str(ground), np.array([[255, 0, 0]], np.uint8))
    assert brightness_at(scenario.arena.build(), [10, 50], 10).tolist() == [1, 0]
    monkeypatch.chdir(ground.parent)
    assert scenario_with(floor={"picture": "ground.png"}).arena.floor.picture == str(ground)
    ground.unlink()
    with pytest.raises(ScenarioError, match=f"arena.floor.picture: is .*there is no file {ground}"):
        scenario.arena.build()


def test_pictures_that_cannot_be_read_are_refused_with_file_and_key(ground):
    file = ground.with_name("on_it.yaml")
    cut_off = cv2.imencode(".png", np.eye(90, dtype=np.uint8))[1].tobytes()[:99]
    too_wide = cv2.imencode(".png", np.zeros((1, LONGEST_SIDE + 1), np.uint8))[1].tobytes()
    for content in (b"", b"a letter", cut_off, too_wide):
        ground.write_bytes(content)
        said = (
            "a picture of 4001 x 1 pixels; allowed: up to 4000 x 4000" if content == too_wide else "no picture that can"
        )
        with pytest.raises(ScenarioError, match=f"^{file}: arena.floor.picture: {ground} is {said}"):
            load_scenario(file)
    for name in ("absent.png", "n" * 300 + ".png", ".", "a\0b.png"):
        with pytest.raises(ScenarioError, match=r"^scenario: arena\.floor\.picture: "):
            scenario_with(floor={"picture": name})


def test_pictures_may_be_the_axis_of_a_sweep_and_are_known_by_their_names(ground):
    ground.with_name("other.png").write_bytes(ground.read_bytes())
    sweep = {"grid": {"arena.floor.picture": ["ground.png", "other.png", None]}}
    file = ground.with_name("sweep.yaml")
    file.write_text(write_yaml({"sweep": sweep}))
    named = [(point.axes["arena.floor.picture"], point.scenario.arena.floor.picture) for point in points(file)]
    assert named == [("ground.png", str(ground)), ("other.png", str(ground.with_name("other.png"))), (None, None)]
    whole = {"grid": {"arena.floor": [{"picture": "ground.png"}, {"brightness": 0}]}}
    file.write_text(write_yaml({"sweep": whole}))
    assert points(file)[0].axes["arena.floor"] == {"picture": "ground.png"}
    file.write_text(write_yaml({"sweep": {"grid": {"arena.floor.picture": ["absent.png", None]}}}))
    with pytest.raises(ScenarioError, match=r"sweep\.yaml: sweep: arena\.floor\.picture: is 'absent\.png'; there is"):
        load_scenario(file)


def test_floor_and_lamps_stay_where_a_schedule_moves_walls(ground):
    arena = {"floor": {"patches": [DISC]}, "lamps": [LAMP]}
    narrow = [{"at_s": 1, "set": {"arena.height_cm": 35}}]
    after = arena_after(load_scenario({"arena": arena, "schedule": narrow}), 0)
    assert (after.height_cm, after.floor.patches[0].y_cm, after.lamps[0].y_cm) == (35, 40, 60)
    pictured = {"arena": {"floor": {"picture": str(ground)}}}
    load_scenario({**pictured, "schedule": [{"at_s": 1, "set": {"arena.obstacles": []}}]})
    with pytest.raises(ScenarioError, match=r"schedule\.0\.set: sets arena\.height_cm, and arena\.floor\.picture is"):
        load_scenario({**pictured, "schedule": narrow})


def test_opencv_is_imported_for_a_picture_alone(ground):
    said = (
        "import sys; from epuck_sim import load_scenario\n"
        "for name in sys.argv[1:]: load_scenario(name); print('cv2' in sys.modules)"
    )
    names = "thesis", str(ground.with_name("on_it.yaml"))
    done = subprocess.run([sys.executable, "-c", said, *names], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


WALL = {"shape": "box", "x_cm": 30, "y_cm": 30, "width_cm": 2, "height_cm": 60}
PUSHED = {"x_cm": 40, "y_cm": 30, "radius_cm": 3, "mass_kg": 1, "friction": 0.1}
SCENARIO = {
    "arena": {"obstacles": [WALL], "movables": [PUSHED]},
    "schedule": [
        {"at_s": 1, "set": {"arena.obstacles": [], "arena.width_cm": 90}},
        {"at_s": 2, "displace": {"by_cycles": 0.1}},
        {"at_cycle": 3, "set": {"arena.width_cm": 50, "arena.obstacles": [{**WALL, "x_cm": 20}]}},
    ],
}


def test_each_entry_makes_the_arena_that_its_values_say_with_what_stays():
    scenario = load_scenario(SCENARIO)
    assert arena_entries(scenario) == [0, 2]
    wide, narrow = (arena_after(scenario, entry) for entry in (0, 2))
    assert (wide.width_cm, wide.height_cm, wide.obstacles) == (90, 60, ())
    assert (narrow.width_cm, narrow.height_cm, narrow.obstacles[0].x_cm) == (50, 60, 20)
    assert wide.movables == narrow.movables == scenario.arena.movables
    assert largest_cm(scenario) == (90, 60)
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario
