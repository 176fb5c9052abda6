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

from epuck_sim.figures.forms.violins import LINE, VIOLIN, Violins, density, read_groups
from epuck_sim.figures.style import count_trials
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.survival import MIN_UNCENSORED, estimate_weibull_mean, weibull_mean
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
GROUPS = read_groups(POINTS, SPEED, CENSORED_AT)
OPEN = read_groups(POINTS, SPEED)


def panels_of(groups, censored_at: int | None = CENSORED_AT) -> list[Axes]:
    """Return the panels of a figure, laid out."""
    return laid_out(Violins(axis=SPEED, groups=groups, censored_at=censored_at).draw_figure()).axes


def violins(panel: Axes) -> list[np.ndarray]:
    """Return the corners of each violin, (n, 2)."""
    found = [each for each in panel.collections if isinstance(each, PolyCollection)]
    return [each.get_paths()[0].vertices for each in found if to_hex(each.get_facecolor()[0]) == VIOLIN]


def lines(panel: Axes, label: str) -> list[Line2D]:
    return [line for line in panel.get_lines() if str(line.get_label()).startswith(label)]


# What is read


def test_there_is_a_group_for_each_combination_of_the_other_axes_in_the_order_of_the_sweep() -> None:
    assert [group.axes for group in GROUPS] == [{COUNT: count} for count in COUNTS]
    assert all(group.x.tolist() == SPEEDS for group in GROUPS)


@pytest.mark.parametrize(("groups", "limit"), [(GROUPS, CENSORED_AT), (OPEN, math.inf)])
def test_the_estimate_is_that_of_trials_clipped_at_the_censoring_if_there_is_one(groups, limit: float) -> None:
    points = iter(POINTS)
    for group in groups:
        for found, point in zip(group.estimates, points, strict=False):
            clipped = np.minimum(point.times, limit), point.observed & (point.times <= limit)
            np.testing.assert_equal(found, estimate_weibull_mean(Measured(*clipped, limit, point.seed)).ends)
    assert all(np.isnan(group.estimates[1]).all() for group in GROUPS)


def test_a_trial_that_synchronises_at_the_censoring_is_not_censored_and_one_after_it_is() -> None:
    times = [10, 20, 30, 40, 50]
    (made,) = in_memory(sweep({SPEED: [1]}), lambda _: ended(times))
    (at_last,), (before,) = read_groups([made], SPEED, 50), read_groups([made], SPEED, 49)
    assert at_last.estimates[0, 0] == weibull_mean(times, [True] * 5)
    assert before.estimates[0, 0] == weibull_mean([*times[:4], 49], [True] * 4 + [False])
    assert before.estimates[0, 0] != at_last.estimates[0, 0]


def test_the_censoring_makes_the_estimate_undetermined_where_appendix_a_says() -> None:
    (made,) = in_memory(sweep({SPEED: [1]}), lambda _: ended(range(1, 101)))
    last = round(100 * MIN_UNCENSORED)
    for limit, is_undetermined in ((last - 1, True), (last, False)):
        (group,) = read_groups([made], SPEED, limit)
        assert np.isnan(group.estimates[0, 0]) == is_undetermined


def test_censored_trials_stay_censored_and_are_in_no_violin() -> None:
    for group in GROUPS:
        own = [point for point in POINTS if point.axes[COUNT] == group.axes[COUNT]]
        for times, censored, plain, point in zip(
            group.synchronised, group.censored, group.sample_means, own, strict=True
        ):
            assert times.tolist() == point.times[point.observed].tolist()
            assert censored == (~point.observed).sum()
            np.testing.assert_equal(plain, math.nan if censored else np.mean(point.times))
    assert [bool(group.censored.any()) for group in GROUPS] == [True, False, False]


def test_points_without_trials_are_left_out() -> None:
    made = in_memory(sweep({SPEED: [1, 2, 3]}), lambda point: ended([] if point.axes[SPEED] == 2 else [5]))
    (group,) = read_groups(made, SPEED)
    assert group.x.tolist() == [1, 3]


# The density


@given(st.lists(st.integers(1, 10**7), min_size=1, max_size=30))
def test_a_violin_spans_its_trials_and_is_1_where_it_is_widest(times: list[int]) -> None:
    heights, widths = density(np.array(times, float), of_logarithms=True)
    assert heights[[0, -1]] == pytest.approx([min(times), max(times)])
    assert (np.diff(heights) >= 0).all()
    assert widths.max() == 1
    assert widths.min() >= 0


def test_the_density_is_that_of_the_logarithms() -> None:
    """Of a lognormal distribution it is a bell around the median, and not around the mean."""
    drawn = np.exp(5 + np.random.default_rng(1).standard_normal(20_000))
    heights, widths = density(drawn, of_logarithms=True)
    expected = np.exp(-((np.log(heights) - 5) ** 2) / 2 / (1 + 20_000**-0.4))
    np.testing.assert_allclose(widths, expected, atol=0.05)


def test_two_groups_of_trials_make_two_humps() -> None:
    heights, widths = density(np.array([10.0] * 10 + [11.0] * 10 + [1000.0] * 5 + [1100.0] * 5), of_logarithms=True)
    between = widths[(heights > 50) & (heights < 200)]
    upper = widths[heights > 500]
    assert between.min() < 0.2
    assert 0.4 < upper.max() < 0.6


# What is drawn


def test_there_is_a_violin_at_each_point_as_wide_as_the_others_and_apart_from_them() -> None:
    for panel, group in zip(panels_of(GROUPS), GROUPS, strict=True):
        found = violins(panel)
        assert len(found) == len(SPEEDS)
        widths = []
        for corners, x, times in zip(found, group.x, group.synchronised, strict=True):
            left, right = np.log10([corners[:, 0].min(), corners[:, 0].max()])
            assert (left + right) / 2 == pytest.approx(math.log10(x))
            assert corners[:, 1].min() == pytest.approx(times.min())
            assert corners[:, 1].max() == pytest.approx(times.max())
            widths.append(right - left)
        assert np.allclose(widths, widths[0])
        assert 0.2 < widths[0] / np.diff(np.log10(SPEEDS)).min() < 1


def test_a_violin_is_as_wide_as_the_density() -> None:
    made = in_memory(sweep({SPEED: [0.1, 1]}), lambda point: weibull(point, 50))
    (group,) = read_groups(made, SPEED)
    (panel,) = panels_of([group], None)
    for corners, x, times in zip(violins(panel), group.x, group.synchronised, strict=True):
        widths = np.abs(np.log10(corners[:, 0] / x)) / 0.4  # a decade apart
        heights, expected = density(times, of_logarithms=True)
        np.testing.assert_allclose(widths, np.interp(np.log(corners[:, 1]), np.log(heights), expected), atol=1e-6)


def test_where_no_trial_synchronised_there_is_no_violin() -> None:
    made = in_memory(sweep({SPEED: [1, 2]}), lambda _: ended([9, 9], [False, False]))
    (panel,) = panels_of(read_groups(made, SPEED), None)
    assert violins(panel) == []
    (crosses,) = lines(panel, "undetermined")
    assert crosses.get_xdata().tolist() == [1, 2]


def test_the_line_is_the_estimate_and_the_band_its_interval() -> None:
    for panel, group in zip(panels_of(GROUPS), GROUPS, strict=True):
        (line,) = lines(panel, "Weibull mean (Appendix A)")
        np.testing.assert_array_equal(line.get_ydata(), group.estimates[:, 0])
        (band,) = [each for each in panel.collections if to_hex(each.get_facecolor()[0]) == LINE]
        corners = {(float(x), float(y)) for path in band.get_paths() for x, y in path.vertices}
        ends = np.isfinite(group.estimates[:, 2])
        assert ends.sum() >= 3
        for x, (_, low, high) in zip(group.x[ends], group.estimates[ends], strict=True):
            assert {(x, low), (x, high)} <= corners


def test_an_undetermined_estimate_is_a_cross_within_the_panel_above_all_trials() -> None:
    for panel, group in zip(panels_of(GROUPS), GROUPS, strict=True):
        (crosses,) = lines(panel, "undetermined")
        assert crosses.get_xdata().tolist() == group.x[np.isnan(group.estimates[:, 0])].tolist()
        assert 0.5 in crosses.get_xdata()
        highest = max(times.max() for each in GROUPS for times in each.synchronised)
        (_, above), *_ = panel.transAxes.inverted().transform(panel.transData.transform([(1, highest)]))
        assert (crosses.get_ydata() > above).all()  # as a share of the panel
        assert (crosses.get_ydata() < 1).all()


def test_dots_are_the_sample_means_where_nothing_is_censored() -> None:
    for panel, group in zip(panels_of(GROUPS), GROUPS, strict=True):
        (dots,) = lines(panel, "mean of all trials")
        assert dots.get_linestyle() == "None"
        drawn = dict(zip(dots.get_xdata(), dots.get_ydata(), strict=True))
        for x, plain, censored in zip(group.x, group.sample_means, group.censored, strict=True):
            assert np.isnan(drawn[x]) if censored else drawn[x] == plain


def test_a_dashed_line_marks_the_censoring_where_there_is_one() -> None:
    for panel in panels_of(GROUPS):
        (line,) = lines(panel, r"$T_\mathrm{cens}$ of the Weibull mean: 60")
        assert (line.get_linestyle(), *line.get_ydata()) == ("--", CENSORED_AT, CENSORED_AT)
    assert all(lines(panel, r"$T_\mathrm{cens}") == [] for panel in panels_of(OPEN, None))


def test_a_censoring_above_all_trials_is_within_the_figure() -> None:
    (panel, *_) = panels_of(read_groups(POINTS, SPEED, 10**7), 10**7)
    assert panel.get_ylim()[1] > 10**7
    assert lines(panel, r"$T_\mathrm{cens}$ of the Weibull mean: $10^{7}$")


def test_the_caption_says_how_many_trials_are_censored_and_nothing_where_none_is() -> None:
    censored = sum(int((~point.observed).sum()) for point in POINTS)
    trials = sum(len(point.times) for point in POINTS)
    assert censored > 10
    numbers = count_trials([len(point.times) for point in POINTS])
    what = "Distribution of T_sync (cycles) against V (cm/s), with Weibull means and their 95 % intervals"
    shows = Violins(axis=SPEED, groups=GROUPS).shows
    assert shows == f"{what}; {numbers}; {censored} of {trials} trials censored, not in the violins"
    assert Violins(axis=SPEED, groups=GROUPS[1:]).shows == f"{what}; {numbers}"


def test_the_legend_names_each_mark_once() -> None:
    assert legend_texts(Violins(axis=SPEED, groups=GROUPS, censored_at=CENSORED_AT).draw_figure()) == [
        "trials that synchronised",
        "Weibull mean (Appendix A)",
        "its 95 % interval",
        "undetermined: too many censored",
        "mean of all trials",
        r"$T_\mathrm{cens}$ of the Weibull mean: 60",
    ]


def test_panels_are_in_order_and_share_their_scales() -> None:
    panels = panels_of(GROUPS)
    assert [panel.get_title() for panel in panels] == [f"N = {count}" for count in COUNTS]
    assert len({(panel.get_xlim(), panel.get_ylim()) for panel in panels}) == 1
    assert (panels[0].get_xscale(), panels[0].get_yscale()) == ("log", "log")
    assert (panels[0].get_xlabel(), panels[0].get_ylabel()) == ("V (cm/s)", r"$T_\mathrm{sync}$ (cycles)")


def test_a_linear_axis_has_violins_of_one_width_on_it() -> None:
    made = in_memory(sweep({COUNT: [2, 3, 5]}), lambda point: weibull(point, 50))
    (panel,) = laid_out(Violins(axis=COUNT, groups=read_groups(made, COUNT), censored_at=None).draw_figure()).axes
    assert panel.get_xscale() == "linear"
    assert [np.ptp(corners[:, 0]) for corners in violins(panel)] == pytest.approx([0.8] * 3)


# The table


def test_the_csv_has_the_numbers_of_the_violins(tmp_path) -> None:
    table = written(tmp_path, Violins(axis=SPEED, groups=GROUPS).tables[".csv"])
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
