"""Claims about figures from Python: they draw into the Axes they are given, and what does not fit one is refused."""

import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim import figures
from epuck_sim.errors import EpuckSimError
from tests.figures.drawn import legend_texts
from tests.runs.made_folders import COUNT, SPEED, SPEEDS, WIDTH, censored, in_memory, sweep, weibull

POINTS = in_memory(sweep({WIDTH: [40, 60], SPEED: SPEEDS}, trials=9), lambda point: weibull(point, 50))
ONE_WIDTH = [point for point in POINTS if point.axes[WIDTH] == 40]
AGENTS = sweep(
    {"agents.speed_cm_s": [3, 30]},
    trials=2,
    model="particles",
    agents={"count": 4},
    start={"phases": "synchronised", "displacement": 0.01},
    stop={"order_parameter": None, "max_cycles": 5},
)
DISPLACED = in_memory(AGENTS, lambda point: censored(point, 2))
UNDISTURBED = [
    point._replace(
        scenario=point.scenario.model_copy(
            update={"start": point.scenario.start.model_copy(update={"displacement": 0.0})}
        )
    )
    for point in DISPLACED
]

SERIES = [point._replace(of="mine", measured=([1, 2, 3],) * 9) for point in POINTS if point.axes[SPEED] in SPEEDS[:2]]

FORMS = {
    "curves": lambda ax: figures.curves(POINTS, ax=ax),
    "contour_map": lambda ax: figures.contour_map(POINTS, ax=ax),
    "violins": lambda ax: figures.violins(ONE_WIDTH, censored_at=60, ax=ax),
    "series": lambda ax: figures.series(SERIES, ax=ax),
    "order_parameters": lambda ax: figures.order_parameters(DISPLACED, ax=ax),
    "deviations": lambda ax: figures.deviations(DISPLACED, ax=ax),
    "perturbation": lambda ax: figures.perturbation(DISPLACED[1], ax=ax),
}


def test_these_are_the_public_functions_and_each_is_documented() -> None:
    assert sorted(FORMS) == sorted(figures.__all__)
    for name in FORMS:
        assert "Returns:\n        The Axes." in getattr(figures, name).__doc__


@pytest.mark.parametrize("form", FORMS)
def test_a_form_draws_into_the_axes_it_is_given_and_adds_neither_title_nor_legend(form: str) -> None:
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert FORMS[form](right) is right
    assert right.has_data()
    assert not left.has_data()
    assert (figure.get_suptitle(), figure.legends, right.get_legend()) == ("", [], None)
    assert right.get_xlabel()
    assert right.get_ylabel()
    figure.draw_without_rendering()


@pytest.mark.parametrize("form", FORMS)
def test_without_axes_a_form_makes_a_figure_with_title_and_legend(form: str) -> None:
    made = FORMS[form](None)
    assert isinstance(made, Axes)
    assert made.figure.get_size_inches()[0] * 2.54 == pytest.approx(8.5)
    assert "trial" in made.figure.get_suptitle()
    _, labels = made.get_legend_handles_labels()
    assert sorted(legend_texts(made.figure)) == sorted({*labels})


def test_every_mark_of_curves_has_a_label() -> None:
    _, labels = figures.curves(POINTS).get_legend_handles_labels()
    assert labels == ["L = 40 cm", "L = 60 cm", "95 % interval"]


def test_a_measure_is_drawn_under_its_name() -> None:
    measured = [point._replace(of="mine", measured=(*map(float, range(9)),)) for point in POINTS]
    assert figures.curves(measured).get_ylabel() == "mean\nof mine"
    assert figures.violins(measured[: len(SPEEDS)]).get_ylabel() == "mine"
    assert figures.contour_map(measured).figure.axes[-1].get_ylabel() == "mean\nof mine"


def test_axes_and_statistics_are_chosen_by_name() -> None:
    assert figures.curves(POINTS, WIDTH).get_xlabel() == "L [cm]"
    assert figures.curves(POINTS, statistic="median").get_ylabel().startswith("median")
    assert figures.contour_map(POINTS, WIDTH, SPEED).get_ylabel() == "V [cm/s]"


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda: figures.curves(POINTS, COUNT), f"x: unknown '{COUNT}'"),
        (lambda: figures.violins(POINTS), f"2 panels, but Axes hold one group of violins: .* one value of {WIDTH}$"),
        (lambda: figures.contour_map(POINTS, statistic="weibull-mean"), "not for --form map"),
        (lambda: figures.curves(DISPLACED), "trials have no T_sync"),
        (lambda: figures.series(POINTS), "T_sync is no series"),
        (lambda: figures.curves(SERIES), "mine is a series"),
        (lambda: figures.order_parameters(POINTS), "need model: particles"),
        (lambda: figures.contour_map([p._replace(observed=p.observed & False) for p in POINTS]), "would be blank"),
        (lambda: figures.deviations(UNDISTURBED), "nothing deviates"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(draw, message: str) -> None:
    with pytest.raises(EpuckSimError, match=message):
        draw()
