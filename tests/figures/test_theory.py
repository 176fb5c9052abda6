"""What figures of T_sync against speed show of predictions: what `predict` says of the scenario of each curve."""

from functools import cache

import numpy as np
import pytest

from epuck_sim import load_scenario, read_points
from epuck_sim.figures.forms.theory import EDGE, PredictedCurves, predict_curves
from epuck_sim.figures.sweep_figure import read_form
from epuck_sim.theory.predict import predict
from tests.figures.drawn import laid_out, legend_texts, written
from tests.runs.made_folders import store, weibull

SETTINGS = ("agents.count=10", "trials=5", "stop.max_cycles=5000", "measures=[order_parameter]")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    asked = load_scenario("particles", SETTINGS, ["agents.speed_cm_s=0.1,1,30", "neighbourhood.k=1,5"])
    return store(tmp_path_factory.mktemp("agents") / "run", asked, lambda point: weibull(point, 60))


@cache
def of_nearest(k: int, speed: float):
    return predict(load_scenario("particles", [*SETTINGS, f"neighbourhood.k={k}", f"agents.speed_cm_s={speed}"]))


@pytest.fixture(scope="module")
def form(folder) -> PredictedCurves:
    return read_form(folder, {"theory": True})


def test_lines_and_limits_are_those_of_predict(form) -> None:
    figure = laid_out(form.draw_figure())
    (panel,) = figure.axes
    for k, predicted in zip((1, 5), form.predicted, strict=True):
        drawn = [line for line in panel.lines if np.array_equal(line.get_ydata(), predicted.times, equal_nan=True)]
        assert [line.get_linestyle() for line in drawn] == ["--"]
        assert predicted.times[[0, -1]] == pytest.approx(
            [of_nearest(k, v).t_sync.value for v in (0.1, 30)], nan_ok=True
        )
        limits = [of_nearest(k, 30).t_sync_frozen.value, of_nearest(k, 30).t_sync_fast.value]
        at_edges = [line.get_ydata()[0] for line in panel.lines if list(line.get_xdata())[-1:] in ([EDGE], [1])]
        assert np.isin(limits, at_edges).tolist() == [k == 5, True]  # none of K = 1 that stands can
    assert legend_texts(figure)[-2:] == ["predicted", "predicted $V_\\mathrm{m}$ and $V_\\mathrm{p}$"]


def test_minimum_and_peak_are_marked_where_a_regime_is_predicted_alone(form) -> None:
    (panel,) = form.draw_figure().axes
    drawn = [line for line in panel.lines if line.get_markersize() == 5 and len(line.get_xdata()) == 3]
    marks = {line.get_marker(): line.get_xdata()[1] for line in drawn}
    nearest = of_nearest(1, 30)
    assert marks == pytest.approx({"v": nearest.v_m_cm_s.value, "^": nearest.v_p_cm_s.value})
    one, five = written(form.tables["-theory.csv"])
    assert [one["regime"], five["regime"], five["v_p"]] == ["yes", "no", ""]
    assert float(one["v_p_high"]) == pytest.approx(nearest.v_p_cm_s.high, rel=1e-5)
    assert "who hears whom" in form.caption
    assert "hollow triangles" in form.caption
    (still,) = predict_curves("agents.speed_cm_s", [form.curves[0]._replace(x=np.array([0.0]))])
    assert still.places == []


def test_a_scenario_asks_for_them_and_an_option_decides(folder) -> None:
    points = read_points(folder)
    asks = load_scenario("particles", [*SETTINGS, "figure.theory=true"])
    points = [point._replace(scenario=asks.model_copy(update={"agents": point.scenario.agents})) for point in points]
    assert isinstance(read_form(points, {}), PredictedCurves)
    assert not isinstance(read_form(points, {"theory": False}), PredictedCurves)
    assert not isinstance(read_form(folder, {}), PredictedCurves)


def test_a_scenario_that_asks_where_nothing_can_be_predicted_is_told_why(folder) -> None:
    still = load_scenario("particles", [*SETTINGS, "figure.theory=true", "response.coupling=0"])
    points = [point._replace(scenario=still) for point in read_points(folder)]
    assert "response.coupling is 0" in read_form(points, {}).caption
    assert "but this is against neighbourhood.k" in read_form(points, {"x": "neighbourhood.k"}).caption
