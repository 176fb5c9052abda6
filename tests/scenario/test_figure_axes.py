"""Claims about the axes of figures: what a scenario names for them is checked before its sweep runs."""

from typing import Any

import pytest

from epuck_sim.errors import EpuckSimError
from epuck_sim.scenario.axes import check_figure_axes, check_panels, choose_axis
from epuck_sim.scenario.scenario import FigureSection

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
