"""Claims about the axes of figures: what a scenario names for them is checked before its sweep runs."""

from typing import Any

import pytest

from epuck_sim.errors import EpuckSimError, ScenarioError
from epuck_sim.scenario.axes import check_figure_axes, check_panels, choose_axis
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from epuck_sim.scenario.scenario import FigureSection
from epuck_sim.sweep.checks import check_sweep
from tests.cli.commands import refused

SPEED, COUNT, NOISE = "robots.0.parameters.speed_cm_s", "robots.0.count", "noise"
WIDTH, HEIGHT = "arena.width_cm", "arena.height_cm"
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


@pytest.mark.parametrize(
    ("figure", "message"),
    [
        ({"x": "speed"}, f"figure.x: unknown 'speed'; axes with numbers: {SPEED}, {COUNT}, {WIDTH}, {HEIGHT}"),
        ({"x": NOISE}, "figure.x: unknown 'noise'"),
        ({"y": "robots.0.cuont"}, f"figure.y: unknown 'robots.0.cuont', did you mean '{COUNT}'?"),
        ({"x": COUNT, "y": WIDTH}, f"figure.y: {WIDTH} varies together with {COUNT}, the horizontal axis"),
        ({"panels": "nosie"}, "figure.panels: unknown 'nosie', did you mean 'noise'?; other axes: "),
        ({"panels": SPEED}, f"figure.panels: unknown '{SPEED}'"),
        ({"base_case": {"robots.0.cuont": 3}}, f"figure.base_case: unknown 'robots.0.cuont', did you mean '{COUNT}'?"),
        ({"base_case": {SPEED: 1}}, f"figure.base_case: unknown '{SPEED}'"),
        ({"x": COUNT, "panels": WIDTH}, f"figure.panels: unknown '{WIDTH}'"),
    ],
)
def test_what_names_no_axis_is_refused(figure: dict[str, Any], message: str) -> None:
    with pytest.raises(EpuckSimError) as caught:
        check_figure_axes(FigureSection(**figure), ROWS)
    assert str(caught.value).startswith(message)


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


def test_a_scenario_without_a_sweep_has_no_axis_to_name() -> None:
    with pytest.raises(ScenarioError, match=r"thesis: figure\.x: unknown 'noise'; axes with numbers: none"):
        check_sweep(points(load_scenario("thesis", ["figure.x=noise"])))


@pytest.mark.parametrize("key", ["x", "y", "panels"])
def test_check_and_run_refuse_it_before_anything_runs(tmp_path, key: str) -> None:
    words = ("pair", "--sweep", f"{SPEED}=1,2", "--set", f"figure.{key}=speed")
    assert f"pair: figure.{key}: unknown 'speed'" in refused("check", *words)
    assert f"pair: figure.{key}: unknown 'speed'" in refused("run", *words, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()
