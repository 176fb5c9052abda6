"""Claims about violins: they hold the trials that synchronised, beside Appendix A's mean of trials censored early."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from epuck_sim.figures.forms.violins import LINE, VIOLIN, Violins, density, read_violins, sample_means, synchronised
from epuck_sim.figures.style import count_trials
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.survival import estimate_weibull_mean
from tests.figures.drawn import laid_out, legend_texts, written
from tests.runs.made_folders import COUNT, SPEED, SPEEDS, ended, in_memory, six_digits, sweep, weibull

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


POINTS = in_memory(sweep({COUNT: COUNTS, SPEED: SPEEDS}), law)
CURVES = read_violins(POINTS, SPEED, CENSORED_AT)
OPEN = read_violins(POINTS, SPEED)


def panels_of(curves, censored_at: int | None = CENSORED_AT) -> list[Axes]:
    """Return the panels of a figure, laid out."""
    return laid_out(Violins(axis=SPEED, curves=curves, censored_at=censored_at).draw_figure()).axes


def violins(panel: Axes) -> list[np.ndarray]:
    """Return the corners of each violin, (n, 2)."""
    found = [each for each in panel.collections if isinstance(each, PolyCollection)]
    return [each.get_paths()[0].vertices for each in found if to_hex(each.get_facecolor()[0]) == VIOLIN]


def lines(panel: Axes, label: str) -> list[Line2D]:
    return [line for line in panel.get_lines() if str(line.get_label()).startswith(label)]


# What is read


@pytest.mark.parametrize(("curves", "limit"), [(CURVES, CENSORED_AT), (OPEN, math.inf)])
def test_the_estimate_is_that_of_trials_clipped_at_the_censoring_if_there_is_one(curves, limit: float) -> None:
    points = iter(POINTS)
    for curve in curves:
        for found, point in zip(np.column_stack([curve.values, curve.intervals]), points, strict=False):
            clipped = np.minimum(point.times, limit), point.observed & (point.times <= limit)
            np.testing.assert_equal(found, estimate_weibull_mean(Measured(*clipped, limit, point.seed)).ends)
    assert all(np.isnan(curve.values[1]).all() for curve in CURVES)


# The density


@given(st.lists(st.integers(1, 10**7), min_size=1, max_size=30))
def test_a_violin_spans_its_trials_and_is_1_where_it_is_widest(times: list[int]) -> None:
    heights, widths = density(np.array(times, float), of_logarithms=True)
    assert heights[[0, -1]] == pytest.approx([min(times), max(times)])
    assert (np.diff(heights) >= 0).all()
    assert widths.max() == 1
    assert widths.min() >= 0


# What is drawn


def test_a_violin_is_as_wide_as_the_density() -> None:
    made = in_memory(sweep({SPEED: [0.1, 1]}), lambda point: weibull(point, 50))
    (curve,) = read_violins(made, SPEED)
    (panel,) = panels_of([curve], None)
    for corners, x, times in zip(violins(panel), curve.x, synchronised(curve), strict=True):
        widths = np.abs(np.log10(corners[:, 0] / x)) / 0.4  # a decade apart
        heights, expected = density(times, of_logarithms=True)
        np.testing.assert_allclose(widths, np.interp(np.log(corners[:, 1]), np.log(heights), expected), atol=1e-6)


def test_the_line_is_the_estimate_and_the_band_its_interval() -> None:
    for panel, curve in zip(panels_of(CURVES), CURVES, strict=True):
        (line,) = lines(panel, "Weibull mean (Appendix A)")
        np.testing.assert_array_equal(line.get_ydata(), curve.values)
        (band,) = [each for each in panel.collections if to_hex(each.get_facecolor()[0]) == LINE]
        corners = {(float(x), float(y)) for path in band.get_paths() for x, y in path.vertices}
        ends = np.isfinite(curve.intervals[:, 1])
        assert ends.sum() >= 3
        for x, (low, high) in zip(curve.x[ends], curve.intervals[ends], strict=True):
            assert {(x, low), (x, high)} <= corners


def test_an_undetermined_estimate_is_a_cross_within_the_panel_above_all_trials() -> None:
    for panel, curve in zip(panels_of(CURVES), CURVES, strict=True):
        (crosses,) = lines(panel, "undetermined")
        assert crosses.get_xdata().tolist() == curve.x[np.isnan(curve.values)].tolist()
        assert 0.5 in crosses.get_xdata()
        highest = max(times.max() for each in CURVES for times in synchronised(each))
        (_, above), *_ = panel.transAxes.inverted().transform(panel.transData.transform([(1, highest)]))
        assert (crosses.get_ydata() > above).all()  # as a share of the panel
        assert (crosses.get_ydata() < 1).all()


def test_dots_are_the_sample_means_where_nothing_is_censored() -> None:
    for panel, curve in zip(panels_of(CURVES), CURVES, strict=True):
        (dots,) = lines(panel, "mean of all trials")
        assert dots.get_linestyle() == "None"
        drawn = dict(zip(dots.get_xdata(), dots.get_ydata(), strict=True))
        for x, plain, censored in zip(curve.x, sample_means(curve), curve.censored, strict=True):
            assert np.isnan(drawn[x]) if censored else drawn[x] == plain


def test_a_dashed_line_marks_the_censoring_where_there_is_one() -> None:
    for panel in panels_of(CURVES):
        (line,) = lines(panel, r"$T_\mathrm{cens}$ of the Weibull mean: 60")
        assert (line.get_linestyle(), *line.get_ydata()) == ("--", CENSORED_AT, CENSORED_AT)
    assert all(lines(panel, r"$T_\mathrm{cens}") == [] for panel in panels_of(OPEN, None))


def test_the_caption_says_how_many_trials_are_censored_and_nothing_where_none_is() -> None:
    censored = sum(int((~point.observed).sum()) for point in POINTS)
    trials = sum(len(point.times) for point in POINTS)
    assert censored > 10
    numbers = count_trials([len(point.times) for point in POINTS])
    what = "Distribution of T_sync (cycles) against V (cm/s), with Weibull means and their 95 % intervals"
    shows = Violins(axis=SPEED, curves=CURVES).shows
    assert shows == f"{what}; {numbers}; {censored} of {trials} trials censored, not in the violins"
    assert Violins(axis=SPEED, curves=CURVES[1:]).shows == f"{what}; {numbers}"


def test_the_legend_names_each_mark_once() -> None:
    assert legend_texts(Violins(axis=SPEED, curves=CURVES, censored_at=CENSORED_AT).draw_figure()) == [
        "trials that synchronised",
        "Weibull mean (Appendix A)",
        "its 95 % interval",
        "undetermined: too many censored",
        "mean of all trials",
        r"$T_\mathrm{cens}$ of the Weibull mean: 60",
    ]


def test_panels_are_in_order_and_share_their_scales() -> None:
    panels = panels_of(CURVES)
    assert [panel.get_title() for panel in panels] == [f"N = {count}" for count in COUNTS]
    assert len({(panel.get_xlim(), panel.get_ylim()) for panel in panels}) == 1
    assert (panels[0].get_xscale(), panels[0].get_yscale()) == ("log", "log")
    assert (panels[0].get_xlabel(), panels[0].get_ylabel()) == ("V (cm/s)", r"$T_\mathrm{sync}$ (cycles)")


# The table


def test_the_csv_has_the_numbers_of_the_violins(tmp_path) -> None:
    table = written(tmp_path, Violins(axis=SPEED, curves=CURVES).tables[".csv"])
    assert list(table[0]) == [COUNT, SPEED, "trials", "censored", "mean", "weibull_mean", "weibull_low", "weibull_high"]
    expected = []
    for point in POINTS:
        share = 1 - point.observed.mean()
        plain = math.nan if share else point.times.mean()
        clipped = np.minimum(point.times, CENSORED_AT), point.observed & (point.times <= CENSORED_AT)
        numbers = [
            len(point.times),
            share,
            plain,
            *estimate_weibull_mean(Measured(*clipped, CENSORED_AT, point.seed)).ends,
        ]
        expected.append([str(point.axes[COUNT]), *map(six_digits, [point.axes[SPEED], *numbers])])
    assert [[*row.values()] for row in table] == expected
    assert [*table[0].values()] == ["7", "0.2", "5", "0", "30", "30", "", ""]
    assert [*table[1].values()] == ["7", "0.5", "1", "0", "800", "", "", ""]
