"""Claims about figures of curves: what is drawn, and what the tables hold, is what the curves hold."""

import math
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from epuck_sim.figures.forms.curves import EXTREMA_COLUMNS, Curves
from epuck_sim.figures.labels import axis_label, format_axis_values, key_name
from epuck_sim.figures.saving import Table
from epuck_sim.scenario.axes import FigureSection
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.extrema import ExtremaSearch, SpeedExtrema
from epuck_sim.statistics.names import Statistic
from tests.figures.drawn import laid_out, legend_texts, shown_text, written
from tests.runs.made_folders import (
    COUNT,
    COUPLING,
    HEIGHT,
    MANY_SPEEDS,
    PERIOD,
    PIXELS,
    SPEED,
    WIDTH,
    bumpy_mean,
    extremes,
    falling_mean,
    six_digits,
    sweep,
)

POINT_COLUMNS = ["trials", "censored", "statistic", "estimate", "low", "high"]
NOTHING = ExtremaSearch(None, "")
SCENARIO = sweep(None)


def curve_of(means, x=None, axes=None, censored=(), undetermined=(), seed=0) -> Curve:
    """Return a curve: `censored` are places of points some of whose trials are, `undetermined` have no value at all."""
    random = np.random.default_rng(seed)
    means = np.array(means, float)
    x = np.array(MANY_SPEEDS[: len(means)] if x is None else x, float)
    share = np.array([1.0 if n in undetermined else 0.25 if n in censored else 0.0 for n in range(len(means))])
    resampled = means * np.exp(0.05 * random.standard_normal((200, len(means))))
    is_undetermined = np.isin(np.arange(len(means)), list(undetermined))
    resampled[:, is_undetermined] = math.inf
    return Curve(
        axes=axes or {},
        scenario=SCENARIO,
        statistic=Statistic.MEAN,
        x=x,
        trials=np.full(len(means), 200),
        censored=share,
        values=np.where(is_undetermined, math.nan, means),
        intervals=np.percentile(resampled, [2.5, 97.5], axis=0, method="nearest").T,
        resampled=resampled,
    )


def form_of(curves, axis=SPEED, searches=None, split_by=None) -> Curves:
    """Return the form of curves, whose minima and peaks may be given."""
    form = Curves(axis=axis, curves=curves, split_by=split_by)
    if searches is not None:
        form.searches = searches
    return form


BUMPY = curve_of([bumpy_mean(speed) for speed in MANY_SPEEDS], axes={COUPLING: 0.1}, censored=[0, 8, 9])
MOVED = curve_of(
    [bumpy_mean(speed, 2, 150) for speed in MANY_SPEEDS], axes={COUPLING: 0.2}, undetermined=[0, 1], seed=1
)
FALLING = curve_of([falling_mean(speed) for speed in MANY_SPEEDS], axes={COUPLING: 0.4}, seed=2)
CURVES = [BUMPY, MOVED, FALLING]
EXTREMA = form_of(CURVES).searches
FOUND = [True, True, False]


def axes_of(curves, axis=SPEED, extrema=None) -> Axes:
    return form_of(curves, axis, [NOTHING] * len(curves) if extrema is None else extrema).draw_figure().axes[0]


def marked(axes: Axes, marker: str, face: str | None = None) -> list[Line2D]:
    """Return what is drawn with a marker, in the order of the curves; `face` is its colour where that matters."""
    lines = [line for line in axes.get_lines() if line.get_marker() == marker]
    return [line for line in lines if face is None or to_hex(line.get_markerfacecolor()) == face]


def lines_of(axes: Axes) -> list[Line2D]:
    return [line for line in axes.get_lines() if line.get_linestyle() in ("-", "--") and line.get_marker() == "None"]


def named(axes: Axes) -> dict[str, str]:
    """Return the colour of each curve that the legend names, by its label."""
    handles, labels = axes.get_legend_handles_labels()
    return {
        label: to_hex(handle.get_color())
        for handle, label in zip(handles, labels, strict=True)
        if isinstance(handle, Line2D) and handle.get_linestyle() == "-"
    }


def drawn(lines: list[Line2D]) -> list[tuple[float, float]]:
    """Return all points of some lines, without the gaps."""
    points = [(float(x), float(y)) for line in lines for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)]
    return [(x, y) for x, y in points if not math.isnan(y)]


def seen(ticks) -> list[str]:
    return [label.get_text() for label in ticks if label.get_text()]


# What is drawn


def test_the_curves_of_these_tests_have_extrema_where_they_should() -> None:
    assert [pair.extrema is not None and pair.extrema.is_found for pair in EXTREMA] == FOUND
    assert EXTREMA[0].extrema.v_m == pytest.approx(extremes()["v_m"], rel=0.2)


def test_each_curve_is_one_line_of_its_own_colour_labelled_with_the_second_axis() -> None:
    axes = axes_of(CURVES)
    assert [*named(axes)] == legend_texts(axes.figure)[:3] == ["ε = 0.1", "ε = 0.2", "ε = 0.4"]
    assert [to_hex(line.get_color()) for line in lines_of(axes)] == [*named(axes).values()]
    assert len({*named(axes).values()}) == 3


def test_curves_differ_in_their_markers_too_and_the_legend_has_them() -> None:
    axes = axes_of(CURVES)
    handles, _ = axes.get_legend_handles_labels()
    assert [handle.get_marker() for handle in handles[:3]] == ["o", "s", "D"]
    for curve, marker in zip(CURVES, "osD", strict=True):
        known = ~np.isnan(curve.values)
        at_points = drawn([line for line in marked(axes, marker) if line.get_linestyle() == "None"])
        assert sorted(at_points) == sorted(zip(curve.x[known], curve.values[known], strict=True))


@pytest.mark.parametrize(
    ("curves", "searches", "expected"),
    [
        ([FALLING], [NOTHING], ["95 % interval"]),
        ([BUMPY], [NOTHING], ["95 % interval", "some trials censored"]),
        ([MOVED], [NOTHING], ["95 % interval", "undetermined: too many censored"]),
        (
            [BUMPY],
            EXTREMA[:1],
            ["95 % interval", "some trials censored", r"local minimum $V_\mathrm{m}$", r"peak $V_\mathrm{p}$"],
        ),
        ([curve_of([3, 2], undetermined=[0, 1])], [NOTHING], ["undetermined: too many censored"]),
    ],
)
def test_the_legend_names_every_mark_that_is_drawn_and_no_other(curves, searches, expected: list[str]) -> None:
    figure = form_of(curves, SPEED, searches).draw_figure()
    assert legend_texts(figure) == expected


def test_a_legend_is_not_on_top_of_the_panels() -> None:
    figure = laid_out(form_of(CURVES, SPEED, EXTREMA).draw_figure())
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert not any(box.overlaps(axes.get_tightbbox()) for axes in figure.axes)
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.x1


def test_the_base_case_is_dashed_and_named() -> None:
    base = sweep(None, figure={"base_case": {COUPLING: 0.2}})
    figure = form_of([each._replace(scenario=base) for each in CURVES], SPEED, [NOTHING] * 3).draw_figure()
    assert [line.get_linestyle() for line in lines_of(figure.axes[0])][:3] == ["-", "--", "-"]
    assert "base case" in legend_texts(figure)
    assert "base case" not in legend_texts(form_of(CURVES, SPEED, [NOTHING] * 3).draw_figure())


def test_the_lines_hold_the_means_with_gaps_where_they_are_undetermined() -> None:
    for line, curve in zip(lines_of(axes_of(CURVES)), CURVES, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), curve.x)
        np.testing.assert_array_equal(line.get_ydata(), curve.values)


def test_curves_have_a_panel_for_each_value_of_the_axis_that_splits_them() -> None:
    curves = [curve_of([100 * n + 10 * eps, 50], axes={COUNT: n, COUPLING: eps}) for n in (5, 10) for eps in (0.1, 0.2)]
    figure = form_of(curves, SPEED, [NOTHING] * 4, COUNT).draw_figure()
    assert [axes.get_title() for axes in figure.axes] == ["N = 5", "N = 10"]
    for axes, n in zip(figure.axes, (5, 10), strict=True):
        assert [line.get_ydata()[0] for line in lines_of(axes)] == [100 * n + 1, 100 * n + 2]
    first, second = ([line.get_color() for line in lines_of(axes)] for axes in figure.axes)
    assert first == second == [*named(figure.axes[0]).values()]
    assert legend_texts(figure) == ["ε = 0.1", "ε = 0.2", "95 % interval"]


def test_the_bands_span_the_intervals_in_the_colour_of_their_lines() -> None:
    axes = axes_of(CURVES)
    assert axes.collections[-1].get_label() == "95 % interval"
    for band, line, curve in zip(axes.collections[:-1], lines_of(axes), CURVES, strict=True):
        known = np.isfinite(curve.values)
        x, (low, high) = curve.x[known], curve.intervals[known].T
        corners = {(float(x), float(y)) for path in band.get_paths() for x, y in path.vertices}
        assert corners == {*zip(x, low, strict=True), *zip(x, high, strict=True)}
        assert to_hex(band.get_facecolor()[0]) == to_hex(line.get_color())
        assert 0 < band.get_alpha() < 1


def test_markers_are_hollow_exactly_where_trials_are_censored() -> None:
    axes = axes_of([BUMPY])
    is_censored = BUMPY.censored > 0
    assert is_censored.sum() == 3
    hollow = marked(axes, "o", "#ffffff")
    solid = [line for line in marked(axes, "o") if line not in hollow]
    for lines, chosen in ((hollow, is_censored), (solid, ~is_censored)):
        assert drawn(lines) == [*zip(BUMPY.x[chosen], BUMPY.values[chosen], strict=True)]


def test_a_mean_that_is_undetermined_is_a_cross_above_all_means_and_has_no_other_marker() -> None:
    axes = axes_of(CURVES)
    crosses = drawn(marked(axes, "x"))
    assert [x for x, _ in crosses] == MANY_SPEEDS[:2]
    highest = max(np.nanmax(curve.values) for curve in CURVES)
    bottom, top = axes.get_ylim()
    on_page = axes.transAxes.transform([(0, y) for _, y in crosses])
    heights = axes.transData.inverted().transform(on_page)[:, 1]
    assert all(highest < y < top for y in heights)
    points = [point for marker in "osD" for point in drawn(marked(axes, marker))]
    assert len(points) == 3 * len(MANY_SPEEDS) - 2
    assert bottom < min(np.nanmin(curve.values) for curve in CURVES)


def test_crosses_of_two_curves_at_one_place_are_both_seen_above_all_points() -> None:
    hidden = [curve_of([50.0, 40.0], axes={COUPLING: n}, undetermined=[0]) for n in (0.1, 0.2)]
    axes = axes_of([*hidden, FALLING])
    laid_out(axes.figure)
    crosses = [line for line in marked(axes, "x") if line.get_xdata().size]
    heights = sorted(float(line.get_ydata()[0]) for line in crosses[:2])
    assert len({*heights}) == 2
    points = axes.transData.transform([(1, float(np.nanmax(FALLING.values)))])
    assert axes.transAxes.inverted().transform(points)[0, 1] < heights[0]


def test_triangles_mark_the_minimum_and_the_peak_where_they_are_found_and_nowhere_else() -> None:
    axes = axes_of(CURVES, extrema=EXTREMA)
    assert drawn(marked(axes, "v")) == [(pair.v_m, pair.t_m) for pair, _ in EXTREMA[:2]]
    assert drawn(marked(axes, "^")) == [(pair.v_p, pair.t_p) for pair, _ in EXTREMA[:2]]
    colours = [to_hex(line.get_color()) for line in lines_of(axes)]
    assert [to_hex(line.get_color()) for line in marked(axes, "v") if len(line.get_xdata())] == colours[:2]


def test_a_band_without_upper_end_goes_beyond_the_figure_and_does_not_stretch_it() -> None:
    open_ended = BUMPY._replace(intervals=np.column_stack([BUMPY.intervals[:, 0], np.full(len(BUMPY.x), math.inf)]))
    axes = axes_of([open_ended])
    bottom, top = axes.get_ylim()
    assert max(y for _, y in axes.collections[0].get_paths()[0].vertices) > top
    assert np.nanmax(BUMPY.values) < top < 10 * np.nanmax(BUMPY.values)
    assert bottom > 0
    laid_out(axes.figure)


def test_every_point_and_mark_is_within_the_figure() -> None:
    axes = axes_of(CURVES, extrema=EXTREMA)
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    for marker in "osD^v":
        for x, y in drawn(marked(axes, marker)):
            assert left < x < right
            assert bottom < y < top


# Axes and words


def test_both_axes_are_logarithmic_with_plain_numbers() -> None:
    axes = axes_of(CURVES)
    laid_out(axes.figure)
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    for axis in (axes.xaxis, axes.yaxis):
        labels = seen(axis.get_ticklabels())
        assert len(labels) > 3
        for label, value in zip(labels, axis.get_majorticklocs(), strict=True):
            assert float(label) == pytest.approx(value)
            assert set(label) <= set("0123456789.")
        assert seen(axis.get_ticklabels(minor=True)) == []


@pytest.mark.parametrize(
    ("axis", "x", "scale"),
    [
        (SPEED, [1, 2, 3], "log"),
        (SPEED, [0, 1, 20], "linear"),
        (COUNT, [5, 20, 40], "linear"),
        (COUNT, [5, 20, 50], "log"),
        (COUNT, [5, 5, 5], "linear"),
    ],
)
def test_x_is_logarithmic_for_speeds_and_for_values_that_span_a_decade(axis: str, x: list, scale: str) -> None:
    axes = axes_of([curve_of([30, 20, 10], x=x)], axis=axis)
    laid_out(axes.figure)
    assert axes.get_xscale() == scale


def test_many_decades_are_labelled_by_powers_of_ten_alone_on_both_axes_and_do_not_overlap() -> None:
    axes = axes_of([curve_of([10.0**n for n in range(1, 8)], x=[10.0**n for n in range(-2, 5)])])
    laid_out(axes.figure)
    assert {"$10^{1}$", "$10^{5}$"} <= set(seen(axes.get_yticklabels()))
    assert {"$10^{0}$", "$10^{2}$"} <= set(seen(axes.get_xticklabels()))
    for ticks in (axes.get_xticklabels(), axes.get_yticklabels()):
        assert all(label.startswith("$10^") for label in seen(ticks))
    for ticks in (axes.get_xticklabels(), axes.get_yticklabels()):
        boxes = [label.get_window_extent() for label in ticks if label.get_text()]
        assert len(boxes) > 3
        assert not any(one.overlaps(other) for one, other in pairwise(boxes))


def test_a_narrow_range_has_labels_too() -> None:
    axes = axes_of([curve_of([31, 30, 29], x=[60, 61, 62])], axis=WIDTH)
    laid_out(axes.figure)
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        labels = [float(label) for label in seen(axis.get_ticklabels())]
        assert sum(low <= label <= high for label in labels) >= 2


def test_without_a_second_axis_the_legend_names_no_curve() -> None:
    assert named(axes_of([BUMPY])) == named(axes_of([BUMPY._replace(axes={})])) == {}


def test_labels_leave_out_what_is_the_same_or_goes_along() -> None:
    curves = [
        curve_of([30, 20], x=[1, 2], axes={WIDTH: size, HEIGHT: size, COUNT: 10, SPEED: 1}) for size in (40, 60.5)
    ]
    assert [*named(axes_of(curves, PERIOD))] == ["L = 40 cm", "L = 60.5 cm"]


def test_users_files_have_their_names_alone_where_these_tell_them_apart() -> None:
    key, files = "robots.0.controller", ("/me/kura.py", "/me/mine.py", "/you/mine.py")
    labels = [*named(axes_of([curve_of([3, 2], axes={key: file}) for file in files]))]
    assert labels == ["controller = kura", "controller = /me/mine.py", "controller = /you/mine.py"]


def test_two_groups_of_robots_are_told_apart_on_the_axis_and_in_the_legend() -> None:
    other = "robots.1.parameters.speed_cm_s"
    figure = form_of([curve_of([3, 2], axes={other: n}) for n in (1, 2)], SPEED, [NOTHING] * 2).draw_figure()
    assert figure.axes[0].get_xlabel() == "V of robots.0 (cm/s)"
    assert legend_texts(figure)[:2] == ["V of robots.1 = 1 cm/s", "V of robots.1 = 2 cm/s"]
    assert axis_label(other) == "V of robots.1 (cm/s)"
    assert key_name("arena.width_cm", ["arena.obstacles.0.width_cm"]) == "L"  # a box has a width, and no L
    assert key_name("a.b.count", ["a.b.parameters.count"]) == "a.b.count"


def test_axes_have_the_thesis_s_symbols_and_there_is_no_title() -> None:
    figure = form_of(CURVES, SPEED, EXTREMA).draw_figure()
    axes = figure.axes[0]
    assert (figure.get_suptitle(), axes.get_xlabel(), axes.get_ylabel()) == (
        "",
        "V (cm/s)",
        "$T_\\mathrm{sync}$ (cycles)",
    )
    assert axes_of([curve_of([3, 2])], axis=COUPLING).get_xlabel() == "ε"
    assert axes_of([curve_of([3, 2])], axis="stop.order_parameter").get_xlabel() == "order parameter"
    assert [key_name(key) for key in (WIDTH, COUNT, PERIOD, PIXELS)] == ["L", "N", "τ", "pixels"]
    assert format_axis_values({PERIOD: 5, COUPLING: 0.1, "noise": "off"}) == "τ = 5 s, ε = 0.1, noise = off"


def test_the_keys_of_particles_have_the_thesis_s_symbols() -> None:
    values = {
        "space.side_cm": 100,
        "space.dimensions": 2,
        "agents.count": 20,
        "neighbourhood.radius_cm": 25,
        "neighbourhood.angle_deg": 60,
        "neighbourhood.k": 1,
        "response.refractory": 0.1,
        "clocks.jitter": 0.01,
    }
    expected = (
        "L = 100 cm, dimensions = 2, N = 20, R = 25 cm, θ = 60°, K = 1, D = 0.1, \N{GREEK SMALL LETTER SIGMA} = 0.01"
    )
    assert format_axis_values(values) == expected
    assert axis_label("neighbourhood.angle_deg") == "θ (°)"
    curves = [curve_of([3, 2], axes=values), curve_of([3, 2], axes=dict.fromkeys(values, 7))]
    laid_out(form_of(curves, PERIOD, [NOTHING] * 2).draw_figure())


@pytest.mark.parametrize("name", ["costs $5 and $6", "a $\\frac{$", "x_1^2 \\alpha & <b> {0} 50 %"])
def test_a_name_is_no_formula(name: str) -> None:
    form = form_of([FALLING], SPEED, [NOTHING])
    form.settings = FigureSection(title=name)
    figure = laid_out(form.draw_figure())
    (title,) = figure.texts
    assert shown_text(title) == name


# The tables


def points_of(curves, axis=SPEED) -> Table:
    return form_of(curves, axis).tables[".csv"]


def extrema_of(curves, axis=SPEED) -> Table:
    return form_of(curves, axis).tables["-regimes.csv"]


def test_the_csv_has_the_numbers_of_the_curves(tmp_path) -> None:
    table = written(tmp_path, points_of(CURVES))
    assert list(table[0]) == [COUPLING, SPEED, *POINT_COLUMNS]
    expected = [
        [str(curve.axes[COUPLING]), *map(six_digits, row[:3]), row[3], *map(six_digits, row[4:])]
        for curve in CURVES
        for row in zip(
            curve.x, curve.trials, curve.censored, curve.names, curve.values, *curve.intervals.T, strict=True
        )
    ]
    assert [[*row.values()] for row in table] == expected
    assert [row["estimate"] == row["high"] == "" for row in table].count(True) == 2


def test_the_table_of_extrema_has_a_row_for_each_curve_with_its_pair_or_the_p_value_alone(tmp_path) -> None:
    found = written(tmp_path, extrema_of(CURVES))
    assert list(found[0]) == [COUPLING, *EXTREMA_COLUMNS, "p_value", "reason"]
    assert [row[COUPLING] for row in found] == ["0.1", "0.2", "0.4"]
    for row, (pair, reason) in zip(found, EXTREMA, strict=True):
        assert row["reason"] == reason == ""
        assert row["p_value"] == six_digits(pair.p_value)
        for place, name in enumerate(("v_m", "t_m", "v_p", "t_p")):
            numbers = [pair[place], *pair.intervals[place]] if pair.is_found else [math.nan] * 3
            assert [row[name], row[f"{name}_low"], row[f"{name}_high"]] == [*map(six_digits, numbers)]
    assert [row["v_m"] != "" for row in found] == FOUND


def test_too_few_speeds_have_no_extrema(tmp_path) -> None:
    few = curve_of(BUMPY.values[:5], axes={COUPLING: 0.1})
    (row,) = written(tmp_path, extrema_of([few]))
    assert [*row.values()] == ["0.1", *[""] * 13, "5 speeds; a minimum and a peak take 6"]


def test_another_axis_than_the_speed_is_drawn_and_has_no_extrema(tmp_path) -> None:
    curve = curve_of(BUMPY.values, x=np.arange(13) + 2, axes={SPEED: 1})
    (row,) = written(tmp_path, extrema_of([curve], COUNT))
    assert [*row.values()] == ["1", *[""] * 13, "the axis is no speed"]
    assert [row[COUNT] for row in written(tmp_path, points_of([curve], COUNT))] == [str(n) for n in range(2, 15)]
    axes = axes_of([curve], axis=COUNT, extrema=form_of([curve], COUNT).searches)
    assert drawn(lines_of(axes)) == [*zip(curve.x, curve.values, strict=True)]
    assert marked(axes, "v") == marked(axes, "^") == []


def test_axis_values_are_in_the_csv_as_they_are_in_the_sweep(tmp_path) -> None:
    axes = {"noise": 'a "quoted", name', "arena.obstacles": [], "stop.max_time_s": None, COUNT: 10}
    curves = [curve_of([3, 2], axes=axes)]
    for table in (points_of(curves), extrema_of(curves)):
        row = written(tmp_path, table)[0]
        assert {key: row[key] for key in axes} == {key: "" if v is None else str(v) for key, v in axes.items()}


def test_a_pair_that_may_be_noise_is_not_marked() -> None:
    found = EXTREMA[0].extrema
    unsure = SpeedExtrema(*found[:6], 0.2, found.resampled)
    undone = found._replace(resampled=np.full((200, 4), math.nan))
    axes = axes_of([BUMPY, MOVED], extrema=[ExtremaSearch(unsure, ""), ExtremaSearch(undone, "")])
    assert marked(axes, "v") == marked(axes, "^") == []
