"""Figures of measures: series over the cycles, and what curves, maps and violins say of a measure."""

import numpy as np
import pytest

from epuck_sim.figures.curves import curves_tables, draw_curves, find_extrema
from epuck_sim.figures.maps import choose_linear_levels, draw_maps, has_log_colours, read_maps
from epuck_sim.figures.series import draw_series, series_table
from epuck_sim.figures.violins import draw_violins, linear_density, read_violins
from epuck_sim.statistics.curves import read_curves
from epuck_sim.statistics.series import PointSeries, series_statistics
from tests.runs.made_folders import COUNT, SPEED, ended, in_memory, sweep

LONG = PointSeries({SPEED: 1}, series_statistics([np.array([1.0, 2, 3, 5]) + k / 10 for k in range(6)]))
SHORT = PointSeries({SPEED: 2}, series_statistics([np.arange(3.0)] * 3 + [np.arange(2.0)] * 3))


def test_a_line_is_the_mean_and_dashed_once_a_trial_has_ended():
    (panel,) = draw_series("demo", "mine", [LONG, SHORT]).axes
    full, short, ended_before, _ = panel.get_lines()
    assert full.get_ydata().tolist() == pytest.approx([1.25, 2.25, 3.25, 5.25])
    assert full.get_xdata().tolist() == [1, 2, 3, 4]
    assert (short.get_linestyle(), short.get_xdata().tolist()) == ("-", [1, 2])
    assert (ended_before.get_linestyle(), ended_before.get_xdata().tolist()) == ("--", [2, 3])
    texts = [text.get_text() for text in panel.get_legend().get_texts()]
    assert texts == ["V = 1 cm/s", "V = 2 cm/s", "some trials have ended"]
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("cycle", "mine, mean")


def test_one_line_without_an_end_has_no_legend():
    assert draw_series("demo", "mine", [LONG]).axes[0].get_legend() is None


def test_the_table_has_a_row_for_each_cycle():
    columns, rows = series_table([LONG, SHORT])
    rows = list(rows)
    assert len(rows) == 7
    assert dict(zip(columns, rows[-1], strict=True)) | {"median": ""} == {
        SPEED: 2,
        "cycle": "3",
        "trials": "3",
        "known": "3",
        "mean": "2",
        "low": "",
        "high": "",
        "median": "",
        "median_low": "",
        "median_high": "",
    }


def measured(law, trials=8):
    """Return points with the values of a measure, in memory."""
    scenario = sweep({SPEED: [1, 2, 5, 10], COUNT: [2, 4, 6]}, trials=trials)
    random = np.random.default_rng(1)
    found = in_memory(scenario, lambda _: ended([7] * trials))
    return [point._replace(of="mine", measured=tuple(law(point, random) for _ in range(trials))) for point in found]


WIDE = measured(lambda point, random: point.axes[SPEED] ** 2 * random.uniform(1, 2))
NARROW = measured(lambda _, random: random.uniform(1, 2))
SIGNED = measured(lambda _, random: random.normal())


@pytest.mark.parametrize(("points", "scale"), [(WIDE, "log"), (NARROW, "linear"), (SIGNED, "linear")])
def test_a_measure_has_its_name_and_the_scale_that_fits_it(points, scale):
    curves = read_curves(points, SPEED)
    searches = find_extrema(SPEED, curves)
    curve_panel = draw_curves("demo", SPEED, curves, searches).axes[0]
    violin_panel = draw_violins("demo", SPEED, read_violins(points, SPEED)).axes[0]
    assert curve_panel.get_ylabel() == "mine, mean"
    assert violin_panel.get_ylabel() == "mine"
    assert (curve_panel.get_yscale(), violin_panel.get_yscale()) == (scale, scale)
    assert curve_panel.get_lines()[0].get_ydata().tolist() == curves[0].values.tolist()
    assert list(curves_tables(SPEED, curves, searches)) == [".csv"]
    maps = read_maps(points, SPEED, COUNT)
    assert has_log_colours("mine", maps[0].values.ravel()) == (scale == "log")
    *_, bar = draw_maps("demo", SPEED, COUNT, maps).axes
    assert "mine" in bar.get_ylabel()


@pytest.mark.parametrize("values", [[0.1, 0.32], [-5, 5], [3.0], [1e-9, 1.1e-9], [0, 1e6], [7, 7.0000001], [0.0]])
def test_linear_levels_hold_all_values(values):
    levels = choose_linear_levels(np.array([*values, np.nan], float))
    assert levels[0] <= min(values) + 1e-8 * abs(min(values))
    assert max(values) < levels[-1]
    assert 2 <= len(levels) <= 22
    assert np.diff(levels) == pytest.approx(levels[1] - levels[0])


def test_densities_of_values_of_any_sign():
    heights, found = linear_density(np.array([-1.0, 0.0, 1.0]))
    assert (heights[0], heights[-1], found.max()) == (-1, 1, 1)
    assert found == pytest.approx(found[::-1])
