"""Claims about figures of curves, of series and of predictions: what is drawn, and in the tables, is what they hold."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from epuck_sim import load_scenario, read_points
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.forms.curves import EDGE, MAX_LINES, Curves, Series, predict_curves
from epuck_sim.figures.forms.maps import Maps, read_maps
from epuck_sim.figures.forms.violins import Violins, read_violins
from epuck_sim.figures.labels import axis_label, format_axis_values, key_name
from epuck_sim.figures.style import has_log_scale
from epuck_sim.figures.sweep_figure import read_form
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.curves import Curve, PointSeries, read_curves, series_statistics
from epuck_sim.statistics.extrema import ExtremaSearch
from epuck_sim.theory.predict import predict
from tests.figures.drawn import in_csv, laid_out, legend_texts, written
from tests.runs import made_folders
from tests.runs.made_folders import COUNT, COUPLING, MANY_SPEEDS, PERIOD, SPEED, WIDTH, ended, in_memory, sweep, weibull

NOTHING = ExtremaSearch({}, None, "")
SCENARIO = sweep(None)


def curve_of(means, x=None, axes=None, censored=(), undetermined=(), seed=0) -> Curve:
    """Return a curve: `censored` are places of points some of whose trials are, `undetermined` have no value at all."""
    random = np.random.default_rng(seed)
    means = np.array(means, float)
    places = np.arange(len(means))
    is_undetermined = np.isin(places, list(undetermined))
    resampled = means * np.exp(0.05 * random.standard_normal((200, len(means))))
    resampled[:, is_undetermined] = math.inf
    x = np.array(MANY_SPEEDS[: len(means)] if x is None else x, float)
    shares = np.where(is_undetermined, 1.0, np.where(np.isin(places, list(censored)), 0.25, 0.0))
    values = np.where(is_undetermined, math.nan, means)
    intervals = np.percentile(resampled, [2.5, 97.5], axis=0, method="nearest").T
    known = {"x": x, "trials": np.full(len(means), 200), "censored": shares, "values": values, "intervals": intervals}
    return Curve(axes=axes or {}, scenario=SCENARIO, statistic=Statistic.MEAN, resampled=resampled, **known)


def form_of(curves, axis=SPEED, searches=None, split_by=None) -> Curves:
    """Return the form of curves, whose minima and peaks may be given."""
    form = Curves(axis=axis, curves=curves, split_by=split_by)
    if searches is not None:
        form.searches = searches
    return form


BUMPY = curve_of([made_folders.bumpy_mean(speed) for speed in MANY_SPEEDS], axes={COUPLING: 0.1}, censored=[0, 8, 9])
FASTER = [made_folders.bumpy_mean(speed, 2, 150) for speed in MANY_SPEEDS]
MOVED = curve_of(FASTER, axes={COUPLING: 0.2}, undetermined=[0, 1], seed=1)
FALLING = curve_of([made_folders.falling_mean(speed) for speed in MANY_SPEEDS], axes={COUPLING: 0.4}, seed=2)
CURVES = [BUMPY, MOVED, FALLING]
FORM = form_of(CURVES)
EXTREMA = FORM.searches


def axes_of(curves, axis=SPEED) -> Axes:
    return form_of(curves, axis, [NOTHING] * len(curves)).draw_figure().axes[0]


@pytest.fixture(scope="module")
def panel() -> Axes:
    """Return the three curves with what they have, laid out, which no test changes."""
    return laid_out(FORM.draw_figure()).axes[0]


def marked(axes: Axes, marker: str, face: str | None = None) -> list[Line2D]:
    """Return what is drawn with a marker, in the order of the curves; `face` is its colour where that matters."""
    lines = [line for line in axes.get_lines() if line.get_marker() == marker]
    return [line for line in lines if face is None or to_hex(line.get_markerfacecolor()) == face]


def lines_of(axes: Axes) -> list[Line2D]:
    return [line for line in axes.get_lines() if line.get_linestyle() in ("-", "--") and line.get_marker() == "None"]


def named(axes: Axes) -> dict[str, str]:
    """Return the colour of each curve that the legend names, by its label."""
    each = zip(*axes.get_legend_handles_labels(), strict=True)
    lines = [(label, line) for line, label in each if isinstance(line, Line2D) and line.get_linestyle() == "-"]
    return {label: to_hex(line.get_color()) for label, line in lines}


def drawn(lines: list[Line2D]) -> list[tuple[float, float]]:
    """Return all points of some lines, without the gaps."""
    points = [(float(x), float(y)) for line in lines for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)]
    return [(x, y) for x, y in points if not math.isnan(y)]


def seen(ticks) -> list[str]:
    return [label.get_text() for label in ticks if label.get_text()]


def test_each_curve_is_one_line_of_its_own_look_with_gaps_and_a_label_and_the_base_case_is_dashed(panel) -> None:
    assert [*named(panel)] == legend_texts(panel.figure)[:3] == ["ε = 0.1", "ε = 0.2", "ε = 0.4"]
    assert [to_hex(line.get_color()) for line in lines_of(panel)] == [*named(panel).values()]
    assert len({*named(panel).values()}) == 3
    handles, _ = panel.get_legend_handles_labels()
    assert [handle.get_marker() for handle in handles[:3]] == ["o", "s", "D"]
    for line, curve, marker in zip(lines_of(panel), CURVES, "osD", strict=True):
        np.testing.assert_array_equal(line.get_xydata(), np.column_stack([curve.x, curve.values]))
        known = ~np.isnan(curve.values)
        at_points = drawn([each for each in marked(panel, marker) if each.get_linestyle() == "None"])
        assert sorted(at_points) == sorted(zip(curve.x[known], curve.values[known], strict=True))
    base = sweep(None, figure={"base_case": {COUPLING: 0.2}})
    axes = axes_of([each._replace(scenario=base) for each in CURVES])
    assert [line.get_linestyle() for line in lines_of(axes)][:3] == ["-", "--", "-"]
    assert "base case" in legend_texts(axes.figure)


def test_the_legend_names_every_mark_that_is_drawn_and_no_other_and_a_long_one_is_within_the_figure() -> None:
    of_places = [r"local minimum $V_\mathrm{m}$", r"peak $V_\mathrm{p}$"]
    for curve, search, expected in [
        (FALLING, NOTHING, ["95 % interval"]),
        (MOVED, NOTHING, ["95 % interval", "undetermined: too many censored"]),
        (BUMPY, EXTREMA[0], ["95 % interval", "restricted mean: some censored", *of_places]),
        (curve_of([3, 2], undetermined=[0, 1]), NOTHING, ["undetermined: too many censored"]),
    ]:
        assert legend_texts(form_of([curve], SPEED, [search]).draw_figure()) == expected
    base = {COUPLING: 1, PERIOD: 5, WIDTH: 60}
    each = [base | {[*base][place % 3]: 100 + place} for place in range(20)]
    curves = [curve_of([4, 3, 2], axes=axes) for axes in each]
    figure = laid_out(form_of(curves).draw_figure())
    (panel,), (legend,) = figure.axes, figure.legends
    box = legend.get_window_extent()
    assert not box.overlaps(panel.get_tightbbox())
    assert 0 <= box.x0 < box.x1 <= figure.bbox.x1
    assert box.y0 >= 0
    assert panel.bbox.height == pytest.approx(0.72 * panel.bbox.width, rel=0.02)


def test_curves_have_a_panel_for_each_value_of_the_axis_that_splits_them() -> None:
    curves = [curve_of([100 * n + 10 * eps, 50], axes={COUNT: n, COUPLING: eps}) for n in (5, 10) for eps in (0.1, 0.2)]
    figure = form_of(curves, SPEED, [NOTHING] * 4, COUNT).draw_figure()
    assert [axes.get_title() for axes in figure.axes] == ["N = 5", "N = 10"]
    for axes, n in zip(figure.axes, (5, 10), strict=True):
        assert [line.get_ydata()[0] for line in lines_of(axes)] == [100 * n + 1, 100 * n + 2]
        assert [line.get_color() for line in lines_of(axes)] == [*named(figure.axes[0]).values()]
    assert legend_texts(figure) == ["ε = 0.1", "ε = 0.2", "95 % interval"]


def test_bands_span_intervals_beyond_the_figure_if_need_be_and_one_without_a_neighbour_is_a_bar(panel) -> None:
    for band, line, curve in zip(panel.collections[:-1], lines_of(panel), CURVES, strict=True):
        known = np.isfinite(curve.values)
        x, (low, high) = curve.x[known], curve.intervals[known].T
        corners = {(float(x), float(y)) for path in band.get_paths() for x, y in path.vertices}
        assert corners == {*zip(x, low, strict=True), *zip(x, high, strict=True)}
        assert to_hex(band.get_facecolor()[0]) == to_hex(line.get_color())
    curve = curve_of([50.0, 40.0, 30.0, 20.0, 10.0], undetermined=[1])
    (bars,) = [each for each in axes_of([curve]).collections if isinstance(each, LineCollection)]
    (bar,) = bars.get_segments()
    assert [*map(tuple, bar)] == [(curve.x[0], end) for end in curve.intervals[0]]
    open_ended = BUMPY._replace(intervals=np.column_stack([BUMPY.intervals[:, 0], np.full(len(BUMPY.x), math.inf)]))
    axes = axes_of([open_ended])
    bottom, top = axes.get_ylim()
    assert max(y for _, y in axes.collections[0].get_paths()[0].vertices) > top
    assert np.nanmax(BUMPY.values) < top < 10 * np.nanmax(BUMPY.values)
    assert bottom > 0


@pytest.mark.parametrize("count", [2, 40])
def test_censored_points_are_hollow_and_undetermined_ones_crosses_side_by_side_on_the_upper_edge(count: int) -> None:
    axes = axes_of([BUMPY])
    is_censored = BUMPY.censored > 0
    hollow = marked(axes, "o", "#ffffff")
    solid = [line for line in marked(axes, "o") if line not in hollow]
    for lines, chosen in ((hollow, is_censored), (solid, ~is_censored)):
        assert drawn(lines) == [*zip(BUMPY.x[chosen], BUMPY.values[chosen], strict=True)]
    hidden = [curve_of([50.0, 40.0], axes={COUPLING: 0.1 + n}, undetermined=[0]) for n in range(count)]
    axes = axes_of([*hidden, FALLING])
    crosses = [line for line in marked(axes, "x") if line.get_xdata().size]
    places = [line.get_xdata().item() for line in crosses]
    assert len({*places}) == count
    assert places == pytest.approx([MANY_SPEEDS[0]] * count, rel=0.15)
    found = {(line.get_ydata().item(), line.get_clip_on(), line.get_in_layout()) for line in crosses}
    assert found == {(1, False, False)}  # a share of the panel; whole; and the layout has no room for it


@pytest.mark.parametrize("law", [lambda point: weibull(point, 250), lambda point: made_folders.censored(point, 9)])
def test_a_dotted_line_is_the_limit_of_all_censored_trials_if_near_and_a_long_one_a_power_of_ten(law) -> None:
    for limits, expected in (([100, 200, 200, 300, 300], []), ([300] * 5, [300])):
        zipped = {"zip": {SPEED: MANY_SPEEDS[:5], made_folders.LIMIT: limits}}
        panel = read_form(in_memory(sweep(None, 40, sweep=zipped), law), {}).draw_figure().axes[0]
        lines = [line for line in panel.get_lines() if line.get_linestyle() == ":"]
        assert [line.get_ydata()[0] for line in lines] == expected
    assert "limit: 300 cycles" in legend_texts(panel.figure)
    assert panel.get_ylim()[0] < 300 < panel.get_ylim()[1] < 2000
    scenario = sweep({SPEED: [1, 2]}, 20, stop={"max_cycles": 10**7})
    figure = read_form(in_memory(scenario, lambda point: weibull(point, 1e7)), {}).draw_figure()
    assert "limit: $10^{7}$ cycles" in legend_texts(figure)


def test_triangles_mark_the_minimum_and_the_peak_where_they_are_found_and_nowhere_else(panel) -> None:
    found, more, none = ({name: place.estimate.value for name, place in each.places.items()} for each in EXTREMA)
    assert not none
    assert found["V_m"] == pytest.approx(made_folders.extremes()["v_m"], rel=0.2)
    assert drawn(marked(panel, "v")) == [(pair["V_m"], pair["T_m"]) for pair in (found, more)]
    assert drawn(marked(panel, "^")) == [(pair["V_p"], pair["T_p"]) for pair in (found, more)]
    colours = [to_hex(line.get_color()) for line in lines_of(panel)]
    assert [to_hex(line.get_color()) for line in marked(panel, "v") if len(line.get_xdata())] == colours[:2]
    assert marked(form_of([BUMPY], SPEED, [ExtremaSearch({}, 0.2, "")]).draw_figure().axes[0], "v") == []


def test_axes_have_the_thesis_s_symbols_and_plain_numbers_and_x_is_logarithmic_where_its_values_are(panel) -> None:
    words = panel.figure.get_suptitle(), panel.get_xlabel(), panel.get_ylabel()
    assert words == ("", "V (cm/s)", r"$T_\mathrm{sync}$ (cycles)")
    assert (panel.get_xscale(), panel.get_yscale()) == ("log", "log")
    for axis in (panel.xaxis, panel.yaxis):
        labels = seen(axis.get_ticklabels())
        assert len(labels) > 3
        assert [float(label) for label in labels] == pytest.approx(axis.get_majorticklocs()[: len(labels)])
        assert set("".join(labels)) <= set("0123456789.")
        assert seen(axis.get_ticklabels(minor=True)) == []
    for axis, scale, several in [
        (SPEED, "log", [[1, 2, 3]]),
        (SPEED, "linear", [[0, 1, 20]]),
        (COUNT, "log", [[5, 20, 50], [5, 10, 20, 40]]),
        (COUNT, "linear", [[5, 20, 40], [5, 5, 5], [10, 20, 30, 50]]),
    ]:
        for x in several:
            assert axes_of([curve_of([30] * len(x), x=x)], axis=axis).get_xscale() == scale


def test_many_decades_are_labelled_by_powers_of_ten_that_do_not_overlap_and_a_narrow_range_too() -> None:
    axes = axes_of([curve_of([10.0**n for n in range(1, 8)], x=[10.0**n for n in range(-2, 5)])])
    assert {"$10^{1}$", "$10^{5}$"} <= set(seen(axes.get_yticklabels()))
    for ticks in (axes.get_xticklabels(), axes.get_yticklabels()):
        assert all(label.startswith("$10^") for label in seen(ticks))
        boxes = [label.get_window_extent() for label in ticks if label.get_text()]
        assert len(boxes) > 3
        assert not any(one.overlaps(other) for one, other in pairwise(boxes))
    for narrow in ([31, 30, 29], [141, 125, 108]):
        axes = axes_of([curve_of(narrow, x=[60, 61, 62])], axis=WIDTH)
        for axis in (axes.xaxis, axes.yaxis):
            low, high = axis.get_view_interval()
            assert sum(low <= float(label) <= high for label in seen(axis.get_ticklabels())) >= 2


def test_labels_of_curves_say_what_tells_them_apart() -> None:
    squares = [{WIDTH: side, made_folders.HEIGHT: side, COUNT: 10, SPEED: 1} for side in (40, 60.5)]
    files = "/me/kura.py", "/me/mine.py", "/you/mine.py"
    controllers = [f"controller = {name}" for name in ("kura", *files[1:])]
    for axes, axis, labels in [
        ([{COUPLING: 0.1}], SPEED, []),
        (squares, PERIOD, ["L = 40 cm", "L = 60.5 cm"]),
        ([{"robots.0.controller": file} for file in files], SPEED, controllers),
        ([{"robots.1.parameters.speed_cm_s": n} for n in (1, 2)], SPEED, [f"V of robots.1 = {n} cm/s" for n in (1, 2)]),
    ]:
        assert [*named(axes_of([curve_of([3, 2], axes=row) for row in axes], axis))] == labels


def test_keys_have_the_thesis_s_symbols() -> None:
    for key, value, text in [
        ("space.side_cm", 100, "L = 100 cm"),
        ("space.dimensions", 2, "dimensions = 2"),
        ("neighbourhood.k", 1, "K = 1"),
        ("response.refractory", 0.1, "D = 0.1"),
        ("clocks.jitter", 0.01, "\N{GREEK SMALL LETTER SIGMA} = 0.01"),
        (PERIOD, 5, "τ = 5 s"),
        ("robots.0.parameters.delay_ms", 62, "Δ = 62 ms"),
        ("noise", "off", "noise = off"),
    ]:
        assert format_axis_values({key: value}) == text
    assert axis_label("neighbourhood.angle_deg") == "θ (°)"
    assert axis_label("robots.1.parameters.speed_cm_s") == "V of robots.1 (cm/s)"
    assert key_name("arena.width_cm", ["arena.obstacles.0.width_cm"]) == "L"  # a box has a width, and no L
    assert key_name("a.b.count", ["a.b.parameters.count"]) == "a.b.count"


def test_tables_have_the_numbers_of_the_curves_and_their_extrema_or_say_why_there_are_none() -> None:
    table = written(FORM.tables[".csv"])
    assert list(table[0]) == [COUPLING, SPEED, "trials", "censored", "statistic", "estimate", "low", "high"]
    expected = []
    for curve in CURVES:
        columns = curve.x, curve.trials, curve.censored, curve.names, curve.values, *curve.intervals.T
        expected += [in_csv(*curve.axes.values(), *row) for row in zip(*columns, strict=True)]
    assert [[*row.values()] for row in table] == expected
    found = written(FORM.tables["-regimes.csv"])
    names = [f"{name}{end}" for name in ("v_m", "t_m", "v_p", "t_p") for end in ("", "_low", "_high")]
    assert list(found[0]) == [COUPLING, *names, "p_value", "reason"]
    for row, curve, search in zip(found, CURVES, EXTREMA, strict=True):
        numbers = [end for place in search.places.values() for end in place.estimate.ends] or [math.nan] * 12
        assert [*row.values()] == in_csv(*curve.axes.values(), *numbers, search.p_value, "")
    (row,) = written(form_of([curve_of(BUMPY.values[:5])]).tables["-regimes.csv"])
    assert [*row.values()] == [*[""] * 13, "5 speeds above 0; a minimum and a peak need 6"]
    assert [*form_of([curve_of(BUMPY.values, x=np.arange(13) + 2)], COUNT).tables] == [".csv"]
    axes = {"noise": 'a "quoted", name', "arena.floor": {"picture": True}, "stop.max_time_s": None, COUNT: 10}
    for table in form_of([curve_of([3, 2], x=np.array([1.23456789, 2]), axes=axes)]).tables.values():
        row = written(table)[0]
        assert [*map(row.get, axes)] == ['a "quoted", name', '{"picture": true}', "", "10"]
        assert row.get(SPEED, "1.23456789") == "1.23456789"


def test_more_curves_than_can_be_drawn_are_refused(monkeypatch) -> None:
    points = in_memory(sweep({SPEED: [1, 2], COUNT: [2, 3, 4]}), lambda _: ended([5]))
    monkeypatch.setattr("epuck_sim.figures.forms.curves.MAX_CURVES", 2)
    with pytest.raises(EpuckSimError, match=r"would be 3 curves, .*allowed: up to 2"):
        read_form(points, {})
    assert len(read_form(points, {"x": COUNT}).curves) == 2


LONG = PointSeries(0, {SPEED: 1}, series_statistics([np.array([1.0, 2, 3, 5]) + k / 10 for k in range(6)]), "")
SHORT = PointSeries(1, {SPEED: 2}, series_statistics([np.arange(3.0)] * 3 + [np.arange(2.0)] * 3), "")


def test_a_series_is_the_mean_and_dashed_once_a_trial_has_ended_a_row_a_cycle_and_too_many_are_refused():
    figure = Series(of="mine", points=[LONG, SHORT]).draw_figure()
    (panel,) = figure.axes
    full, short, ended_before, _ = panel.get_lines()
    assert full.get_ydata().tolist() == pytest.approx([1.25, 2.25, 3.25, 5.25])
    assert full.get_xdata().tolist() == [1, 2, 3, 4]
    assert (short.get_linestyle(), short.get_xdata().tolist()) == ("-", [1, 2])
    assert (ended_before.get_linestyle(), ended_before.get_xdata().tolist()) == ("--", [2, 3])
    assert ended_before.get_marker() == short.get_marker() != full.get_marker()
    assert legend_texts(figure) == ["V = 1 cm/s", "V = 2 cm/s", "95 % interval", "some trials have ended"]
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("cycle", "mine")
    assert Series(of="mine", points=[LONG, SHORT]).shows.endswith("; 6 trials a point")
    assert Series(of="mine", points=[LONG._replace(is_timed=True)]).labels[0] == "cycle of 5 s"
    with pytest.raises(EpuckSimError, match=f"{MAX_LINES + 1} lines, one for each point; allowed: up to {MAX_LINES}"):
        Series(of="mine", points=[LONG] * (MAX_LINES + 1)).draw_figure()
    rows = written(Series(of="mine", points=[LONG, SHORT]).tables[".csv"])
    assert len(rows) == 7
    names = "cycle trials known mean low high median median_low median_high"
    assert [*rows[-1]] == [SPEED, *names.split()]
    assert [*rows[-1].values()] == ["2", "3", "3", "3", "2", "", "", "2", "", ""]


def measured(law, trials=5):
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
    none = {"measured": (None,) * 5}
    gaps = [point._replace(**none if point.axes == {SPEED: 2, COUNT: 4} else {}) for point in measured(law)]
    curves = read_curves(gaps, SPEED)
    figure = Curves(axis=SPEED, curves=curves, of=curves[0].of).draw_figure()
    assert "undetermined: no trial has a value" in legend_texts(figure)
    (panel,) = figure.axes
    (cross,) = [line for line in panel.get_lines() if line.get_marker() == "x" and len(line.get_xdata())]
    highest = max(np.nanmax(curve.values) for curve in curves)
    (_, at), *_ = panel.transAxes.inverted().transform(panel.transData.transform([(1, highest)]))
    assert cross.get_xdata().tolist() == [2]
    assert at < cross.get_ydata()[0] == 1
    maps = Maps(x=SPEED, y=COUNT, maps=read_maps(gaps, SPEED, COUNT), of="mine").draw_figure()
    assert "no trial has a value" in legend_texts(maps)
    violins = Violins(axis=SPEED, curves=read_violins(gaps, SPEED), of="mine").draw_figure()
    assert "undetermined: no trial has a value" in legend_texts(violins)


SETTINGS = ("agents.count=10", "trials=5", "stop.max_cycles=5000", "measures=[order_parameter]")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    asked = load_scenario("particles", SETTINGS, ["agents.speed_cm_s=0.1,1,30", "neighbourhood.k=1,5"])
    return made_folders.store(tmp_path_factory.mktemp("agents") / "run", asked, lambda point: weibull(point, 60))


@cache
def of_nearest(k: int, speed: float):
    return predict(load_scenario("particles", [*SETTINGS, f"neighbourhood.k={k}", f"agents.speed_cm_s={speed}"]))


@pytest.fixture(scope="module")
def form(folder) -> Curves:
    return read_form(folder, {"theory": True})


def test_lines_and_limits_are_those_of_predict(form) -> None:
    figure = laid_out(form.draw_figure())
    (panel,) = figure.axes
    for k, predicted in zip((1, 5), form.predicted, strict=True):
        drawn = [line for line in panel.lines if np.array_equal(line.get_ydata(), predicted.times, equal_nan=True)]
        assert [line.get_linestyle() for line in drawn] == ["--"]
        ends = [of_nearest(k, speed).t_sync.value for speed in (0.1, 30)]
        assert predicted.times[[0, -1]] == pytest.approx(ends, nan_ok=True)
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
    heights = {line.get_marker(): line.get_transform().transform(line.get_xydata())[1, 1] for line in drawn}
    top = panel.transAxes.transform((0, 1))[1]
    assert np.isnan(of_nearest(1, nearest.v_p_cm_s.value).t_sync.value)  # so it is on the upper edge, and seen
    assert heights["v"] < heights["^"] == top
    one, five = written(form.tables["-theory.csv"])
    assert [one["regime"], five["regime"], five["v_p"]] == ["yes", "no", ""]
    assert float(one["v_p_high"]) == pytest.approx(nearest.v_p_cm_s.high, rel=1e-5)
    assert "who hears whom" in form.caption
    assert "hollow triangles" in form.caption
    (still,) = predict_curves("agents.speed_cm_s", [form.curves[0]._replace(x=np.array([0.0]))])
    assert still.places == []


def test_a_scenario_asks_for_them_and_is_told_why_there_are_none_and_an_option_decides(folder) -> None:
    points = read_points(folder)
    asks = load_scenario("particles", [*SETTINGS, "figure.theory=true"])
    points = [point._replace(scenario=asks.model_copy(update={"agents": point.scenario.agents})) for point in points]
    asked = [(points, {}), (points, {"theory": False}), (folder, {})]
    assert [bool(read_form(*each).predicted) for each in asked] == [True, False, False]
    still = load_scenario("particles", [*SETTINGS, "figure.theory=true", "response.coupling=0"])
    points = [point._replace(scenario=still) for point in points]
    assert "response.coupling is 0" in read_form(points, {}).caption
    assert "but this is against neighbourhood.k" in read_form(points, {"x": "neighbourhood.k"}).caption
