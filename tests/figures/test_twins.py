"""Claims about courses and maps of perturbations: which trials they are of, and that figure and table hold them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import LogNorm, to_hex

from epuck_sim import EpuckSimError, points
from epuck_sim.figures.forms.form import Choices
from epuck_sim.figures.forms.twins import MAX_MOMENTS, MIN_DEVIATION, Course, Courses, Perturbation, choose_moments
from epuck_sim.figures.style import choose_looks
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.scenario.axes import FigureSection
from tests.figures.drawn import in_csv, laid_out, legend_texts, written
from tests.runs.made_folders import censored, ended, in_memory, sweep

SPEED = "agents.speed_cm_s"
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


SCENARIO = particles({SPEED: [3, 30]}, clocks={"period_s": 4.0})
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
    first, second = in_memory(SCENARIO, lambda point: ended([12] * (point.axes[SPEED] == 3)))
    point = points(SCENARIO)[0]
    form = read_as(form, [first._replace(seeds=(point.seed(1),)), second])
    (read,) = form.courses if isinstance(form, Courses) else form.shown
    trial = simulate_with_twin(point.scenario, point.seed(1), 4 * read.cycle)
    expected = trial.deviation.mean(axis=1) if isinstance(form, Courses) else trial.deviation
    assert read.axes == {SPEED: 3}
    np.testing.assert_array_equal(read.deviation, expected)


def test_a_sweep_in_which_nothing_can_deviate_is_refused_and_not_drawn_blank() -> None:
    start = {"phases": "synchronised"}
    with pytest.raises(EpuckSimError, match=r"nothing deviates .* would be blank; --form course shows"):
        read_as(Perturbation, in_memory(particles({SPEED: [3]}, start=start), never))
    jittered = in_memory(particles({SPEED: [3]}, start=start, clocks={"jitter": 0.01}), never)
    assert read_as(Perturbation, jittered).shown
    assert not read_as(Courses, jittered).courses[0].is_displaced


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


def test_where_nothing_deviates_the_line_has_a_gap() -> None:
    courses = [course_of([1, 1, 1], [0, 0, 0], n=1), course_of([1, 1, 1], [0.01, 0, 0.1], n=2)]
    above, below = laid_out(Courses(courses=courses).draw_figure()).axes
    assert above.get_lines()[0].get_ydata().tolist() == [1, 1, 1]
    nowhere, somewhere = (line.get_ydata() for line in below.get_lines())
    assert np.isnan(nowhere).all()
    np.testing.assert_array_equal(somewhere, [0.01, math.nan, 0.1])


@pytest.mark.parametrize(("cycles", "scale"), [(MAX_MOMENTS, "linear"), (MAX_MOMENTS + 1, "log")])
@pytest.mark.parametrize("is_displaced", [True, False])
def test_time_is_logarithmic_in_all_panels_once_moments_are_farther_and_farther_apart(
    cycles: int, scale: str, is_displaced: bool
) -> None:
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
    assert [*table[0]] == [SPEED, "cycle", "order_parameter", "deviation"]
    assert [[*row.values()] for row in table] == [
        in_csv(read.axes[SPEED], *row)
        for read in READ.courses
        for row in zip(read.cycle, read.order_parameter, read.deviation, strict=True)
    ]
    table = written(SHOWN.tables[".csv"])
    assert [*table[0]] == [SPEED, "cycle", "agent", "deviation"]
    assert [[*row.values()] for row in table] == [
        in_csv(read.axes[SPEED], cycle, agent, read.deviation[moment, agent])
        for read in SHOWN.shown
        for moment, cycle in enumerate(read.cycle)
        for agent in range(5)
        if read.deviation[moment, agent] > 0
    ]
