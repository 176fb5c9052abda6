"""Claims about courses and maps of perturbations: which trials they are of, and that figure and table hold them."""

import math
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import colormaps, image
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, to_hex
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.forms import twins
from epuck_sim.figures.forms.form import Choices
from epuck_sim.figures.forms.twins import (
    MAX_MOMENTS,
    MIN_DEVIATION,
    Course,
    Courses,
    Deviations,
    Perturbation,
    choose_moments,
)
from epuck_sim.figures.saving import Table
from epuck_sim.figures.style import choose_looks
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import FigureSection
from epuck_sim.scenario.points import points
from tests.figures.drawn import laid_out, legend_texts, written
from tests.runs.made_folders import SPEED as WHEELS
from tests.runs.made_folders import censored, ended, in_memory, six_digits, sweep

SPEED, COUPLING, REORIENT = "agents.speed_cm_s", "response.coupling", "agents.reorient_on"
DISPLACED = {"phases": "synchronised", "displacement": 0.01}


def particles(grid: dict, trials: int = 3, cycles: int = 12, **changes):
    """Return the scenario of a sweep of a few agents."""
    sections = {
        "agents": {"count": 5},
        "start": DISPLACED,
        "stop": {"order_parameter": None, "max_cycles": cycles},
        **changes,
    }
    return sweep(grid, trials=trials, name="course", model="particles", **sections)


def never(point):
    return censored(point, point.scenario.trials)


def read_courses(points) -> list[Course]:
    return list(Courses.read(points, Choices(FigureSection())).courses)


def draw_courses(courses: list[Course]) -> Figure:
    return Courses(courses=courses).draw_figure()


SCENARIO = particles({SPEED: [3, 30]})
READ = read_courses(in_memory(SCENARIO, never))


def course_of(order, deviation, cycle=None, is_displaced=True, **axes) -> Course:
    """Return a course that no trial had."""
    cycle = np.arange(0.5, len(order)) if cycle is None else np.array(cycle, float)
    return Course(axes, is_displaced, cycle, np.array(order, float), np.array(deviation, float), 3)


# Moments


@given(st.integers(1, MAX_MOMENTS))
def test_up_to_a_limit_there_is_a_moment_in_the_middle_of_every_period(cycles: int) -> None:
    assert choose_moments(cycles).tolist() == [number + 0.5 for number in range(cycles)]


@given(st.integers(MAX_MOMENTS + 1, 10**9))
def test_beyond_moments_are_fewer_in_the_middle_of_periods_from_the_first_to_the_last(cycles: int) -> None:
    moments = choose_moments(cycles)
    assert (moments[0], moments[-1]) == (0.5, cycles - 0.5)
    assert len(moments) <= MAX_MOMENTS
    assert (np.diff(moments) >= 1).all()
    assert (moments % 1 == 0.5).all()


# What is read


def test_a_course_is_the_mean_of_all_agents_and_of_all_trials_with_the_seeds_they_have_in_the_sweep() -> None:
    for read, point in zip(READ, points(SCENARIO), strict=True):
        assert read.axes == point.axes
        assert read.is_displaced
        cycle = np.arange(0.5, 12)
        assert read.cycle.tolist() == cycle.tolist()
        courses = [simulate_with_twin(point.scenario, point.seed(trial), cycle) for trial in range(3)]
        np.testing.assert_allclose(read.order_parameter, sum(each.order_parameter for each in courses) / 3, rtol=1e-14)
        deviation = sum(each.deviation.sum(axis=1) for each in courses) / 15
        np.testing.assert_allclose(read.deviation, deviation, rtol=1e-12)
    assert not np.array_equal(READ[0].deviation, READ[1].deviation)


def test_a_course_is_of_so_many_trials_as_have_a_result_and_there_is_none_without() -> None:
    some = {3: 1, 30: 0}
    (read,) = read_courses(in_memory(SCENARIO, lambda point: ended([12] * some[point.axes[SPEED]])))
    point = points(SCENARIO)[0]
    course = simulate_with_twin(point.scenario, point.seed(0), read.cycle)
    assert read.axes == {SPEED: 3}
    np.testing.assert_array_equal(read.order_parameter, course.order_parameter)


def test_a_course_is_of_the_trials_that_have_a_result_also_where_one_before_has_none() -> None:
    point = points(SCENARIO)[0]
    trials = in_memory(SCENARIO, lambda _: ended([12, 12]))[0]._replace(seeds=(point.seed(0), point.seed(2)))
    (read,) = read_courses([trials])
    courses = [simulate_with_twin(point.scenario, point.seed(trial), read.cycle) for trial in (0, 2)]
    expected = np.mean([course.order_parameter for course in courses], axis=0)
    np.testing.assert_allclose(read.order_parameter, expected, rtol=1e-14)


def test_moments_are_periods_whatever_their_length() -> None:
    slow = particles({SPEED: [0.75]}, clocks={"period_s": 4.0})
    (read,) = read_courses(in_memory(slow, never))
    (point,) = points(slow)
    assert read.cycle.tolist() == np.arange(0.5, 12).tolist()
    course = simulate_with_twin(point.scenario, point.seed(0), 4 * read.cycle)
    first = read_courses(in_memory(slow, lambda _: ended([12])))[0]
    np.testing.assert_array_equal(first.deviation, course.deviation.mean(axis=1))


@pytest.mark.parametrize(
    ("start", "is_displaced"),
    [(DISPLACED, True), ({"phases": "synchronised"}, False), ({"phases": "random"}, False)],
)
def test_a_course_tells_whether_an_agent_was_displaced(start: dict, is_displaced: bool) -> None:
    (read,) = read_courses(in_memory(particles({SPEED: [3]}, cycles=3, start=start), never))
    assert read.is_displaced is is_displaced


def test_a_sweep_without_displacement_and_jitter_deviates_nowhere() -> None:
    (read,) = read_courses(in_memory(particles({SPEED: [3]}, start={"phases": "random"}), never))
    assert not read.deviation.any()


def embodied() -> list[PointTrials]:
    return in_memory(sweep({WHEELS: [1, 2]}, trials=2, name="robots"), lambda _: ended([3, 4]))


def test_robots_with_bodies_have_no_course() -> None:
    with pytest.raises(EpuckSimError) as caught:
        read_courses(embodied())
    words = "robots: model is 'embodied'; the forms perturbation and course need model: particles"
    assert str(caught.value) == words


# What is drawn


def test_where_agents_are_displaced_the_deviation_is_below_the_order_parameter() -> None:
    above, below = draw_courses(READ).axes
    for number, read in enumerate(READ):
        for panel, values in ((above, read.order_parameter), (below, read.deviation)):
            line = panel.get_lines()[number]
            np.testing.assert_array_equal(line.get_xdata(), read.cycle)
            np.testing.assert_array_equal(line.get_ydata(), values)
    assert (above.get_ylabel(), below.get_ylabel()) == ("order parameter r", "mean |Δϕ| (cycles)")
    assert (above.get_xlabel(), below.get_xlabel()) == ("", "time (cycles)")
    assert (above.get_yscale(), below.get_yscale(), below.get_xscale()) == ("linear", "log", "linear")
    bottom, top = above.get_ylim()
    assert (bottom < 0, top > 1) == (True, True)


def test_where_none_is_displaced_there_is_one_panel() -> None:
    (panel,) = draw_courses([READ[0]._replace(is_displaced=False)]).axes
    assert len(panel.get_lines()) == 1
    assert (panel.get_ylabel(), panel.get_xlabel()) == ("order parameter r", "time (cycles)")
    assert panel.get_yscale() == "linear"


def test_each_course_has_a_colour_of_its_own_in_both_panels_and_its_values_in_the_legend() -> None:
    figure = draw_courses(READ)
    above, below = figure.axes
    for panel in (above, below):
        assert [(to_hex(line.get_color()), line.get_marker()) for line in panel.get_lines()] == choose_looks(2)
    assert legend_texts(figure) == ["V = 3 cm/s", "V = 30 cm/s"]
    assert Courses(courses=READ).shows.endswith("over time; means of 3 trials a point")


def test_where_nothing_deviates_the_line_has_a_gap() -> None:
    _, below = draw_courses([course_of([1, 1, 1], [0.01, 0, 0.1])]).axes
    np.testing.assert_array_equal(below.get_lines()[0].get_ydata(), [0.01, math.nan, 0.1])


def test_a_course_that_never_deviates_is_drawn_all_the_same() -> None:
    above, below = laid_out(draw_courses([course_of([1, 1, 1], [0, 0, 0])])).axes
    assert above.get_lines()[0].get_ydata().tolist() == [1, 1, 1]
    assert np.isnan(below.get_lines()[0].get_ydata()).all()


@pytest.mark.parametrize(("cycles", "scale"), [(MAX_MOMENTS, "linear"), (MAX_MOMENTS + 1, "log")])
@pytest.mark.parametrize("is_displaced", [True, False])
def test_time_is_logarithmic_in_all_panels_once_moments_are_farther_and_farther_apart(
    cycles: int, scale: str, is_displaced: bool
) -> None:
    moments = choose_moments(cycles)
    flat = np.full(len(moments), 0.5)
    figure = draw_courses([course_of(flat, flat, moments, is_displaced)])
    assert {panel.get_xscale() for panel in figure.axes} == {scale}


# What is written


def test_the_table_holds_every_moment_of_every_course(tmp_path) -> None:
    table = written(tmp_path, Courses(courses=READ).tables[".csv"])
    assert [*table[0]] == [SPEED, "cycle", "order_parameter", "deviation"]
    expected = [
        [str(read.axes[SPEED]), *map(six_digits, row)]
        for read in READ
        for row in zip(read.cycle, read.order_parameter, read.deviation, strict=True)
    ]
    assert [[*row.values()] for row in table] == expected
    assert len(expected) == 24


def test_a_point_whose_axis_holds_lists_and_null_is_labelled_in_words(tmp_path) -> None:
    grid = {REORIENT: [[], ["emitting"], ["emitting", "receiving"]]}
    read = read_courses(in_memory(particles(grid, trials=1, cycles=2), never))
    assert legend_texts(draw_courses(read)) == [
        "reorienting on = nothing",
        "reorienting on = emitting",
        "reorienting on = emitting and receiving",
    ]
    assert len(written(tmp_path, Courses(courses=read).tables[".csv"])) == 6


# Perturbations


def read_perturbations(points) -> list[Deviations]:
    return list(Perturbation.read(points, Choices(FigureSection())).shown)


def draw_perturbations(shown: list[Deviations]) -> Figure:
    return Perturbation(shown=shown).draw_figure()


def perturbations_table(shown: list[Deviations]) -> Table:
    return Perturbation(shown=shown).tables[".csv"]


THREE = particles({SPEED: [3, 30, 90]}, trials=2)
SHOWN = read_perturbations(in_memory(THREE, never))


def deviations_of(deviation, **axes) -> Deviations:
    """Return a perturbation, (moments, agents), that no trial had."""
    values = np.array(deviation, float)
    return Deviations(axes, np.arange(0.5, len(values)), values)


def test_what_is_read_is_trial_0_of_each_point_with_the_seed_it_has_in_the_sweep() -> None:
    for read, point in zip(SHOWN, points(THREE), strict=True):
        assert read.axes == point.axes
        assert read.cycle.tolist() == np.arange(0.5, 12).tolist()
        course = simulate_with_twin(point.scenario, point.seed(0), read.cycle)
        np.testing.assert_array_equal(read.deviation, course.deviation)
        assert read.deviation.shape == (12, 5)
        assert (read.deviation > 0).any()


def test_of_a_point_without_its_trial_0_the_first_is_read_that_has_a_result_and_of_one_without_any_none() -> None:
    trials = {3: 1, 30: 0, 90: 0}
    found = in_memory(THREE, lambda point: ended([12] * trials[point.axes[SPEED]]))
    point = points(THREE)[0]
    (read,) = read_perturbations([found[0]._replace(seeds=(point.seed(1),)), *found[1:]])
    assert read.axes == {SPEED: 3}
    np.testing.assert_array_equal(
        read.deviation, simulate_with_twin(point.scenario, point.seed(1), read.cycle).deviation
    )


def test_of_a_long_trial_the_beginning_is_shown(monkeypatch) -> None:
    monkeypatch.setattr(twins, "MAX_CYCLES", 7)
    for read, whole in zip(read_perturbations(in_memory(THREE, never)), SHOWN, strict=True):
        assert read.cycle.tolist() == np.arange(0.5, 7).tolist()
        np.testing.assert_array_equal(read.deviation, whole.deviation[:7])


@pytest.mark.parametrize("start", [{"phases": "random"}, {"phases": "synchronised"}])
def test_a_sweep_in_which_nothing_can_deviate_is_refused_and_not_drawn_blank(start: dict) -> None:
    with pytest.raises(EpuckSimError, match=r"nothing deviates .* would be blank; --form course shows"):
        read_perturbations(in_memory(particles({SPEED: [3]}, start=start), never))
    assert read_perturbations(in_memory(particles({SPEED: [3]}, start=start, clocks={"jitter": 0.01}), never))


def maps_of(given: list[Deviations]) -> list[Axes]:
    """Return the panels of a figure, laid out; the last of its axes is the colour bar."""
    return laid_out(draw_perturbations(given)).axes[:-1]


def painted(given: Deviations) -> list[list[str]]:
    """Return the colour of the page in the middle of each agent and moment, agents first."""
    figure = draw_perturbations([given])
    panel = figure.axes[0]
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(NullLocator())
    whole = BytesIO()
    figure.savefig(whole, dpi=150)
    whole.seek(0)
    figure.set_dpi(150)
    picture = image.imread(whole)[::-1]
    agents = range(given.deviation.shape[1])
    places = [[panel.transData.transform((x, agent)).astype(int) for x in given.cycle] for agent in agents]
    return [[to_hex(picture[row, column, :3]) for column, row in line] for line in places]


def test_there_is_a_map_for_each_point_titled_with_its_values() -> None:
    panels = maps_of(SHOWN)
    assert [panel.get_title() for panel in panels] == ["V = 3 cm/s", "V = 30 cm/s", "V = 90 cm/s"]
    assert (panels[0].get_xlabel(), panels[0].get_ylabel()) == ("time (cycles)", "agent")


def test_each_panel_holds_the_deviation_of_every_agent_at_every_moment_with_nothing_where_it_is_zero() -> None:
    for panel, read in zip(maps_of(SHOWN), SHOWN, strict=True):
        (mesh,) = panel.collections
        shown = mesh.get_array().reshape(5, 12)
        np.testing.assert_array_equal(np.ma.getmaskarray(shown), read.deviation.T == 0)
        np.testing.assert_array_equal(shown.filled(0), read.deviation.T)
        corners = mesh.get_coordinates()
        assert corners[0, :, 0].tolist() == list(range(13))
        assert corners[:, 0, 1].tolist() == [agent - 0.5 for agent in range(6)]


def test_all_panels_share_one_logarithmic_scale_up_to_half_a_cycle() -> None:
    norms = [panel.collections[0].norm for panel in maps_of(SHOWN)]
    for norm in norms:
        assert isinstance(norm, LogNorm)
        assert (norm.vmin, norm.vmax) == (MIN_DEVIATION, 0.5)
    figure = draw_perturbations(SHOWN)
    assert figure.axes[-1].get_ylabel() == "|Δϕ| (cycles)"


def test_on_the_page_zero_is_blank_and_anything_else_has_the_colour_of_its_size() -> None:
    def viridis(place: float) -> str:
        return to_hex(colormaps["viridis"](place))

    middle = float(np.sqrt(MIN_DEVIATION * 0.5))
    colours = painted(deviations_of([[0.5, 0, MIN_DEVIATION], [middle, MIN_DEVIATION / 1000, 0]]))
    assert colours == [[viridis(1.0), viridis(0.5)], ["#ffffff", viridis(0.0)], [viridis(0.0), "#ffffff"]]


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (5, 1)])
def test_the_smallest_trials_are_drawn_too(tmp_path, shape: tuple[int, int]) -> None:
    smallest = [deviations_of(np.full(shape, 0.1))]
    laid_out(draw_perturbations(smallest))
    assert len(written(tmp_path, perturbations_table(smallest))) == shape[0] * shape[1]


@pytest.mark.parametrize("shape", [(1, 4), (5, 1)])
def test_one_moment_or_one_agent_is_seen_too(shape: tuple[int, int]) -> None:
    colours = {colour for line in painted(deviations_of(np.full(shape, 0.5))) for colour in line}
    assert colours == {to_hex(colormaps["viridis"](1.0))}


def test_the_table_of_deviations_holds_every_one_that_is_not_zero(tmp_path) -> None:
    table = written(tmp_path, perturbations_table(SHOWN))
    assert [*table[0]] == [SPEED, "cycle", "agent", "deviation"]
    expected = [
        [str(read.axes[SPEED]), six_digits(cycle), str(agent), six_digits(read.deviation[moment, agent])]
        for read in SHOWN
        for moment, cycle in enumerate(read.cycle)
        for agent in range(5)
        if read.deviation[moment, agent] > 0
    ]
    assert [[*row.values()] for row in table] == expected
    assert 36 <= len(expected) < 180
