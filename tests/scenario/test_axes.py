"""Axes of a sweep: which values meet, in which order, how the command line adds them, and what is refused."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.axes import MAX_POINTS, FigureSection, SweepAxes, check_figure_axes
from epuck_sim.scenario.loader import load_scenario

COUNT, WIDTH, SPEED = "robots.0.count", "arena.width_cm", "robots.0.parameters.speed_cm_s"


def rows(**given):
    return SweepAxes.model_validate(given).rows()


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


@settings(max_examples=40)
@given(sweeps())
def test_rows_are_those_found_by_splitting_one_axis_after_the_other(given: dict) -> None:
    found, expected = rows(**given), rows_one_by_one(given)
    assert found == expected
    assert {tuple(row) for row in found} == {tuple(SweepAxes.model_validate(given).keys)}


def test_too_many_points_are_refused_and_as_many_as_allowed_are_not() -> None:
    given = {"points": [{"p": 0}, {"p": 1}], "zip": {"z": [*range(50)]}, "grid": {"g": [*range(1000)]}}
    assert len(SweepAxes.model_validate(given).rows()) == MAX_POINTS == 100_000
    given["grid"]["g"].append(1000)
    with pytest.raises(ScenarioError, match=r"^scenario: sweep: the number of points is 100100; allowed: 1 to 100000$"):
        load_scenario({"sweep": given})
    with pytest.raises(ScenarioError, match="the number of points is 1e\\+30"):  # at once, however many
        load_scenario({"sweep": {"grid": {f"x{number}": [*range(10)] for number in range(30)}}})


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
    given = grid_of(path, f"{SPEED}=1,2", f"{COUNT}=9", f"{COUNT}=7")
    assert given == [(COUNT, (7,)), (WIDTH, (50,)), (SPEED, (1, 2))]
    assert load_scenario(path, axes=[f"{SPEED}=1"]).sweep.zip == {"arena.height_cm": (50, 60)}
    assert grid_of(load_scenario(path), f"{SPEED}=1,2", f"{COUNT}=7") == given


def test_sweep_on_the_command_line_takes_words_nothing_lists_and_mappings() -> None:
    ring = "{shape: circle, x_cm: 30, y_cm: 30, radius_cm: 3}"
    assert grid_of({}, "noise=on,off", "stop.max_time_s=null,5", f"arena.obstacles=[],[{ring}]") == [
        ("noise", ("on", "off")),
        ("stop.max_time_s", (None, 5)),
        ("arena.obstacles", ([], [{"shape": "circle", "x_cm": 30, "y_cm": 30, "radius_cm": 3}])),
    ]


NOISE, HEIGHT = "noise", "arena.height_cm"
ROWS = [
    {SPEED: speed, COUNT: count, NOISE: noise, WIDTH: 10 * count, HEIGHT: 60}
    for speed in (1, 2)
    for count in (3, 5)
    for noise in ("on", "off")
]


def test_a_figure_may_name_any_axis() -> None:
    for figure in ({}, {"x": SPEED, "y": COUNT}, {"y": HEIGHT}, {"panels": NOISE}, {"base_case": {COUNT: 3}}):
        check_figure_axes(FigureSection(**figure), ROWS)
