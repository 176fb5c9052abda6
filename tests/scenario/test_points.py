"""Points of a sweep and their seeds: the right scenario at each, the same seed whatever stands beside it."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import Point, points
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.util.seeds import point_seed
from tests.control.bench import with_step

COUNT, WIDTH, SPEED = "robots.0.count", "arena.width_cm", "robots.0.parameters.speed_cm_s"
CONTROLLER = "robots.0.controller"

MINE = with_step("actuators.left_cm_s = parameters.pace", PARAMETERS='{"pace": 2.0}')


def grid(**axes):
    """Return the points of a grid; a key's dots are written as two underscores."""
    return points(load_scenario({"sweep": {"grid": {key.replace("__", "."): axes[key] for key in axes}}}))


def seeds(scenario, trials: int = 3):
    """Return the seeds of the first trials by the point's key."""
    return {point.key: [point.seed(trial) for trial in range(trials)] for point in points(scenario)}


SWEPT = {
    COUNT: st.integers(1, 10),
    WIDTH: st.integers(60, 100) | st.floats(60, 100),
    SPEED: st.floats(0, 12.8),
    "stop.metric": st.sampled_from(["complex", "reference"]),
    "robots.0.camera.range_cm": st.none() | st.floats(1, 100),
}


@st.composite
def numbered_sweeps(draw):
    """Return a grid over some of the keys, its values distinct."""
    keys = draw(st.lists(st.sampled_from(sorted(SWEPT)), min_size=1, max_size=3, unique=True))
    return {key: draw(st.lists(SWEPT[key], min_size=1, max_size=3, unique=True)) for key in keys}


@settings(max_examples=15)
@given(numbered_sweeps())
def test_each_point_is_the_scenario_with_its_values_set_one_by_one(axes: dict) -> None:
    scenario = load_scenario({"name": "base", "trials": 5, "seed": 9, "sweep": {"grid": axes}})
    found = points(scenario)
    assert [point.number for point in found] == list(range(len(found)))
    assert [point.axes for point in found] == scenario.sweep.rows()
    for point in found:
        written = [f"{key}={'null' if value is None else value}" for key, value in point.axes.items()]
        assert point.scenario == load_scenario({"name": "base", "trials": 5, "seed": 9}, written)


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text("abz .:,#-{}[]'\"\n\\\u00e9\u2028", max_size=6),
    lambda children: st.lists(children, max_size=2) | st.dictionaries(st.text("ab.", max_size=3), children, max_size=2),
    max_leaves=4,
)
COLUMNS = st.lists(JSON, min_size=1, max_size=3)


@settings(max_examples=20)
@given(columns=st.dictionaries(st.sampled_from(["arena", "noise", WIDTH]), COLUMNS, min_size=1), listed=JSON)
def test_a_sweep_that_is_written_is_read_again(columns: dict, listed) -> None:
    scenario = load_scenario({"sweep": {"grid": columns, "zip": {"stop": [listed]}, "points": [{"timing": listed}]}})
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario


# Seeds


@pytest.mark.parametrize(
    ("master", "axes", "key", "expected"),
    [
        (0, {}, "{}", [3863378073750256, 3225868734339422, 3231444368234837]),
        (
            *(0, {COUNT: 2, SPEED: 0.5}, '{"robots.0.count": 2.0, "robots.0.parameters.speed_cm_s": 0.5}'),
            [7015346984533444, 4535980160901266, 2834362922018468],
        ),
        (2016, {"noise": "off"}, '{"noise": "off"}', [8778295633544210, 2125023039864183, 932086395961719]),
    ],
)
def test_seeds_are_those_of_every_version_before(master: int, axes: dict, key: str, expected: list[int]) -> None:
    (point,) = points(load_scenario({"seed": master, **({"sweep": {"points": [axes]}} if axes else {})}))
    assert point.key == key
    assert [point.seed(trial) for trial in (0, 1, 199)] == expected


@given(
    master=st.integers(0, 2**64), point=st.text(max_size=20), other=st.text(max_size=20), trial=st.integers(0, 10**7)
)
def test_a_seed_changes_with_the_point_and_with_the_trial(master: int, point: str, other: str, trial: int) -> None:
    seed = point_seed(master, point, trial)
    assert 0 <= seed < 2**53
    assert seed == point_seed(master, point, trial)
    assert seed != point_seed(master, point, trial + 1)
    assert (seed == point_seed(master, other, trial)) == (point == other)


@settings(max_examples=12)
@given(axes=numbered_sweeps(), data=st.data())
def test_adding_a_value_to_an_axis_leaves_the_keys_and_seeds_of_the_other_points(axes: dict, data) -> None:
    key = data.draw(st.sampled_from(sorted(axes)))
    values = list(axes[key])
    added = data.draw(SWEPT[key].filter(lambda value: value not in values))
    values.insert(data.draw(st.integers(0, len(values))), added)
    before = seeds(load_scenario({"sweep": {"grid": axes}}))
    after = seeds(load_scenario({"sweep": {"grid": {**axes, key: values}}}))
    assert len(after) == len(before) // (len(values) - 1) * len(values)
    assert before.items() <= after.items()


@settings(max_examples=12)
@given(axes=numbered_sweeps(), chance=st.randoms(use_true_random=False))
def test_a_grid_shuffled_listed_or_zipped_and_with_other_numbers_has_the_same_keys_and_seeds(axes, chance) -> None:
    scenario = load_scenario({"sweep": {"grid": axes}})
    rows = [point.axes for point in points(scenario)]
    shuffled = {key: chance.sample(axes[key], len(axes[key])) for key in chance.sample(list(axes), len(axes))}
    zipped = {key: [row[key] for row in rows] for key in axes}
    backwards = [dict(reversed(row.items())) for row in rows]
    floats = [{key: float(value) if type(value) is int else value for key, value in row.items()} for row in rows]
    listed = [{"points": each} for each in (rows, backwards, floats)]
    for sweep in ({"grid": shuffled}, {"zip": zipped}, *(listed if COUNT not in axes else listed[:2])):
        assert seeds(load_scenario({"sweep": sweep})) == seeds(scenario)


def test_seeds_do_not_depend_on_trials_or_on_what_is_the_same_at_all_points() -> None:
    base = {"sweep": {"grid": {COUNT: [2, 3]}}, "trials": 4}
    others = ["arena.height_cm=80", "stop.max_cycles=7", "noise=off"]
    for change in ("trials=500", "name=other", "description=other", *others):
        assert seeds(load_scenario(base, [change])) == seeds(load_scenario(base))


# Axes of all kinds


def test_words_sections_and_parameters_of_swept_controllers_can_be_axes_too() -> None:
    off, on, some = grid(noise=["off", "on", {"wheel_speed": 0.1}])
    assert [point.scenario.noise.wheel_speed for point in (off, on, some)] == [0, 0.05, 0.1]
    found = grid(robots__0__controller=["oscillator", "firefly"], robots__0__parameters__period_s=[5, 8])
    groups = [point.scenario.robots[0] for point in found]
    assert [(group.controller, group.parameters["period_s"]) for group in groups] == [
        *(("oscillator", 5), ("oscillator", 8), ("firefly", 5), ("firefly", 8))
    ]
    given = {"parameters": {"period_s": 8, "speed_cm_s": 3}, "memory": {"phase_ms": 100}}
    blinks, moves = points(
        load_scenario({"robots": [given], "sweep": {"grid": {CONTROLLER: ["oscillator", "firefly"]}}})
    )
    for point in (blinks, moves):
        assert point.scenario.robots[0].parameters["period_s"] == 8
        assert point.scenario.robots[0].memory == {"phase_ms": 100}
    assert "speed_cm_s" not in blinks.scenario.robots[0].parameters
    assert moves.scenario.robots[0].parameters["speed_cm_s"] == 3
    (point,) = points(load_scenario({"sweep": {"points": [{WIDTH: 80, "arena": {"height_cm": 90}}]}}))
    assert (point.scenario.arena.width_cm, point.scenario.arena.height_cm) == (80, 90)


def test_controllers_are_found_beside_the_scenario_and_known_by_their_file_s_name(tmp_path) -> None:
    path = tmp_path / "scene.yaml"
    (tmp_path / "mine.py").write_text(MINE)
    path.write_text(f"robots: [{{count: 2}}]\nsweep: {{grid: {{{CONTROLLER}: [mine.py, constant, firefly]}}}}")
    scenario = load_scenario(path)
    mine, constant, firefly = found = points(scenario)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "scenario.yaml").write_text(write_scenario(scenario))
    assert load_scenario(tmp_path / "run") == scenario
    assert points(tmp_path / "run") == found
    assert [point.axes[CONTROLLER] for point in found] == ["mine.py", "constant", "firefly"]
    assert mine.scenario.robots[0].controller == str(tmp_path / "mine.py")
    assert mine.scenario.robots[0].parameters == {"pace": 2.0}
    assert constant.scenario.robots[0].parameters == {"left_cm_s": 0.0, "right_cm_s": 0.0, "ring_on": False}
    assert firefly.scenario == load_scenario({"name": "scene", "robots": [{"count": 2}]})
    whole = "{controller: mine.py, count: 2}"
    for sweep in (
        f"zip: {{{CONTROLLER}: [mine.py]}}",
        f"points: [{{{CONTROLLER}: mine.py}}]",
        f"grid: {{robots: [[{whole}]]}}",
    ):
        path.write_text(f"robots: [{{count: 2}}]\nsweep: {{{sweep}}}")
        assert points(load_scenario(path))[0].scenario == mine.scenario
    (tmp_path / "eye.py").write_text(
        "READINGS = {'eye': float}\ndef sense(world, robot, readings, parameters, random): 0"
    )
    path.write_text(f"sensors: [eye.py]\nsweep: {{grid: {{{CONTROLLER}: [mine.py, firefly]}}}}")
    assert {point.scenario.robots[0].sensors["eye"]["file"] for point in points(path)} == {str(tmp_path / "eye.py")}


def points_of_one_name(folder: Path, first: str, second: str) -> tuple[Point, ...]:
    """Return the points of a sweep over two controllers in two folders."""
    for number, name in enumerate((first, second)):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(MINE.replace("2.0", f"{number}.5"))
    (folder / "scene.yaml").write_text(f"sweep: {{grid: {{{CONTROLLER}: [{first}, {second}, firefly]}}}}")
    return points(folder / "scene.yaml")


@pytest.mark.parametrize(
    ("first", "second", "names"),
    [
        ("a/c.py", "b/c.py", ["a/c.py", "b/c.py", "firefly"]),
        ("a/c.py", "b/d.py", ["c.py", "d.py", "firefly"]),
        ("a/firefly.py", "b/firefly.py", ["a/firefly.py", "b/firefly.py", "firefly"]),
    ],
)
def test_controllers_of_one_file_name_are_distinguished_by_their_folders(tmp_path, first, second, names) -> None:
    one, other, _ = found = points_of_one_name(tmp_path / "here", first, second)
    assert [point.axes[CONTROLLER] for point in found] == names
    assert [one.scenario.robots[0].parameters["pace"], other.scenario.robots[0].parameters["pace"]] == [0.5, 1.5]
    moved = points_of_one_name(tmp_path / "there" / "deeper", first, second)
    assert [point.key for point in moved] == [point.key for point in found]
