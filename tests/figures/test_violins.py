"""Claims about violins: they hold the trials that synchronised, beside Appendix A's mean of trials censored early."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from epuck_sim.figures.forms.violins import LINE, VIOLIN, Violins, density, read_violins
from epuck_sim.figures.style import count_trials
from epuck_sim.figures.sweep_figure import read_form
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.survival import estimate_weibull_mean
from tests.figures.drawn import in_csv, laid_out, legend_texts, written
from tests.runs.made_folders import COUNT, SPEED, SPEEDS, ended, in_memory, sweep, weibull

COUNTS = [7, 3, 5]
CENSORED_AT = 60


def law(point):
    """Return trials around 100 cycles; of seven robots some are censored, and at two speeds all take one time."""
    speed, count = point.axes[SPEED], point.axes.get(COUNT, 5)
    if speed == 0.2:
        return ended([30] * 5)
    if speed == 0.5:
        return ended([800])
    drawn = weibull(point, 100)
    return ended(drawn.times, drawn.times < 200) if count == 7 else drawn


POINTS = in_memory(sweep({COUNT: COUNTS, SPEED: SPEEDS}, trials=40), law)
FORM = Violins(axis=SPEED, curves=read_violins(POINTS, SPEED, CENSORED_AT), censored_at=CENSORED_AT)
OPEN = Violins(axis=SPEED, curves=read_violins(POINTS, SPEED))


@pytest.fixture(scope="module")
def panels() -> list[Axes]:
    """Return the panels, laid out, which no test changes."""
    return laid_out(FORM.draw_figure()).axes


def violins(panel: Axes) -> list[np.ndarray]:
    """Return the corners of each violin, (n, 2)."""
    found = [each for each in panel.collections if to_hex(each.get_facecolor()[0]) == VIOLIN]
    return [each.get_paths()[0].vertices for each in found]


def lines(panel: Axes, label: str) -> list[Line2D]:
    return [line for line in panel.get_lines() if str(line.get_label()).startswith(label)]


@pytest.mark.parametrize(("form", "limit"), [(FORM, CENSORED_AT), (OPEN, math.inf)])
def test_the_estimate_is_that_of_trials_clipped_at_the_censoring_if_there_is_one(form, limit: float) -> None:
    assert [curve.axes for curve in form.curves] == [{COUNT: count} for count in COUNTS]
    points = iter(POINTS)
    for curve in form.curves:
        for found, point in zip(np.column_stack([curve.values, curve.intervals]), points, strict=False):
            clipped = np.minimum(point.times, limit), point.observed & (point.times <= limit)
            np.testing.assert_equal(found, estimate_weibull_mean(Measured(*clipped, limit, point.seed)).ends)


@given(st.lists(st.integers(1, 10**7), min_size=1, max_size=30))
def test_a_density_spans_its_trials_and_is_1_where_it_is_widest(times: list[int]) -> None:
    heights, widths = density(np.array(times, float), of_logarithms=True)
    assert heights[[0, -1]] == pytest.approx([min(times), max(times)])
    assert (np.diff(heights) >= 0).all()
    assert widths.max() == 1
    assert widths.min() >= 0


def test_a_violin_is_as_wide_as_the_density_of_the_logarithms_of_the_trials_that_synchronised(panels) -> None:
    points = iter(POINTS)
    for panel, curve in zip(panels, FORM.curves, strict=True):
        assert (panel.get_xscale(), panel.get_yscale()) == ("log", "log")
        for corners, x, point in zip(violins(panel), curve.x, points, strict=False):
            widths = np.abs(np.log10(corners[:, 0] / x)) / (0.4 * np.log10(2))  # the nearest two are that far apart
            heights, expected = density(point.times[point.observed], of_logarithms=True)
            shown = np.interp(np.log(corners[:, 1]), np.log(heights), expected)
            np.testing.assert_allclose(widths, shown, atol=1e-6)
    assert next(points, None) is None
    """Of a lognormal distribution it is a bell around the median, and not around the mean."""
    drawn = np.exp(5 + np.random.default_rng(1).standard_normal(20_000))
    heights, widths = density(drawn, of_logarithms=True)
    expected = np.exp(-((np.log(heights) - 5) ** 2) / 2 / (1 + 20_000**-0.4))
    np.testing.assert_allclose(widths, expected, atol=0.05)


def test_lines_bands_crosses_and_dots_are_the_estimates_and_the_means_of_all_trials(panels) -> None:
    highest = max(point.times[point.observed].max() for point in POINTS)
    for panel, curve in zip(panels, FORM.curves, strict=True):
        (line,) = lines(panel, "Weibull mean (Appendix A)")
        np.testing.assert_array_equal(line.get_ydata(), curve.values)
        (band,) = [each for each in panel.collections if to_hex(each.get_facecolor()[0]) == LINE]
        corners = {(float(x), float(y)) for path in band.get_paths() for x, y in path.vertices}
        ends = np.isfinite(curve.intervals[:, 1])
        assert ends.sum() >= 3
        for x, (low, high) in zip(curve.x[ends], curve.intervals[ends], strict=True):
            assert {(x, low), (x, high)} <= corners
        (crosses,) = lines(panel, "undetermined")
        assert crosses.get_xdata().tolist() == curve.x[np.isnan(curve.values)].tolist()
        assert 0.5 in crosses.get_xdata()
        (_, above) = panel.transAxes.inverted().transform(panel.transData.transform((1, highest)))
        assert above < crosses.get_ydata()[0] < 1  # as a share of the panel
        (dots,) = lines(panel, "mean of all trials")
        trials = zip(curve.censored, curve.measured, strict=True)
        expected = [np.nan if censored else each.values.mean() for censored, each in trials]
        np.testing.assert_array_equal(dots.get_ydata(), expected)
        (limit,) = lines(panel, r"$T_\mathrm{cens}$ of the Weibull mean: 60")
        assert (limit.get_linestyle(), *limit.get_ydata()) == ("--", CENSORED_AT, CENSORED_AT)


def test_titles_labels_the_legend_and_the_caption_name_what_there_is(panels) -> None:
    assert [panel.get_title() for panel in panels] == [f"N = {count}" for count in COUNTS]
    assert len({(panel.get_xlim(), panel.get_ylim()) for panel in panels}) == 1
    assert (panels[0].get_xlabel(), panels[0].get_ylabel()) == ("V (cm/s)", r"$T_\mathrm{sync}$ (cycles)")
    expected = [
        "trials that synchronised",
        "Weibull mean (Appendix A)",
        "its 95 % interval",
        "undetermined: too many censored",
        "mean of all trials",
        r"$T_\mathrm{cens}$ of the Weibull mean: 60",
    ]
    assert legend_texts(panels[0].figure) == expected
    assert not {*expected[3:4], *expected[5:]} & {*legend_texts(OPEN.draw_figure())}
    censored = sum(int((~point.observed).sum()) for point in POINTS)
    trials = sum(len(point.times) for point in POINTS)
    numbers = count_trials([len(point.times) for point in POINTS])
    what = "Distribution of T_sync (cycles) against V (cm/s), with Weibull means and their 95 % intervals"
    assert FORM.shows == f"{what}; {numbers}; {censored} of {trials} trials censored, not in the violins"
    assert Violins(axis=SPEED, curves=FORM.curves[1:]).shows == f"{what}; {numbers}"


def test_the_csv_has_the_numbers_of_the_violins() -> None:
    table = written(FORM.tables[".csv"])
    assert list(table[0]) == [COUNT, SPEED, "trials", "censored", "mean", "weibull_mean", "weibull_low", "weibull_high"]
    expected, estimates = [], np.concatenate([np.column_stack([c.values, c.intervals]) for c in FORM.curves])
    for point, ends in zip(POINTS, estimates, strict=True):
        share = 1 - point.observed.mean()
        mean = math.nan if share else point.times.mean()
        expected.append(in_csv(point.axes[COUNT], point.axes[SPEED], len(point.times), share, mean, *ends))
    assert [[*row.values()] for row in table] == expected


def test_a_sweep_over_files_has_violins_by_their_names() -> None:
    key, files = "robots.0.controller", ["/me/once.py", "firefly"]
    made = in_memory(sweep({SPEED: [1, 2]}), lambda point: weibull(point, 100 + point.number))
    for others, options in (({}, {}), ({COUNT: 5}, {"form": "violins", "x": key})):
        points = [point._replace(axes={key: file, **others}) for point, file in zip(made, files, strict=True)]
        form = read_form(points, options)
        assert isinstance(form, Violins)
        (panel,) = laid_out(form.draw_figure()).axes
        assert [label.get_text() for label in panel.get_xticklabels()] == ["once", "firefly"]
        assert [row[key] for row in written(form.tables[".csv"])] == ["once", "firefly"]
