"""Axes of a sweep: which values meet, in which order, how the command line adds them, and what is refused."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from epuck_sim.errors import EpuckSimError, ScenarioError
from epuck_sim.scenario.axes import MAX_POINTS, SweepAxes, check_figure_axes, check_panels, choose_axis
from epuck_sim.scenario.keys import add_axis
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import FigureSection

COUNT, WIDTH, SPEED = "robots.0.count", "arena.width_cm", "robots.0.parameters.speed_cm_s"


def rows(**given):
    return SweepAxes.model_validate(given).rows()


def test_points_change_slowest_then_the_zip_then_the_grid() -> None:
    given = {"points": [{"p": 0}, {"p": 1}], "zip": {"z": [0, 1], "y": [5, 6]}, "grid": {"g": [0, 1]}}
    assert [(row["p"], row["z"], row["y"], row["g"]) for row in rows(**given)] == [
        *((0, 0, 5, 0), (0, 0, 5, 1), (0, 1, 6, 0), (0, 1, 6, 1)),
        *((1, 0, 5, 0), (1, 0, 5, 1), (1, 1, 6, 0), (1, 1, 6, 1)),
    ]
    assert SweepAxes.model_validate(given).keys == ["p", "z", "y", "g"]


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


def rows_one_by_one(given):
    """Return the rows, each axis of the grid in turn splitting every row into one for each of its values."""
    found = [dict(row) for row in given.get("points", [{}])]
    if given["zip"]:
        together = len(next(iter(given["zip"].values())))
        found = [
            {**row, **{name: values[place] for name, values in given["zip"].items()}}
            for row in found
            for place in range(together)
        ]
    for name, values in given["grid"].items():
        found = [{**row, name: value} for row in found for value in values]
    return found


@given(sweeps())
def test_rows_are_those_found_by_splitting_one_axis_after_the_other(given: dict) -> None:
    assert rows(**given) == rows_one_by_one(given)


def test_every_row_has_its_keys_in_the_order_of_the_axes() -> None:
    axes = SweepAxes.model_validate({"points": [{"a": 1, "b": 2}, {"b": 3, "a": 4}]})
    assert [list(row) for row in axes.rows()] == [axes.keys, axes.keys]


def test_axes_cannot_be_changed() -> None:
    axes = SweepAxes.model_validate({"grid": {"a": [1]}})
    with pytest.raises(ValidationError, match="frozen"):
        axes.grid = {"a": (2,)}


def test_too_many_points_are_refused_and_as_many_as_allowed_are_not() -> None:
    given = {"points": [{"p": 0}, {"p": 1}], "zip": {"z": [*range(50)]}, "grid": {"g": [*range(1000)]}}
    assert len(SweepAxes.model_validate(given).rows()) == MAX_POINTS == 100_000
    given["grid"]["g"].append(1000)
    with pytest.raises(ScenarioError, match=r"^scenario: sweep: has 100100 points; allowed: up to 100000$"):
        load_scenario({"sweep": given})


def test_too_many_points_are_refused_at_once_however_many() -> None:
    given = {"grid": {f"x{number}": [*range(10)] for number in range(30)}}
    with pytest.raises(ScenarioError, match=f"has {10**30} points"):
        load_scenario({"sweep": given})


def grid_of(source, *axes: str, settings=()):
    sweep = load_scenario(source, settings, axes).sweep
    assert sweep is not None
    return list(sweep.grid.items())


def test_sweep_on_the_command_line_makes_axes_in_the_order_in_which_they_are_given() -> None:
    expected = [(COUNT, (2, 3)), (WIDTH, (50.5, 60))]
    for source in ("pair", load_scenario("pair"), {}):
        assert grid_of(source, f"{COUNT}=2,3", f"{WIDTH}=50.5, 60") == expected


def test_sweep_on_the_command_line_adds_to_a_file_s_grid_or_replaces_in_its_place(tmp_path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(f"sweep: {{zip: {{arena.height_cm: [50, 60]}}, grid: {{{COUNT}: [2, 3], {WIDTH}: [50]}}}}")
    given = grid_of(path, f"{SPEED}=1,2", f"{COUNT}=7")
    assert given == [(COUNT, (7,)), (WIDTH, (50,)), (SPEED, (1, 2))]
    assert load_scenario(path, axes=[f"{SPEED}=1"]).sweep.zip == {"arena.height_cm": (50, 60)}
    assert grid_of(load_scenario(path), f"{SPEED}=1,2", f"{COUNT}=7") == given


def test_of_two_axes_on_the_command_line_with_one_key_the_later_wins() -> None:
    assert grid_of("pair", f"{COUNT}=2,3", f"{COUNT}=4") == [(COUNT, (4,))]


def test_sweep_on_the_command_line_takes_words_nothing_lists_and_mappings() -> None:
    ring = "{shape: circle, x_cm: 30, y_cm: 30, radius_cm: 3}"
    assert grid_of({}, "noise=on,off", "stop.max_time_s=null,5", f"arena.obstacles=[],[{ring}]") == [
        ("noise", ("on", "off")),
        ("stop.max_time_s", (None, 5)),
        ("arena.obstacles", ([], [{"shape": "circle", "x_cm": 30, "y_cm": 30, "radius_cm": 3}])),
    ]


def test_an_axis_leaves_the_mapping_to_which_it_is_applied_as_it_was() -> None:
    given = {"sweep": {"grid": {"a": [1]}}}
    assert add_axis(given, ["b"], [2], "x") == {"sweep": {"grid": {"a": [1], "b": [2]}}}
    assert given == {"sweep": {"grid": {"a": [1]}}}


def test_a_setting_beside_an_axis_is_taken() -> None:
    scenario = load_scenario({}, ["robots.0.camera.pixels=20", f"{WIDTH}=70"], ["robots.0.camera.range_cm=30,40"])
    assert scenario.robots[0].camera.pixels == 20
    assert scenario.arena.width_cm == 70


NOISE, HEIGHT = "noise", "arena.height_cm"
ROWS = [
    {SPEED: speed, COUNT: count, NOISE: noise, WIDTH: 10 * count, HEIGHT: 60}
    for speed in (1, 2)
    for count in (3, 5)
    for noise in ("on", "off")
]


@pytest.mark.parametrize(
    "figure",
    [
        {},
        {"x": COUNT},
        {"x": SPEED, "y": COUNT},
        {"y": WIDTH},
        {"y": HEIGHT},
        {"panels": NOISE},
        {"panels": COUNT},
        {"base_case": {COUNT: 3}},
    ],
    ids=str,
)
def test_what_names_axes_is_accepted(figure: dict[str, Any]) -> None:
    check_figure_axes(FigureSection(**figure), ROWS)


def test_a_speed_with_one_value_is_not_drawn_against_where_another_axis_has_several() -> None:
    one_speed = [{SPEED: 1, COUNT: count} for count in (3, 5)]
    assert choose_axis(one_speed) == COUNT
    assert choose_axis([{SPEED: 1, COUNT: 3}]) == SPEED
    assert choose_axis(ROWS) == SPEED


def test_panels_are_checked_under_the_name_that_requests_them() -> None:
    check_panels(ROWS, SPEED, COUNT)
    check_panels(ROWS, SPEED, None)
    with pytest.raises(EpuckSimError, match=r"^--panels: unknown 'robots\.0\.cuont', did you mean"):
        check_panels(ROWS, SPEED, "robots.0.cuont")
