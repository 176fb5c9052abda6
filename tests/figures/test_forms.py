"""Claims about maps, violins, and courses and maps of perturbations: which trials they are of, and what values show."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, strategies as st
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, to_hex, to_rgb
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from epuck_sim import EpuckSimError, points
from epuck_sim.figures.forms.form import Choices
from epuck_sim.figures.forms.maps import COLOURS, GREY, MAX_LEVELS, Map, Maps, choose_levels, read_maps
from epuck_sim.figures.forms.twins import MAX_MOMENTS, MIN_DEVIATION, Course, Courses, Perturbation, choose_moments
from epuck_sim.figures.forms.violins import LINE, VIOLIN, Violins, density, read_violins
from epuck_sim.figures.style import choose_looks, count_trials
from epuck_sim.figures.sweep_figure import read_form
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import FigureSection, check_figure_axes
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.statistic import Measured, estimate_weibull_mean
from epuck_sim.trial.model import simulate
from tests.figures.drawn import in_csv, laid_out, legend_texts, written
from tests.runs.made_folders import COUNT, PIXELS, SPEED, SPEEDS, WIDTH, censored, ended, in_memory, sweep, weibull

WIDTHS = [40, 60, 80, 100]
PANELS = [16, 4, 8]

UNDETERMINED = {(2.0, 60, 4), (0.2, 40, 8)}
UNTRIED = {(1.0, 80, 4), (5.0, 100, 16)}


def place(point) -> tuple[float, float, int]:
    return point.axes[SPEED], point.axes[WIDTH], point.axes.get(PIXELS, 16)


def mean_at(speed: float, width: float, pixels: int = 16) -> float:
    """Return a mean that differs from point to point, from 10 to more than 1,000."""
    return round(1000 * width / 40 / pixels / speed)


def law(point):
    if place(point) in UNTRIED:
        return ended([])
    if place(point) in UNDETERMINED:
        return ended([5000] * 12, [False] * 12)
    return ended([mean_at(*place(point))] * 3)


def measured(grid: dict, law=law) -> list[PointTrials]:
    return in_memory(sweep(grid, trials=12), law)


MAPS = read_maps(measured({PIXELS: PANELS, WIDTH: WIDTHS, SPEED: SPEEDS}), SPEED, WIDTH)
LEVELS = choose_levels(np.concatenate([each.values.ravel() for each in MAPS]), is_log=True)


@pytest.fixture(scope="module")
def figure() -> Figure:
    """Return the three maps, laid out, which no test changes; the last of the Axes is the colour bar."""
    return laid_out(Maps(x=SPEED, y=WIDTH, maps=MAPS).draw_figure())


def panels_of(maps: list[Map]) -> list[Axes]:
    return Maps(x=SPEED, y=WIDTH, maps=maps).draw_figure().axes[:-1]


def contours(panel: Axes) -> list[QuadContourSet]:
    return [each for each in panel.collections if isinstance(each, QuadContourSet)]


def is_covered(panel: Axes, x: float, y: float) -> bool:
    """Return whether a contour covers a point, given as contours have it: log10 V and L."""
    (drawn,) = contours(panel)
    return any(path.contains_point([x, y], radius=1e-6) for path in drawn.get_paths() if len(path.vertices))


def test_every_point_is_in_its_place_in_the_map_of_its_other_axes_and_has_a_row_if_it_has_trials() -> None:
    shuffled = {SPEED: [2.0, 0.2, 5.0, 1.0, 0.5], WIDTH: [80, 40, 100, 60], PIXELS: PANELS}
    for maps in (MAPS, read_maps(measured(shuffled), SPEED, WIDTH)):
        assert [each.axes for each in maps] == [{PIXELS: n} for n in PANELS]
        for each in maps:
            for (row, width), (column, speed) in product(enumerate(WIDTHS), enumerate(SPEEDS)):
                where = (speed, width, each.axes[PIXELS])
                assert each.is_tried[row, column] == (where not in UNTRIED)
                expected = math.nan if where in UNTRIED | UNDETERMINED else mean_at(*where)
                np.testing.assert_equal(each.values[row, column], expected)
    table = written(Maps(x=SPEED, y=WIDTH, maps=MAPS).tables[".csv"])
    assert list(table[0]) == [PIXELS, WIDTH, SPEED, "trials", "censored", "statistic", "estimate", "low", "high"]
    expected = []
    for pixels, width, speed in product(PANELS, WIDTHS, SPEEDS):
        where = (speed, width, pixels)
        found = (12, 1, "restricted mean", "") if where in UNDETERMINED else (3, 0, "mean", mean_at(*where))
        if where not in UNTRIED:
            expected.append(in_csv(pixels, width, speed, *found, "", ""))
    assert [[*row.values()] for row in table] == expected


@pytest.mark.parametrize(("synchronised", "is_shown"), [(5, False), (6, True)])
@pytest.mark.parametrize("statistic", [Statistic.MEAN, Statistic.MEDIAN])
def test_a_point_has_a_value_just_if_fewer_than_half_of_its_trials_are_censored(synchronised, is_shown, statistic):
    times = [*range(50, 50 + synchronised), *[30_000] * (10 - synchronised)]
    made = measured({WIDTH: [40, 60], SPEED: [1, 2]}, lambda _: ended(times, [time < 30_000 for time in times]))
    (only,) = read_maps(made, SPEED, WIDTH, statistic)
    assert only.is_tried.all()
    assert np.isnan(only.values).any() != is_shown


def test_cells_hold_logarithms_and_undetermined_ones_are_hatched_without_a_contour_and_in_a_legend(figure) -> None:
    for panel, each in zip(figure.axes, MAPS, strict=False):
        cells, *others = panel.collections
        np.testing.assert_allclose(cells.get_array().filled(math.nan).reshape(4, 5), np.log10(each.values))
        for drawn in (cells, *contours(panel)):
            assert (drawn.norm.boundaries.tolist(), drawn.get_cmap()) == (LEVELS.tolist(), COLOURS)
        found = [other for other in others if other.get_hatch()]
        wanted = each.is_tried & np.isnan(each.values)
        assert len(found) == wanted.any()
        for hatched in found:
            np.testing.assert_array_equal(np.ma.getmaskarray(hatched.get_array()).reshape(4, 5), ~wanted)
            assert to_rgb(hatched.get_facecolor()[0]) == pytest.approx(to_rgb(GREY))
    for step in range(256):
        assert max(abs(np.subtract(to_rgb(COLOURS(step)), to_rgb(GREY)))) > 0.1
    assert legend_texts(figure) == ["half of the trials or more are censored"]
    assert legend_texts(Maps(x=SPEED, y=WIDTH, maps=MAPS[:1]).draw_figure()) == []
    for speed, width in ((2.0, 60), (1.0, 80)):
        assert not is_covered(figure.axes[1], math.log10(speed), width)
    assert is_covered(figure.axes[1], math.log10(0.5), 80)


def test_contours_need_three_values_on_both_axes_and_are_where_the_page_has_them_between_points() -> None:
    """Means are 100 V, so that the contour at 10 ^ 2.5 is at V = 10 ^ 0.5 and not halfway from 1 to 10."""
    made = measured({WIDTH: [40, 50, 60], SPEED: [0.1, 1, 10]}, lambda point: ended([100 * point.axes[SPEED]] * 3))
    (panel,) = panels_of(read_maps(made, SPEED, WIDTH))
    (drawn,) = contours(panel)
    edges = {round(float(x), 6) for path in drawn.get_paths() for x, _ in path.vertices}
    assert edges >= {round(level - 2, 6) for level in drawn.levels if 1 < level < 3}
    for widths, speeds, expected in (([40, 60, 400], [1, 2, 3], 1), ([40, 60], [1, 2, 3], 0), ([40, 60, 80], [1], 0)):
        (panel,) = panels_of(read_maps(measured({WIDTH: widths, SPEED: speeds}), SPEED, WIDTH))
        assert len(contours(panel)) == expected
        assert panel.get_yscale() == ("log" if 400 in widths else "linear")


def test_panels_share_scales_and_a_colour_bar_and_end_at_the_outermost_points_or_with_whole_cells(figure) -> None:
    *panels, bar = figure.axes
    assert [panel.get_title() for panel in panels] == [f"pixels = {n}" for n in PANELS]
    for panel in panels:
        assert (panel.get_xlim(), panel.get_ylim()) == ((0.2, 5.0), (40, 100))
        assert (panel.get_xscale(), panel.get_yscale()) == ("log", "linear")
    assert (bar.get_ylabel(), bar.get_ylim()) == (r"$T_\mathrm{sync}$ (cycles)", (LEVELS[0], LEVELS[-1]))
    assert bar.get_yticks().tolist() == [1, 2, 3]
    assert [label.get_text() for label in bar.get_yticklabels()] == ["10", "100", "1000"]
    made = measured({WIDTH: [40, 60], SPEED: [0.1, 1, 10]}, lambda _: ended([7]))
    (panel,) = panels_of(read_maps(made, SPEED, WIDTH))
    mesh = panel.collections[0].get_coordinates()
    np.testing.assert_allclose(mesh[0, :, 0], 10 ** np.array([-1.5, -0.5, 0.5, 1.5]))
    np.testing.assert_allclose(mesh[:, 0, 1], [30, 50, 70])
    np.testing.assert_allclose(panel.get_xlim(), 10 ** np.array([-1.5, 1.5]))
    assert panel.get_ylim() == (30, 70)


@pytest.mark.parametrize(("count", "width_cm", "shape"), [(1, None, (1, 1)), (3, 8.5, (2, 2)), (5, None, (2, 3))])
def test_panels_are_arranged_in_rows_that_the_width_has_room_for_with_numbers_below(count, width_cm, shape) -> None:
    (one,) = read_maps(measured({WIDTH: [40, 60], SPEED: [1, 2]}), SPEED, WIDTH)
    maps = [one._replace(axes={PIXELS: n}) for n in range(count)]
    figure = laid_out(Maps(x=SPEED, y=WIDTH, maps=maps, settings=FigureSection(width_cm=width_cm)).draw_figure())
    assert figure.get_size_inches()[0] * 2.54 == pytest.approx(width_cm or (8.5 if count == 1 else 17.5))
    *panels, _ = figure.axes
    corners = np.array([panel.get_position().get_points()[0].round(3) for panel in panels])
    assert (len({*corners[:, 1]}), len({*corners[:, 0]})) == shape
    assert np.lexsort((corners[:, 0], -corners[:, 1])).tolist() == [*range(count)]
    for number, panel in enumerate(panels):
        is_lowest = number + shape[1] >= count
        assert bool(panel.get_xlabel()) == panel.xaxis.get_tick_params()["labelbottom"] == is_lowest
        assert bool(panel.get_ylabel()) == (number % shape[1] == 0)


@given(st.lists(st.floats(1, 1e9), min_size=1, max_size=5), st.booleans(), st.sampled_from([1, -1]))
@example([1e-9, 1.1e-9], False, 1)
@example([0.0], False, 1)
@example([1e-300, 5.0], True, 1)
def test_levels_are_even_few_enough_and_enclose_all_values(values: list[float], is_log: bool, sign: int) -> None:
    given_values = np.array(values) if is_log else sign * np.array(values)
    levels = choose_levels(np.append(given_values, math.nan), is_log=is_log)
    steps, shown = np.diff(levels), np.log10(given_values) if is_log else given_values
    assert 1 <= len(steps) <= MAX_LEVELS + (not is_log)
    assert np.allclose(steps, steps[0])
    assert levels[0] <= shown.min() + 1e-8 * abs(shown.min()) + 1e-9 * is_log
    assert shown.max() < levels[-1] + 1e-9 * is_log


AGENT_SPEED = "agents.speed_cm_s"
DISPLACED = {"phases": "synchronised", "displacement": 0.01}


def particles(grid: dict, trials: int = 3, **changes):
    """Return the scenario of a sweep of a few agents for 12 cycles."""
    stop = {"order_parameter": None, "max_cycles": 12}
    sections = {"agents": {"count": 5}, "start": DISPLACED, "stop": stop, **changes}
    return sweep(grid, trials=trials, name="course", model="particles", **sections)


def never(point):
    return censored(point, point.scenario.trials)


def read_as(form, found):
    return form.read(found, Choices(FigureSection()))


TIMED = {"order_parameter": None, "max_time_s": 49.0}
SCENARIO = particles({AGENT_SPEED: [3, 30]}, clocks={"period_s": 4.0}, stop=TIMED)
READ = read_as(Courses, in_memory(SCENARIO, never))
SHOWN = read_as(Perturbation, in_memory(SCENARIO, never))


def course_of(order, deviation, cycle=None, is_displaced=True, **axes) -> Course:
    """Return a course that no trial had."""
    cycle = np.arange(0.5, len(order)) if cycle is None else np.array(cycle, float)
    return Course(axes, is_displaced, cycle, np.array(order, float), np.array(deviation, float), 3)


@given(st.integers(1, 2 * MAX_MOMENTS) | st.integers(MAX_MOMENTS + 1, 10**9))
def test_moments_are_in_the_middle_of_periods_all_or_a_limited_number_from_the_first_to_the_last(cycles: int) -> None:
    moments = choose_moments(cycles)
    assert (moments[0], moments[-1]) == (0.5, cycles - 0.5)
    assert len(moments) == cycles if cycles <= MAX_MOMENTS else len(moments) <= MAX_MOMENTS
    assert (np.diff(moments) >= 1).all()
    assert (moments % 1 == 0.5).all()


def test_a_course_is_the_mean_of_all_agents_and_trials_and_a_perturbation_the_first_trial() -> None:
    for course, shown, point in zip(READ.courses, SHOWN.shown, points(SCENARIO), strict=True):
        assert course.axes == shown.axes == point.axes
        assert course.is_displaced
        cycle = np.arange(0.5, 12)
        assert course.cycle.tolist() == shown.cycle.tolist() == cycle.tolist()
        trials = [simulate_with_twin(point.scenario, point.seed(trial), 4 * cycle) for trial in range(3)]
        np.testing.assert_allclose(course.order_parameter, sum(each.order_parameter for each in trials) / 3, rtol=1e-14)
        deviation = sum(each.deviation.sum(axis=1) for each in trials) / 15
        np.testing.assert_allclose(course.deviation, deviation, rtol=1e-12)
        np.testing.assert_array_equal(shown.deviation, trials[0].deviation)
        assert (shown.deviation > 0).any()


@pytest.mark.parametrize("form", [Courses, Perturbation])
def test_trials_are_those_that_have_a_result_and_points_without_are_left_out(form) -> None:
    first, second = in_memory(SCENARIO, lambda point: ended([12] * (point.axes[AGENT_SPEED] == 3)))
    point = points(SCENARIO)[0]
    form = read_as(form, [first._replace(seeds=(point.seed(1),)), second])
    (read,) = form.courses if isinstance(form, Courses) else form.shown
    trial = simulate_with_twin(point.scenario, point.seed(1), 4 * read.cycle)
    expected = trial.deviation.mean(axis=1) if isinstance(form, Courses) else trial.deviation
    assert read.axes == {AGENT_SPEED: 3}
    np.testing.assert_array_equal(read.deviation, expected)


def test_agents_that_start_like_robots_start_like_those_of_each_seed() -> None:
    given = {"agents": {"count": 10}, "space": {"side_cm": 60}, "start": {"like": "thesis"}}
    like = particles({AGENT_SPEED: [3]}, 1, **given)
    (course,), (point,) = read_as(Courses, in_memory(like, never)).courses, points(like)
    trial = simulate(point.scenario, point.seed(0))
    trial.run_to(0.5)
    assert course.order_parameter[0] == pytest.approx(abs(np.exp(2j * math.pi * trial.phases()).mean()))


def test_where_agents_are_displaced_the_deviation_is_below_the_order_parameter() -> None:
    figure = READ.draw_figure()
    above, below = figure.axes
    for number, read in enumerate(READ.courses):
        deviation = np.where(read.deviation > 0, read.deviation, math.nan)
        for panel, values in ((above, read.order_parameter), (below, deviation)):
            np.testing.assert_array_equal(panel.get_lines()[number].get_xydata(), np.column_stack([read.cycle, values]))
    assert (above.get_ylabel(), below.get_ylabel()) == ("order parameter r", "mean |Δϕ| (cycles)")
    assert (above.get_xlabel(), below.get_xlabel()) == ("", "time (cycles)")
    assert (above.get_yscale(), below.get_yscale(), below.get_xscale()) == ("linear", "log", "linear")
    bottom, top = above.get_ylim()
    assert bottom < 0
    assert top > 1
    for panel in (above, below):
        assert [(to_hex(line.get_color()), line.get_marker()) for line in panel.get_lines()] == choose_looks(2)
    assert legend_texts(figure) == ["V = 3 cm/s", "V = 30 cm/s"]
    assert READ.shows.endswith("over time; means of 3 trials a point")


def test_where_nothing_deviates_the_line_has_a_gap_or_a_map_is_refused_and_not_drawn_blank() -> None:
    courses = [course_of([1, 1, 1], [0, 0, 0], n=1), course_of([1, 1, 1], [0.01, 0, 0.1], n=2)]
    above, below = laid_out(Courses(courses=courses).draw_figure()).axes
    assert above.get_lines()[0].get_ydata().tolist() == [1, 1, 1]
    nowhere, somewhere = (line.get_ydata() for line in below.get_lines())
    assert np.isnan(nowhere).all()
    np.testing.assert_array_equal(somewhere, [0.01, math.nan, 0.1])
    start = {"phases": "synchronised"}
    with pytest.raises(EpuckSimError, match=r"nothing deviates .* would be blank; --form course shows"):
        read_as(Perturbation, in_memory(particles({AGENT_SPEED: [3]}, start=start), never))
    jittered = in_memory(particles({AGENT_SPEED: [3]}, start=start, clocks={"jitter": 0.01}), never)
    assert read_as(Perturbation, jittered).shown
    assert not read_as(Courses, jittered).courses[0].is_displaced


@pytest.mark.parametrize(("cycles", "scale"), [(MAX_MOMENTS, "linear"), (MAX_MOMENTS + 1, "log")])
@pytest.mark.parametrize("is_displaced", [True, False])
def test_time_is_logarithmic_in_all_panels_once_moments_are_farther_and_farther_apart(cycles, scale, is_displaced):
    moments = choose_moments(cycles)
    flat = np.full(len(moments), 0.5)
    figure = Courses(courses=[course_of(flat, flat, moments, is_displaced)]).draw_figure()
    assert [panel.get_xscale() for panel in figure.axes] == [scale] * (1 + is_displaced)


def test_each_panel_holds_the_deviation_of_every_agent_at_every_moment_with_nothing_where_it_is_zero() -> None:
    *panels, bar = laid_out(SHOWN.draw_figure()).axes
    assert [panel.get_title() for panel in panels] == ["V = 3 cm/s", "V = 30 cm/s"]
    assert (panels[0].get_xlabel(), panels[0].get_ylabel()) == ("time (cycles)", "agent")
    assert bar.get_ylabel() == "|Δϕ| (cycles)"
    for panel, read in zip(panels, SHOWN.shown, strict=True):
        (mesh,) = panel.collections
        assert isinstance(mesh.norm, LogNorm)
        assert (mesh.norm.vmin, mesh.norm.vmax) == (MIN_DEVIATION, 0.5)
        shown = mesh.get_array().reshape(5, 12)
        np.testing.assert_array_equal(np.ma.getmaskarray(shown), read.deviation.T == 0)
        np.testing.assert_array_equal(shown.filled(0), read.deviation.T)
        corners = mesh.get_coordinates()
        assert corners[0, :, 0].tolist() == list(range(13))
        assert corners[:, 0, 1].tolist() == [agent - 0.5 for agent in range(6)]


def test_tables_hold_every_moment_of_every_course_and_every_deviation_that_is_not_zero() -> None:
    table = written(READ.tables[".csv"])
    assert [*table[0]] == [AGENT_SPEED, "cycle", "order_parameter", "deviation"]
    assert [[*row.values()] for row in table] == [
        in_csv(read.axes[AGENT_SPEED], *row)
        for read in READ.courses
        for row in zip(read.cycle, read.order_parameter, read.deviation, strict=True)
    ]
    table = written(SHOWN.tables[".csv"])
    assert [*table[0]] == [AGENT_SPEED, "cycle", "agent", "deviation"]
    expected = []
    for read in SHOWN.shown:
        for moment, agent in np.argwhere(read.deviation > 0).tolist():
            row = read.cycle[moment], agent, read.deviation[moment, agent]
            expected.append(in_csv(read.axes[AGENT_SPEED], *row))
    assert [[*row.values()] for row in table] == expected


COUNTS = [7, 3, 5]
CENSORED_AT = 60


def violin_law(point):
    """Return trials around 100 cycles; of seven robots some are censored, and at two speeds all take one time."""
    speed, count = point.axes[SPEED], point.axes.get(COUNT, 5)
    if speed == 0.2:
        return ended([30] * 5)
    if speed == 0.5:
        return ended([800])
    drawn = weibull(point, 100)
    return ended(drawn.times, drawn.times < 200) if count == 7 else drawn


VIOLIN_POINTS = in_memory(sweep({COUNT: COUNTS, SPEED: SPEEDS}, trials=40), violin_law)
FORM = Violins(axis=SPEED, curves=read_violins(VIOLIN_POINTS, SPEED, CENSORED_AT), censored_at=CENSORED_AT)
OPEN = Violins(axis=SPEED, curves=read_violins(VIOLIN_POINTS, SPEED))


@pytest.fixture(scope="module")
def violin_panels() -> list[Axes]:
    """Return the panels of violins, laid out, which no test changes."""
    return laid_out(FORM.draw_figure()).axes


def violins(panel: Axes) -> list[np.ndarray]:
    """Return the corners of each violin, (n, 2)."""
    found = [each for each in panel.collections if to_hex(each.get_facecolor()[0]) == VIOLIN]
    return [each.get_paths()[0].vertices for each in found]


def lines(panel: Axes, label: str) -> list[Line2D]:
    return [line for line in panel.get_lines() if str(line.get_label()).startswith(label)]


@given(st.lists(st.integers(1, 10**7), min_size=1, max_size=30))
def test_a_density_spans_its_trials_and_is_1_where_it_is_widest(times: list[int]) -> None:
    heights, widths = density(np.array(times, float), of_logarithms=True)
    assert heights[[0, -1]] == pytest.approx([min(times), max(times)])
    assert (np.diff(heights) >= 0).all()
    assert widths.max() == 1
    assert widths.min() >= 0


def test_a_violin_is_as_wide_as_the_density_of_the_logarithms_of_the_trials_that_synchronised(violin_panels) -> None:
    points = iter(VIOLIN_POINTS)
    for panel, curve in zip(violin_panels, FORM.curves, strict=True):
        assert (panel.get_xscale(), panel.get_yscale()) == ("log", "log")
        for corners, x, point in zip(violins(panel), curve.x, points, strict=False):
            widths = np.abs(np.log10(corners[:, 0] / x)) / (0.4 * np.log10(2))  # the nearest two are that far apart
            heights, expected = density(point.times[point.observed], of_logarithms=True)
            shown = np.interp(np.log(corners[:, 1]), np.log(heights), expected)
            np.testing.assert_allclose(widths, shown * point.observed.mean(), atol=1e-6)
    assert next(points, None) is None
    # of a lognormal distribution it is a bell around the median, and not around the mean
    drawn = np.exp(5 + np.random.default_rng(1).standard_normal(20_000))
    heights, widths = density(drawn, of_logarithms=True)
    expected = np.exp(-((np.log(heights) - 5) ** 2) / 2 / (1 + 20_000**-0.4))
    np.testing.assert_allclose(widths, expected, atol=0.05)


def test_lines_bands_crosses_and_dots_are_the_estimates_and_the_means_of_all_trials(violin_panels) -> None:
    highest = max(point.times[point.observed].max() for point in VIOLIN_POINTS)
    for panel, curve in zip(violin_panels, FORM.curves, strict=True):
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
        assert {*crosses.get_ydata()} == {1}  # as a share of the panel
        assert highest < panel.get_ylim()[1] <= 3 * highest
        (dots,) = lines(panel, "mean, if no trial is censored")
        trials = zip(curve.censored, curve.measured, strict=True)
        expected = [np.nan if censored else each.values.mean() for censored, each in trials]
        np.testing.assert_array_equal(dots.get_ydata(), expected)
        (limit,) = lines(panel, r"$T_\mathrm{cens}$ of the Weibull mean: 60")
        assert (limit.get_linestyle(), *limit.get_ydata()) == ("--", CENSORED_AT, CENSORED_AT)


def test_titles_labels_the_legend_and_the_caption_name_what_there_is(violin_panels) -> None:
    assert [panel.get_title() for panel in violin_panels] == [f"N = {count}" for count in COUNTS]
    assert len({(panel.get_xlim(), panel.get_ylim()) for panel in violin_panels}) == 1
    assert (violin_panels[0].get_xlabel(), violin_panels[0].get_ylabel()) == ("V (cm/s)", r"$T_\mathrm{sync}$ (cycles)")
    always = ["trials that synchronised", "Weibull mean (Appendix A)", "95 % interval of the Weibull mean"]
    crosses, means = "undetermined: too many censored", "mean, if no trial is censored"
    limit = r"$T_\mathrm{cens}$ of the Weibull mean: 60"
    assert legend_texts(violin_panels[0].figure) == [*always, crosses, means, limit]
    assert not {crosses, limit} & {*legend_texts(OPEN.draw_figure())}
    censored = sum(int((~point.observed).sum()) for point in VIOLIN_POINTS)
    trials = sum(len(point.times) for point in VIOLIN_POINTS)
    numbers = count_trials([len(point.times) for point in VIOLIN_POINTS])
    what = "Distribution of T_sync (cycles) against V (cm/s), with Weibull means and their 95 % intervals"
    assert FORM.shows == f"{what}; {numbers}; {censored} of {trials} trials censored, not in the violins"
    assert Violins(axis=SPEED, curves=FORM.curves[1:]).shows == f"{what}; {numbers}"


def test_estimates_are_those_of_trials_clipped_at_the_censoring_if_there_is_one_also_in_the_csv() -> None:
    for form, limit in ((FORM, CENSORED_AT), (OPEN, math.inf)):
        assert [curve.axes for curve in form.curves] == [{COUNT: count} for count in COUNTS]
        points = iter(VIOLIN_POINTS)
        for curve in form.curves:
            for found, point in zip(np.column_stack([curve.values, curve.intervals]), points, strict=False):
                clipped = np.minimum(point.times, limit), point.observed & (point.times <= limit)
                np.testing.assert_equal(found, estimate_weibull_mean(Measured(*clipped, limit, point.seed)).ends)
    table = written(FORM.tables[".csv"])
    assert list(table[0]) == [COUNT, SPEED, "trials", "censored", "mean", "weibull_mean", "weibull_low", "weibull_high"]
    expected, estimates = [], np.concatenate([np.column_stack([c.values, c.intervals]) for c in FORM.curves])
    for point, ends in zip(VIOLIN_POINTS, estimates, strict=True):
        share = 1 - point.observed.mean()
        mean = math.nan if share else point.times.mean()
        expected.append(in_csv(point.axes[COUNT], point.axes[SPEED], len(point.times), share, mean, *ends))
    assert [[*row.values()] for row in table] == expected


def test_a_sweep_over_files_has_violins_by_their_names() -> None:
    key, files = "robots.0.controller", ["/me/once.py", "firefly"]
    made = in_memory(sweep({SPEED: [1, 2]}), lambda point: weibull(point, 100 + point.number))
    for others, options in (({}, {}), ({COUNT: 5}, {"form": "violins", "x": key})):
        points = [point._replace(axes={key: file, **others}) for point, file in zip(made, files, strict=True)]
        check_figure_axes(FigureSection(form="violins", x=key), [point.axes for point in points])  # it may be asked for
        form = read_form(points, options)
        assert isinstance(form, Violins)
        (panel,) = laid_out(form.draw_figure()).axes
        assert [label.get_text() for label in panel.get_xticklabels()] == ["once", "firefly"]
        assert [row[key] for row in written(form.tables[".csv"])] == ["once", "firefly"]
        (estimates,) = lines(panel, "Weibull mean (Appendix A)")
        assert estimates.get_linestyle() == "None"  # nothing lies between names
        assert all(to_hex(each.get_facecolor()[0]) == VIOLIN for each in panel.collections if each.get_facecolor().size)


@pytest.mark.parametrize("count", [2, 4])
def test_long_names_are_in_lines_or_aslant_so_that_none_covers_another(count: int) -> None:
    key, names = "robots.0.controller", [f"{letter}_reorienting_firefly" for letter in "abcd"[:count]]
    made = in_memory(sweep({SPEED: range(1, count + 1)}), lambda point: weibull(point, 100))
    points = [point._replace(axes={key: name}) for point, name in zip(made, names, strict=True)]
    (panel,) = laid_out(read_form(points, {}).draw_figure()).axes
    labels = panel.get_xticklabels()
    assert [label.get_text().replace("\n", "") for label in labels] == names
    assert {label.get_rotation() for label in labels} == {0 if count == 2 else 30}
    boxes = [label.get_window_extent() for label in labels]
    assert count == 4 or not boxes[0].overlaps(boxes[1])


def test_curves_over_names_are_points_with_bars_side_by_side_and_no_lines() -> None:
    key, files = "robots.0.controller", ["/me/once.py", "fire fly"]
    made = in_memory(sweep({COUNT: [3, 5], SPEED: [1, 2]}, 20), lambda point: weibull(point, 100 + point.number))
    points = [each._replace(axes={key: files[each.number % 2], COUNT: each.axes[COUNT]}) for each in made]
    check_figure_axes(FigureSection(x=key), [point.axes for point in points])
    form = read_form(points, {"x": key})
    (panel,) = laid_out(form.draw_figure()).axes
    assert [label.get_text() for label in panel.get_xticklabels()] == ["once", "fire fly"]
    drawn = [line for line in panel.get_lines() if line.get_marker() != "None" and len(line.get_xdata()) == 2]
    assert [line.get_xdata().tolist() for line in drawn] == [[-0.125, 0.875], [0.125, 1.125]]
    bars = [bar for each in panel.collections if isinstance(each, LineCollection) for bar in each.get_segments()]
    assert sorted(x for ((x, _), _) in bars) == [-0.125, 0.125, 0.875, 1.125]
    assert all(line.get_linestyle() == "None" for line in panel.get_lines())
    assert [row[key] for row in written(form.tables[".csv"])] == ["once", "fire fly"] * 2


def test_a_mean_that_is_extrapolated_beyond_all_trials_is_a_cross_on_the_upper_edge() -> None:
    law = {1: ended(range(50, 70)), 2: ended([20, 100, 290] + [300] * 27, [True] * 3 + [False] * 27)}
    made = in_memory(sweep({SPEED: [1, 2]}, stop={"max_cycles": 300}), lambda point: law[point.axes[SPEED]])
    form = read_form(made, {"form": "violins"})
    (panel,) = form.draw_figure().axes
    assert form.curves[0].values[1] > panel.get_ylim()[1] > 300
    beyond = f"above {3 * 290} or undetermined: too many censored"
    assert [line.get_xdata().tolist() for line in lines(panel, beyond)] == [[2]]
