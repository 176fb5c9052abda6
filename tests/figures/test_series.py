"""Figures of measures: series over the cycles, and what curves, maps and violins say of a measure."""

import numpy as np
import pytest

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.forms.curves import Curves
from epuck_sim.figures.forms.maps import Maps, read_maps
from epuck_sim.figures.forms.series import MAX_LINES, Series
from epuck_sim.figures.forms.violins import Violins, read_violins
from epuck_sim.figures.style import has_log_scale
from epuck_sim.statistics.curves import read_curves
from epuck_sim.statistics.series import PointSeries, series_statistics
from tests.figures.drawn import legend_texts, written
from tests.runs.made_folders import COUNT, SPEED, ended, in_memory, sweep

LONG = PointSeries({SPEED: 1}, series_statistics([np.array([1.0, 2, 3, 5]) + k / 10 for k in range(6)]))
SHORT = PointSeries({SPEED: 2}, series_statistics([np.arange(3.0)] * 3 + [np.arange(2.0)] * 3))


def test_a_line_is_the_mean_and_dashed_once_a_trial_has_ended():
    figure = Series(of="mine", points=[LONG, SHORT]).draw_figure()
    (panel,) = figure.axes
    full, short, ended_before, _ = panel.get_lines()
    assert full.get_ydata().tolist() == pytest.approx([1.25, 2.25, 3.25, 5.25])
    assert full.get_xdata().tolist() == [1, 2, 3, 4]
    assert (short.get_linestyle(), short.get_xdata().tolist()) == ("-", [1, 2])
    assert (ended_before.get_linestyle(), ended_before.get_xdata().tolist()) == ("--", [2, 3])
    assert legend_texts(figure) == ["V = 1 cm/s", "V = 2 cm/s", "95 % interval", "some trials have ended"]
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("cycle", "mine")
    assert Series(of="mine", points=[LONG, SHORT]).shows.endswith("; 6 trials a point")


def test_lines_that_no_one_could_tell_apart_are_refused():
    with pytest.raises(EpuckSimError, match=f"{MAX_LINES + 1} lines, one for each point; allowed: up to {MAX_LINES}"):
        Series(of="mine", points=[LONG] * (MAX_LINES + 1)).draw_figure()


def test_the_table_has_a_row_for_each_cycle():
    rows = written(Series(of="mine", points=[LONG, SHORT]).tables[".csv"])
    assert len(rows) == 7
    names = "cycle trials known mean low high median median_low median_high"
    assert [*rows[-1]] == [SPEED, *names.split()]
    assert [*rows[-1].values()] == ["2", "3", "3", "3", "2", "", "", "2", "", ""]


def measured(law, trials=5):
    """Return points with the values of a measure, in memory."""
    scenario = sweep({SPEED: [1, 2, 10], COUNT: [2, 4]}, trials=trials)
    random = np.random.default_rng(1)
    found = in_memory(scenario, lambda _: ended([7] * trials))
    return [point._replace(of="mine", measured=tuple(law(point, random) for _ in range(trials))) for point in found]


WIDE = measured(lambda point, random: point.axes[SPEED] ** 2 * random.uniform(1, 2))
NARROW = measured(lambda _, random: random.uniform(1, 2))
SIGNED = measured(lambda _, random: random.normal())


@pytest.mark.parametrize(("points", "scale"), [(WIDE, "log"), (NARROW, "linear"), (SIGNED, "linear")])
def test_a_measure_has_its_name_and_the_scale_that_fits_it(points, scale):
    curves = read_curves(points, SPEED)
    curve_panel = Curves(axis=SPEED, curves=curves, of=curves[0].of).draw_figure().axes[0]
    violin_panel = Violins(axis=SPEED, curves=read_violins(points, SPEED), of="mine").draw_figure().axes[0]
    assert curve_panel.get_ylabel() == "mine"
    assert violin_panel.get_ylabel() == "mine"
    assert (curve_panel.get_yscale(), violin_panel.get_yscale()) == (scale, scale)
    assert curve_panel.get_ylim()[1] > max(curve.intervals[:, 1].max() for curve in curves)
    assert curves[0].values.tolist() in [line.get_ydata().tolist() for line in curve_panel.get_lines()]
    assert list(Curves(axis=SPEED, curves=curves, of=curves[0].of).tables) == [".csv"]
    maps = read_maps(points, SPEED, COUNT)
    assert has_log_scale("mine", maps[0].values.ravel()) == (scale == "log")
    *_, bar = Maps(x=SPEED, y=COUNT, maps=maps, of="mine").draw_figure().axes
    assert bar.get_ylabel() == "mine"


@pytest.mark.parametrize("law", [lambda _, random: random.normal(), lambda point, _: 10.0 ** point.axes[COUNT]])
def test_points_without_a_value_are_crosses_above_all_others_and_hatched_in_maps(law):
    gaps = [
        point._replace(measured=(None,) * 5) if point.axes == {SPEED: 2, COUNT: 4} else point for point in measured(law)
    ]
    curves = read_curves(gaps, SPEED)
    figure = Curves(axis=SPEED, curves=curves, of=curves[0].of).draw_figure()
    assert "undetermined: no trial has a value" in legend_texts(figure)
    (panel,) = figure.axes
    (cross,) = [line for line in panel.get_lines() if line.get_marker() == "x" and len(line.get_xdata())]
    highest = max(np.nanmax(curve.values) for curve in curves)
    (_, at), *_ = panel.transAxes.inverted().transform(panel.transData.transform([(1, highest)]))
    assert cross.get_xdata().tolist() == [2]
    assert at < cross.get_ydata()[0] < 1
    assert "no trial has a value" in legend_texts(
        Maps(x=SPEED, y=COUNT, maps=read_maps(gaps, SPEED, COUNT), of="mine").draw_figure()
    )
    violins = Violins(axis=SPEED, curves=read_violins(gaps, SPEED), of="mine").draw_figure()
    assert "undetermined: no trial has a value" in legend_texts(violins)
