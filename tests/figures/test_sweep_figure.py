"""Claims about figures from Python: they draw into the Axes they are given, and what does not fit one is refused."""

import pytest
from matplotlib.figure import Figure

from epuck_sim import figures
from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.reader import read_points
from tests.figures.drawn import legend_texts
from tests.runs.made_folders import COUNT, SPEED, SPEEDS, WIDTH, censored, in_memory, store, sweep, weibull

POINTS = in_memory(sweep({WIDTH: [40, 60], SPEED: SPEEDS}, trials=9), lambda point: weibull(point, 50))
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
    "curves": (POINTS, 1),
    "map": (POINTS, 1),
    "violins": (POINTS, 2),
    "series": (SERIES, 1),
    "course": (DISPLACED, 2),
    "perturbation": (DISPLACED, 2),
}
"""Points that each form is drawn of, and the number of its panels."""


@pytest.mark.parametrize("form", FORMS)
def test_a_form_draws_into_the_axes_it_is_given_and_adds_neither_title_nor_legend(form: str) -> None:
    points, count = FORMS[form]
    figure = Figure()
    left, *right = figure.subplots(1, 1 + count)
    assert figures.plot(points, form=form, ax=right[0] if count == 1 else right) is figure
    assert not left.has_data()
    assert (figure.get_suptitle(), figure.legends) == ("", [])
    for panel in right:
        assert panel.has_data()
        assert panel.get_legend() is None
        assert panel.get_xlabel()
        assert panel.get_ylabel()
    figure.draw_without_rendering()


@pytest.mark.parametrize("form", FORMS)
def test_without_axes_a_form_makes_a_figure_with_title_and_legend(form: str) -> None:
    points, count = FORMS[form]
    made = figures.plot(points, form=form)
    width_cm = 8.5 if count == 1 or form == "course" else 17.5
    assert made.get_size_inches()[0] * 2.54 == pytest.approx(width_cm)
    assert "trial" in made.get_suptitle()
    labels = {label for panel in made.axes for label in panel.get_legend_handles_labels()[1]}
    assert {*legend_texts(made)} == labels


def test_every_mark_of_curves_has_a_label() -> None:
    _, labels = figures.plot(POINTS).axes[0].get_legend_handles_labels()
    assert labels == ["L = 40 cm", "L = 60 cm", "95 % interval"]


def test_a_measure_is_drawn_under_its_name() -> None:
    measured = [point._replace(of="mine", measured=(*map(float, range(9)),)) for point in POINTS]
    assert figures.plot(measured).axes[0].get_ylabel() == "mean\nof mine"
    assert figures.plot(measured, form="violins").axes[0].get_ylabel() == "mine"
    assert figures.plot(measured, form="map").axes[-1].get_ylabel() == "mean\nof mine"


def test_axes_and_statistics_are_chosen_by_name() -> None:
    assert figures.plot(POINTS, x=WIDTH).axes[0].get_xlabel() == "L [cm]"
    assert figures.plot(POINTS, statistic="median").axes[0].get_ylabel().startswith("median")
    assert figures.plot(POINTS, form="map", x=WIDTH, y=SPEED).axes[0].get_ylabel() == "V [cm/s]"


def test_a_folder_is_drawn_as_its_points_are(tmp_path) -> None:
    folder = store(tmp_path / "run", sweep({SPEED: SPEEDS}, trials=9), lambda point: weibull(point, 50))
    drawn, expected = (figures.plot(each).axes[0].get_lines() for each in (folder, read_points(folder)))
    assert [line.get_xydata().tolist() for line in drawn] == [line.get_xydata().tolist() for line in expected]


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda: figures.plot(POINTS, x=COUNT), f"x: unknown '{COUNT}'"),
        (lambda: figures.plot(POINTS, form="violins", ax=Figure().subplots()), "has 2 panels, but ax is 1 Axes"),
        (lambda: figures.plot(POINTS, form="pie"), "figure.form: is 'pie'; allowed: 'curves', 'map'"),
        (lambda: figures.plot(POINTS, y=WIDTH), "--y is for --form map, but this is curves"),
        (lambda: figures.plot(POINTS, form="map", statistic="weibull-mean"), "not for --form map"),
        (lambda: figures.plot(DISPLACED), "trials have no T_sync"),
        (lambda: figures.plot(POINTS, form="series"), "is for measures"),
        (lambda: figures.plot(SERIES, form="curves"), "mine is a series"),
        (lambda: figures.plot(POINTS, form="course"), "need model: particles"),
        (lambda: figures.plot([p._replace(observed=p.observed & False) for p in POINTS], form="map"), "would be blank"),
        (lambda: figures.plot(UNDISTURBED, form="perturbation"), "nothing deviates"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(draw, message: str) -> None:
    with pytest.raises(EpuckSimError, match=message):
        draw()
