"""Points of a sweep and their seeds: the right scenario at each, the same seed whatever stands beside it."""

import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.util.seeds import point_seed

COUNT, WIDTH, SPEED = "robots.0.count", "arena.width_cm", "robots.0.parameters.speed_cm_s"
CONTROLLER = "robots.0.controller"

MINE = """
PARAMETERS = {"pace": 2.0}
MEMORY = {}

def start(memory, parameters, random):
    pass

def step(sensors, memory, actuators, parameters, random):
    actuators.left_cm_s = parameters.pace
"""


def grid(**axes):
    """Return the points of a grid; a key's dots are written as two underscores."""
    return points(load_scenario({"sweep": {"grid": {key.replace("__", "."): axes[key] for key in axes}}}))


def seeds(scenario, trials: int = 3):
    """Return the seeds of the first trials by the point's key."""
    return {point.key: [point.seed(trial) for trial in range(trials)] for point in points(scenario)}


def test_a_scenario_without_a_sweep_is_one_point_without_axes() -> None:
    scenario = load_scenario("thesis")
    (point,) = points(scenario)
    assert (point.number, point.axes, point.key) == (0, {}, "{}")
    assert point.scenario == scenario


def test_points_are_numbered_in_the_order_of_the_rows_and_hold_the_values_as_written() -> None:
    found = grid(robots__0__count=[2, 3], arena__width_cm=[50, 60.5])
    assert [point.number for point in found] == [0, 1, 2, 3]
    assert [point.axes for point in found] == [
        *({COUNT: 2, WIDTH: 50}, {COUNT: 2, WIDTH: 60.5}, {COUNT: 3, WIDTH: 50}, {COUNT: 3, WIDTH: 60.5})
    ]


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


@settings(max_examples=30)
@given(numbered_sweeps())
def test_each_point_is_the_scenario_with_its_values_set_one_by_one(axes: dict) -> None:
    scenario = load_scenario({"name": "base", "trials": 5, "seed": 9, "sweep": {"grid": axes}})
    for point in points(scenario):
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


@settings(max_examples=50)
@given(columns=st.dictionaries(st.sampled_from(["arena", "noise", WIDTH]), COLUMNS, min_size=1), listed=JSON)
def test_a_sweep_that_is_written_is_read_again(columns: dict, listed) -> None:
    scenario = load_scenario({"sweep": {"grid": columns, "zip": {"stop": [listed]}, "points": [{"timing": listed}]}})
    assert load_scenario(parse_yaml(write_scenario(scenario), "written")) == scenario


@pytest.mark.parametrize("name", ["1e3", "08"])
def test_a_name_that_looks_like_a_number_is_written_as_a_name(name: str) -> None:
    assert load_scenario(parse_yaml(write_scenario(load_scenario({"name": name})), "written")).name == name


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


def test_all_seeds_of_a_big_sweep_are_distinct_whole_numbers_of_53_bits() -> None:
    found = [point.seed(trial) for point in points(load_scenario("fig-4-2a")) for trial in range(100)]
    assert len(set(found)) == len(found) == 10_000
    assert 2**52 < max(found) < 2**53
    assert min(found) >= 0


def test_another_master_seed_gives_other_seeds_at_the_same_points() -> None:
    sweep = {"sweep": {"grid": {COUNT: [2, 3]}}}
    found = [seeds(load_scenario({**sweep, "seed": master})) for master in (0, 1, 2**53, 10**30)]
    assert all(each.keys() == found[0].keys() for each in found)
    flat = [seed for each in found for column in each.values() for seed in column]
    assert len(set(flat)) == len(flat) == 4 * 2 * 3


@given(
    master=st.integers(0, 2**64), point=st.text(max_size=20), other=st.text(max_size=20), trial=st.integers(0, 10**7)
)
def test_a_seed_changes_with_the_point_and_with_the_trial(master: int, point: str, other: str, trial: int) -> None:
    seed = point_seed(master, point, trial)
    assert 0 <= seed < 2**53
    assert seed == point_seed(master, point, trial)
    assert seed != point_seed(master, point, trial + 1)
    assert (seed == point_seed(master, other, trial)) == (point == other)


@settings(max_examples=30)
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


@settings(max_examples=30)
@given(axes=numbered_sweeps(), chance=st.randoms(use_true_random=False))
def test_the_order_of_axes_and_values_leaves_keys_and_seeds(axes: dict, chance: random.Random) -> None:
    shuffled = {key: chance.sample(axes[key], len(axes[key])) for key in chance.sample(list(axes), len(axes))}
    assert seeds(load_scenario({"sweep": {"grid": shuffled}})) == seeds(load_scenario({"sweep": {"grid": axes}}))


@settings(max_examples=30)
@given(numbered_sweeps())
def test_a_grid_and_its_points_listed_or_zipped_have_the_same_keys_and_seeds(axes: dict) -> None:
    scenario = load_scenario({"sweep": {"grid": axes}})
    rows = [point.axes for point in points(scenario)]
    zipped = {key: [row[key] for row in rows] for key in axes}
    backwards = [dict(reversed(row.items())) for row in rows]
    for sweep in ({"points": rows}, {"points": backwards}, {"zip": zipped}):
        assert seeds(load_scenario({"sweep": sweep})) == seeds(scenario)


@pytest.mark.parametrize(
    ("key", "value", "written"),
    [
        (COUNT, 1, 1.0),
        (SPEED, 0.5, 5e-1),
        ("robots.0.camera", {"pixels": 20, "range_cm": 5}, {"range_cm": 5.0, "pixels": 20}),
    ],
)
def test_a_value_written_in_another_way_is_the_same_point(key: str, value, written) -> None:
    found, same = (seeds(load_scenario({"sweep": {"points": [{key: each}]}})) for each in (value, written))
    assert same == found


def test_a_value_written_in_another_way_in_yaml_is_the_same_point() -> None:
    found = [seeds(load_scenario({}, axes=[f"{SPEED}={text}"])) for text in ("1", "1.0", "1e0", "+1", "01")]
    assert found == [found[0]] * 5


@pytest.mark.parametrize(
    "change", ["trials=500", "name=other", "description=other", "arena.height_cm=80", "stop.max_cycles=7", "noise=off"]
)
def test_seeds_do_not_depend_on_trials_or_on_what_is_the_same_at_all_points(change: str) -> None:
    base = {"sweep": {"grid": {COUNT: [2, 3]}}, "trials": 4}
    assert seeds(load_scenario(base, [change])) == seeds(load_scenario(base))


# Axes of all kinds


def test_controllers_are_found_beside_the_scenario_and_known_by_their_file_s_name(tmp_path) -> None:
    path = tmp_path / "scene.yaml"
    (tmp_path / "mine.py").write_text(MINE)
    path.write_text(f"robots: [{{count: 2}}]\nsweep: {{grid: {{{CONTROLLER}: [mine.py, constant, firefly]}}}}")
    mine, constant, firefly = points(load_scenario(path))
    assert [point.axes[CONTROLLER] for point in (mine, constant, firefly)] == ["mine.py", "constant", "firefly"]
    assert mine.scenario.robots[0].controller == str(tmp_path / "mine.py")
    assert mine.scenario.robots[0].parameters == {"pace": 2.0}
    assert constant.scenario.robots[0].parameters == {"left_cm_s": 0.0, "right_cm_s": 0.0, "ring_on": False}
    assert firefly.scenario == load_scenario({"name": "scene", "robots": [{"count": 2}]})


@pytest.mark.parametrize("sweep", ["zip: {{{}: [mine.py, firefly]}}", "points: [{{{}: mine.py}}, {{{}: firefly}}]"])
def test_controllers_in_zip_and_points_are_found_too(tmp_path, sweep: str) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "scene.yaml").write_text(f"sweep: {{{sweep.format(CONTROLLER, CONTROLLER)}}}")
    mine, firefly = points(load_scenario(tmp_path / "scene.yaml"))
    assert mine.scenario.robots[0].controller == str(tmp_path / "mine.py")
    assert firefly.scenario.robots[0].controller == "firefly"


def two_of_one_name(folder: Path, first: str, second: str) -> Scenario:
    """Return a sweep over two controllers of one name in two folders."""
    for number, name in enumerate((first, second)):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(MINE.replace("2.0", f"{number}.5"))
    (folder / "scene.yaml").write_text(f"sweep: {{grid: {{{CONTROLLER}: [{first}, {second}, firefly]}}}}")
    return load_scenario(folder / "scene.yaml")


@pytest.mark.parametrize(
    ("first", "second", "names"),
    [
        ("a/c.py", "b/c.py", ["a/c.py", "b/c.py", "firefly"]),
        ("a/x/c.py", "b/x/c.py", ["a/x/c.py", "b/x/c.py", "firefly"]),
        ("a/c.py", "b/d.py", ["c.py", "d.py", "firefly"]),
        ("a/firefly.py", "b/firefly.py", ["a/firefly.py", "b/firefly.py", "firefly"]),
    ],
)
def test_controllers_of_one_file_name_are_distinguished_by_their_folders(tmp_path, first, second, names) -> None:
    one, other, _ = found = points(two_of_one_name(tmp_path / "here", first, second))
    assert [point.axes[CONTROLLER] for point in found] == names
    assert [one.scenario.robots[0].parameters["pace"], other.scenario.robots[0].parameters["pace"]] == [0.5, 1.5]
    moved = points(two_of_one_name(tmp_path / "there" / "deeper", first, second))
    assert [point.key for point in moved] == [point.key for point in found]


def test_one_controller_named_twice_makes_two_points_the_same(tmp_path) -> None:
    with pytest.raises(ScenarioError, match="points 0 and 1 are the same"):
        points(two_of_one_name(tmp_path, "a/c.py", "a/../a/c.py"))


def test_a_sweep_over_a_user_s_controller_is_the_same_when_it_is_written_and_read_elsewhere(tmp_path) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "scene.yaml").write_text(f"sweep: {{grid: {{{CONTROLLER}: [mine.py, firefly]}}}}")
    scenario = load_scenario(tmp_path / "scene.yaml")
    elsewhere = tmp_path / "run"
    elsewhere.mkdir()
    (elsewhere / "scenario.yaml").write_text(write_scenario(scenario))
    assert load_scenario(elsewhere) == scenario
    assert points(load_scenario(elsewhere)) == points(scenario)


@pytest.mark.parametrize("axis", ["robots.0: [{}]", "robots: [[{}]]"])
def test_a_controller_in_an_axis_over_robots_is_found_beside_the_scenario(tmp_path, axis: str) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    group = axis.format("{controller: mine.py, count: 2}")
    (tmp_path / "scene.yaml").write_text(f"sweep: {{grid: {{{group}}}}}")
    (point,) = points(load_scenario(tmp_path / "scene.yaml"))
    assert point.scenario.robots[0].controller == str(tmp_path / "mine.py")


def test_the_parameters_of_a_swept_controller_can_be_an_axis_too() -> None:
    found = grid(robots__0__controller=["oscillator", "firefly"], robots__0__parameters__period_s=[5, 8])
    assert [
        (point.scenario.robots[0].controller, point.scenario.robots[0].parameters["period_s"]) for point in found
    ] == [*(("oscillator", 5), ("oscillator", 8), ("firefly", 5), ("firefly", 8))]


def test_noise_as_a_whole_can_be_an_axis_by_its_words_too() -> None:
    off, on, some = grid(noise=["off", "on", {"wheel_speed": 0.1}])
    assert [point.scenario.noise.wheel_speed for point in (off, on, some)] == [0, 0.05, 0.1]
    assert [point.scenario.noise.infrared_counts for point in (off, on, some)] == [0, 10, 10]


@pytest.mark.parametrize("order", [["arena", WIDTH], [WIDTH, "arena"]], ids=" then ".join)
def test_a_section_as_a_whole_is_set_before_a_key_that_lies_in_it(order: list[str]) -> None:
    row = {"arena": {"height_cm": 90}, WIDTH: 80}
    (point,) = points(load_scenario({"sweep": {"points": [{key: row[key] for key in order}]}}))
    assert (point.scenario.arena.width_cm, point.scenario.arena.height_cm) == (80, 90)


# Mistakes


def test_a_scenario_with_a_sweep_is_not_simulated() -> None:
    scenario = load_scenario({"name": "x", "sweep": {"grid": {COUNT: [2]}}})
    with pytest.raises(ScenarioError, match=r"^x: is a sweep; simulate one of its points"):
        Simulation(scenario)
