"""Keys and axes that people type, and the points of sweeps: which values meet, in which order, with which seeds."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import Point, ScenarioError, points
from epuck_sim.scenario.axes import MAX_POINTS, SweepAxes, with_ranges
from epuck_sim.scenario.base import guess
from epuck_sim.scenario.keys import axis_key, full_keys
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.scenario import WITHOUT_EFFECT
from epuck_sim.util.seeds import point_seed
from epuck_sim.util.yaml_io import parse_yaml
from tests.control.bench import with_sense, with_step
from tests.runs.made_folders import COUNT, SPEED, WIDTH

LOADED = map(load_scenario, ("thesis", "particles", "obstacles"))
KEYS = {scenario.name: scenario.all_keys(scenario.model_dump(mode="json")) for scenario in LOADED}


def test_an_ending_stands_for_the_key_on_which_trials_depend_and_sets_what_it_sets() -> None:
    places = {
        "thesis": {
            "speed_cm_s": "robots.0.parameters.speed_cm_s",
            "field_of_view_deg": "robots.0.camera.field_of_view_deg",
            "overhead.field_of_view_deg": "overhead.field_of_view_deg",
            "phase_ms": "robots.0.memory.phase_ms",
            "count": "robots.0.count",
            "height_cm": "arena.height_cm",
            "light": "overhead.light",
        },
        "particles": {"speed_cm_s": "agents.speed_cm_s", "coupling": "response.coupling", "k": "neighbourhood.k"},
    }
    for name, of_typed in places.items():
        for typed, key in of_typed.items():
            assert full_keys(typed, KEYS[name], "x") == [key]
    short = load_scenario("thesis", ["speed_cm_s=3", "camera.pixels=20"], ["count=2,3"])
    settings = ["robots.0.parameters.speed_cm_s=3", "robots.0.camera.pixels=20"]
    assert short == load_scenario("thesis", settings, ["robots.0.count=2,3"])


@given(st.data())
def test_every_ending_of_a_key_stands_for_it_or_is_refused_with_it_among_the_candidates(data) -> None:
    keys = KEYS[data.draw(st.sampled_from(sorted(KEYS)))]
    key = data.draw(st.sampled_from(keys))
    parts = key.split(".")
    ending = ".".join(parts[data.draw(st.integers(0, len(parts) - 1)) :])
    try:
        found = full_keys(ending, keys, "x")
    except ScenarioError as refused:
        found = str(refused).rpartition("give one of ")[2].split(", ")
    without = WITHOUT_EFFECT | {"robot.height_cm"}
    has_effect = {each: without.isdisjoint((each, each.partition(".")[0])) for each in (key, *found)}
    is_second = not has_effect[key] and any(has_effect.values())
    assert key in found or is_second or ending in keys


def test_parameters_of_measures_are_keys_sweeps_are_not_and_longer_names_go_on_after_an_underscore() -> None:
    scenario = load_scenario({"measures": [{"near_walls": {"within_cm": 3}}]}, axes=["robots.0.count=2,3"])
    sections = {key.partition(".")[0] for key in scenario.all_keys(scenario.model_dump(mode="json"))}
    assert "robots" in sections
    assert "sweep" not in sections
    of_degree = ["measures.0.degree.direction", "measures.0.degree.statistic"]
    assert [key for key in scenario.all_keys({"measures": ["degree", 5]}) if key.startswith("measures")] == of_degree
    assert "did you mean side_cm (space.side_cm)?" in guess("side", [], ["space.sides", "space.side_cm"])


def test_an_ending_in_several_groups_means_all_and_says_so_and_is_the_axis_of_the_first_where_they_are_alike() -> None:
    groups = {"name": "two", "robots": [{"count": 2}, {"count": 3}]}
    with pytest.warns(UserWarning, match=r"speed_cm_s stands for robots\.0\.\S+ and robots\.1\.parameters\.speed_cm_s"):
        scenario = load_scenario(groups, ["speed_cm_s=3"])
    assert [group.parameters["speed_cm_s"] for group in scenario.robots] == [3, 3]
    with pytest.warns(UserWarning, match="stands for"):
        sweep = points(load_scenario(groups, axes=["speed_cm_s=1:4:2", "coupling=0.1,0.2", "0.count=4,5"]))
    assert len(sweep) == 8
    for point in sweep:
        first, second = (group.parameters for group in point.scenario.robots)
        assert (first["speed_cm_s"], first["coupling"]) == (second["speed_cm_s"], second["coupling"])
    with pytest.warns(UserWarning, match="sensors stands for those of all 2 groups of robots"):
        load_scenario(groups, ["sensors=[]"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_scenario(groups, ["0.count=3", "1.speed_cm_s=7"]).robots[1].parameters["speed_cm_s"] == 7
    with pytest.warns(UserWarning, match="stands for"):
        again = points(load_scenario(groups, axes=["count=2,3", "coupling=0.1,0.2", "count=4,5"]))
    assert [point.axes["robots.1.count"] for point in again] == [4, 5, 4, 5]
    alike = [{"robots.0.count": count, "robots.1.count": count} for count in (2, 3)]
    for typed, key in {"count": "robots.0.count", "1.count": "robots.1.count", "k": "k"}.items():
        assert axis_key(typed, alike, "--x") == key
    with pytest.raises(ScenarioError, match=r"--x: count is the ending of 2 axes; give one of robots.0.count, "):
        axis_key("count", [*alike, {"robots.0.count": 2, "robots.1.count": 3}], "--x")


NUMBERS = st.floats(-1e6, 1e6, allow_nan=False).map(lambda value: float(f"{value:.6g}"))

SCALES = st.sampled_from(["", ":lin", ":log"])


@given(NUMBERS, NUMBERS, st.integers(2, 50), SCALES, st.sampled_from(["a.x", "a.speed_cm_s"]))
def test_a_range_is_even_from_its_first_number_to_its_last(a, b, number, scale, key) -> None:
    low, high = sorted((a, b))
    text = f"{low!r}:{high!r}:{number}{scale}"
    is_log = scale == ":log" or (not scale and low > 0 and (key.endswith("speed_cm_s") or high >= 10 * low))
    if low == high or (is_log and low <= 0):
        with pytest.raises(ValueError, match="allowed: FROM:TO:NUMBER"):
            with_ranges(key, text)
        return
    values = np.array(with_ranges(key, text))
    assert (values[0], values[-1], len(values)) == (low, high, number)
    steps = np.diff(np.log(values) if is_log else values)
    assert np.allclose(steps, steps.mean(), atol=2e-5 * (1 if is_log else np.abs(values).max()))


def test_ranges_stand_beside_values_in_files_whole_ones_are_whole_and_all_points_allowed_are_made() -> None:
    grid = {"robots.0.count": "5:20:4", "arena.width_cm": [50, "60:80:3:lin"]}
    sweep = load_scenario({"sweep": {"grid": grid}}).sweep
    assert sweep.grid == {"robots.0.count": (5, 10, 15, 20), "arena.width_cm": (50, 60, 70, 80)}
    assert all(isinstance(value, int) for value in sweep.grid["robots.0.count"])
    assert with_ranges("a.x", "-0.1:0.2:4") == [-0.1, 0.0, 0.1, 0.2]
    assert with_ranges("measures.0.odds.ratio", ["1:2", "12:30:x"]) == ["1:2", "12:30:x"]  # a text, to the measure
    assert with_ranges("robots.0.controller", ["C:\\a.py", "1:2.py"]) == ["C:\\a.py", "1:2.py"]
    given = {"points": [{"p": 0}, {"p": 1}], "zip": {"z": [*range(50)]}, "grid": {"g": [*range(1000)]}}
    assert len(SweepAxes.model_validate(given).rows()) == MAX_POINTS == 100_000


VALUES = st.integers(0, 9) | st.sampled_from(["on", None, 0.5, [1, 2], {"x": 1}])


@st.composite
def sweeps(draw):
    """Return the points, zip and grid of some sweep; together they have an axis at least."""
    names = draw(st.permutations("abcdefg"))
    listed, zipped = names[: draw(st.integers(0, 2))], names[2 : 2 + draw(st.integers(0, 2))]
    gridded = names[4 : 4 + draw(st.integers(0 if listed or zipped else 1, 3))]
    together = draw(st.integers(1, 4))
    row = st.fixed_dictionaries(dict.fromkeys(listed, VALUES))
    given = {
        "zip": {name: draw(st.lists(VALUES, min_size=together, max_size=together)) for name in zipped},
        "grid": {name: draw(st.lists(VALUES, min_size=1, max_size=3)) for name in gridded},
    }
    return {**given, "points": draw(st.lists(row, min_size=1, max_size=3))} if listed else given


@settings(max_examples=40)
@given(sweeps())
def test_rows_are_those_found_by_splitting_one_axis_after_the_other(given: dict) -> None:
    axes, expected = SweepAxes.model_validate(given), [dict(row) for row in given.get("points", [{}])]
    if given["zip"]:
        together = [dict(zip(given["zip"], values, strict=True)) for values in zip(*given["zip"].values(), strict=True)]
        expected = [{**row, **each} for row in expected for each in together]
    for name, values in given["grid"].items():
        expected = [{**row, name: value} for row in expected for value in values]
    assert axes.rows() == expected
    assert {tuple(row) for row in axes.rows()} == {tuple(axes.keys)}


def grid_of(source, *axes: str):
    return list(load_scenario(source, axes=axes).sweep.grid.items())


def test_sweep_on_the_command_line_makes_axes_in_order_and_adds_to_a_file_s_grid_or_replaces(tmp_path) -> None:
    expected = [(COUNT, (2, 3)), (WIDTH, (50.5, 60))]
    for source in ("pair", load_scenario("pair"), {}):
        assert grid_of(source, f"{COUNT}=2,3", f"{WIDTH}=50.5, 60") == expected
    ring = {"shape": "circle", "x_cm": 30, "y_cm": 30, "radius_cm": 3}
    obstacles = "arena.obstacles=[],[{shape: circle, x_cm: 30, y_cm: 30, radius_cm: 3}]"
    given = grid_of({}, "noise=on,off", "stop.max_time_s=null,5", obstacles)
    assert given == [("noise", ("on", "off")), ("stop.max_time_s", (None, 5)), ("arena.obstacles", ([], [ring]))]
    path = tmp_path / "mine.yaml"
    path.write_text(f"sweep: {{zip: {{arena.height_cm: [50, 60]}}, grid: {{{COUNT}: [2, 3], {WIDTH}: [50]}}}}")
    given = grid_of(path, f"{SPEED}=1,2", f"{COUNT}=9", f"{COUNT}=7")
    assert given == [(COUNT, (7,)), (WIDTH, (50,)), (SPEED, (1, 2))]
    assert load_scenario(path, axes=[f"{SPEED}=1"]).sweep.zip == {"arena.height_cm": (50, 60)}
    assert grid_of(load_scenario(path), f"{SPEED}=1,2", f"{COUNT}=7") == given


CONTROLLER = "robots.0.controller"
MINE = with_step("actuators.left_cm_s = parameters.pace", PARAMETERS='{"pace": 2.0}')


def seeds(scenario, trials: int = 3):
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


def test_seeds_are_those_of_every_version_before_and_depend_on_neither_trials_nor_what_is_the_same() -> None:
    of_axes = f'{{"{COUNT}": 2.0, "{SPEED}": 0.5}}'
    for master, axes, key, *expected in (
        (0, {}, "{}", 3863378073750256, 3225868734339422, 3231444368234837),
        (0, {COUNT: 2, SPEED: 0.5}, of_axes, 7015346984533444, 4535980160901266, 2834362922018468),
        (2016, {"noise": "off"}, '{"noise": "off"}', 8778295633544210, 2125023039864183, 932086395961719),
    ):
        (point,) = points(load_scenario({"seed": master, **({"sweep": {"points": [axes]}} if axes else {})}))
        assert point.key == key
        assert [point.seed(trial) for trial in (0, 1, 199)] == expected
    base = {"sweep": {"grid": {COUNT: [2, 3]}}, "trials": 4}
    others = ["arena.height_cm=80", "stop.max_cycles=7", "noise=off"]
    for change in ("trials=500", "name=other", "description=other", *others):
        assert seeds(load_scenario(base, [change])) == seeds(load_scenario(base))


@given(st.integers(0, 2**64), st.text(max_size=20), st.text(max_size=20), st.integers(0, 10**7))
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


def test_words_sections_conditions_and_parameters_of_swept_controllers_can_be_axes_too() -> None:
    off, on, some = points({"sweep": {"grid": {"noise": ["off", "on", {"wheel_speed": 0.1}]}}})
    assert [point.scenario.noise.wheel_speed for point in (off, on, some)] == [0, 0.05, 0.1]
    grid = {CONTROLLER: ["oscillator", "firefly"], "robots.0.parameters.period_s": [5, 8]}
    groups = [point.scenario.robots[0] for point in points({"sweep": {"grid": grid}})]
    expected = [("oscillator", 5), ("oscillator", 8), ("firefly", 5), ("firefly", 8)]
    assert [(group.controller, group.parameters["period_s"]) for group in groups] == expected
    given = {"parameters": {"period_s": 8, "speed_cm_s": 3}, "memory": {"phase_ms": 100}}
    blinks, moves = points({"robots": [given], "sweep": {"grid": {CONTROLLER: grid[CONTROLLER]}}})
    for point in (blinks, moves):
        assert point.scenario.robots[0].parameters["period_s"] == 8
        assert point.scenario.robots[0].memory == {"phase_ms": 100}
    assert "speed_cm_s" not in blinks.scenario.robots[0].parameters
    assert points(load_scenario("thesis", axes=["controller = constant"]))[0].scenario.controllers == ("constant",)
    assert moves.scenario.robots[0].parameters["speed_cm_s"] == 3
    (point,) = points(load_scenario({"sweep": {"points": [{WIDTH: 80, "arena": {"height_cm": 90}}]}}))
    assert (point.scenario.arena.width_cm, point.scenario.arena.height_cm) == (80, 90)
    drives, later = [{"controller": "constant", "count": 2}], {"at_s": 1, "set": {"robots.0.parameters.left_cm_s": 2}}
    for grid in ({"robots.0": drives}, {"robots": [drives]}):  # the scenario's own controller has no such parameter
        assert points({"schedule": [later], "sweep": {"grid": grid}})[0].scenario.schedule[0].set == later["set"]
    for base, robots in (  # what only the points have
        ({"stop": {"reference_robot": 12}}, [{"count": 20}]),
        ({"schedule": [{"at_s": 1, "remove": [12]}, {"at_s": 2, "add": [12]}]}, [{"count": 20}]),
        ({"schedule": [{"at_s": 1, "set": {"robots.1.parameters.coupling": 0}}]}, [{"count": 2}, {"count": 3}]),
        ({"robots": [{"count": 51}], "overhead": {"tags": "4X4_50"}}, [{"count": 50}]),
    ):
        assert points(swept := load_scenario({**base, "sweep": {"grid": {"robots": [robots]}}}))[0].axes
        assert (swept.notes, swept.has_t_sync) == ([], True)
    waits = {"measures": ["near_walls"], "stop": {"when": "near_walls < 0.25"}}
    for key, typed in (("stop.when.value", "0.1,0.2"), ("stop.when", "near_walls < 0.1,near_walls < 0.2")):
        found = points(load_scenario(waits, axes=[f"{key}={typed}"]))
        assert [str(point.scenario.stop.when) for point in found] == ["near_walls < 0.1", "near_walls < 0.2"]
    narrows = {"robots": [{"count": 1, "signal": {"kind": "radio"}}], "schedule": [{"at_s": 1, "set": {WIDTH: 5}}]}
    assert points({**narrows, "sweep": {"grid": {"robot": ["kilobot"]}}})  # e-pucks are wider than 5 cm


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
    one = f"{{{CONTROLLER}: mine.py}}"
    for sweep in (f"zip: {{{CONTROLLER}: [mine.py]}}", f"points: [{one}]", f"grid: {{robots: [[{whole}]]}}"):
        path.write_text(f"robots: [{{count: 2}}]\nsweep: {{{sweep}}}")
        assert points(load_scenario(path))[0].scenario == mine.scenario
    (tmp_path / "eye.py").write_text(with_sense("pass", "{'eye': float}"))
    path.write_text(f"sensors: [eye.py]\nsweep: {{grid: {{{CONTROLLER}: [mine.py, firefly]}}}}")
    assert {point.scenario.robots[0].sensors["eye"]["file"] for point in points(path)} == {str(tmp_path / "eye.py")}


def points_of_one_name(folder: Path, first: str, second: str) -> tuple[Point, ...]:
    for number, name in enumerate((first, second)):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(MINE.replace("2.0", f"{number}.5"))
    (folder / "scene.yaml").write_text(f"sweep: {{grid: {{{CONTROLLER}: [{first}, {second}, firefly]}}}}")
    return points(folder / "scene.yaml")


def test_controllers_of_one_file_name_are_distinguished_by_their_folders(tmp_path) -> None:
    for folder, first, second, names in (
        ("one", "a/c.py", "b/c.py", ["a/c.py", "b/c.py"]),
        ("two", "a/c.py", "b/d.py", ["c.py", "d.py"]),
        ("three", "a/firefly.py", "b/firefly.py", ["a/firefly.py", "b/firefly.py"]),
    ):
        one, other, _ = found = points_of_one_name(tmp_path / folder, first, second)
        assert [point.axes[CONTROLLER] for point in found] == [*names, "firefly"]
        assert [each.scenario.robots[0].parameters["pace"] for each in (one, other)] == [0.5, 1.5]
        moved = points_of_one_name(tmp_path / "deeper" / folder, first, second)
        assert [point.key for point in moved] == [point.key for point in found]
