"""Mean courses of synchrony over time, for which trials are simulated again (thesis Figs. 5.9, 5.11)."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.csv_tables import Table, rounded
from epuck_sim.figures.forms.fitness import require_particles
from epuck_sim.figures.labels import distinguishing_labels
from epuck_sim.figures.looks import choose_looks, space_markers
from epuck_sim.figures.scales import make_logarithmic
from epuck_sim.figures.style import COLUMN_CM, STYLE, count_trials, finish, make_figure, typeset
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.particles import ParticleScenario

MAX_MOMENTS = 400
"""Largest number of moments of a course; those of a longer one are farther and farther apart."""

ORDER_LABELS, DEVIATION_LABELS = ("time [cycles]", "order parameter r"), ("time [cycles]", "mean |Δϕ| [cycles]")
"""Labels of the horizontal and of the vertical axis."""

PANEL_SHAPE = 0.5
"""Height of a panel over its width."""


class Courses(NamedTuple):
    """Mean course of the trials at one point of a sweep."""

    axes: dict[str, Any]
    is_displaced: bool
    """Whether an agent was displaced at the beginning; otherwise deviations only show that clocks differ."""
    cycle: FloatArray
    """(moments,) periods since the beginning."""
    order_parameter: FloatArray
    """(moments,) order parameter, mean of all trials."""
    deviation: FloatArray
    """(moments,) deviation from the twin in cycles, mean of all agents and trials."""
    trials: int
    """Number of trials."""


def read_courses(points: Sequence[PointTrials]) -> list[Courses]:
    """Simulate the mean course of the trials of each point; raise ScenarioError for a model other than particles."""
    return [_simulate(point, require_particles(point)) for point in points if len(point.times)]


def _simulate(point: PointTrials, scenario: ParticleScenario) -> Courses:
    cycle = choose_moments(scenario.stop.max_cycles)
    times = cycle * scenario.clocks.period_s
    comparisons = [simulate_with_twin(scenario, seed, times) for seed in point.seeds]
    return Courses(
        point.axes,
        scenario.start.displacement > 0,
        cycle,
        np.mean([each.order_parameter for each in comparisons], axis=0),
        np.mean([each.deviation.mean(axis=1) for each in comparisons], axis=0),
        len(comparisons),
    )


def choose_moments(cycles: int) -> FloatArray:
    """Choose moments, in periods, that lie in the middle of periods, when a synchronised swarm does not fire.

    >>> choose_moments(3).tolist()
    [0.5, 1.5, 2.5]
    """
    if cycles <= MAX_MOMENTS:
        return np.arange(0.5, cycles)
    return np.unique(np.geomspace(1, cycles, MAX_MOMENTS).astype(int)) - 0.5


def courses_table(courses: Sequence[Courses]) -> Table:
    """Return a table with a row for each moment of each course."""
    return Table((*courses[0].axes, "cycle", "order_parameter", "deviation"), _course_rows(courses))


def _course_rows(courses: Sequence[Courses]) -> Iterator[list[Any]]:
    for each in courses:
        for row in zip(each.cycle, each.order_parameter, each.deviation, strict=True):
            yield [*each.axes.values(), *map(rounded, row)]


@rc_context(STYLE)
def draw_courses(title: str, courses: Sequence[Courses], width_cm: float | None = None) -> Figure:
    """Draw the order parameter and, if agents were displaced, the deviation from the twin below it.

    Args:
        title: Title of the figure, to which the numbers of trials are added.
        courses: The courses, at least one.
        width_cm: Width of the figure; by default that of a column.
    """
    has_two = any(each.is_displaced for each in courses)
    figure = make_figure(f"{title}\nmeans of {count_trials([each.trials for each in courses])}", width_cm or COLUMN_CM)
    panels = figure.subplots(1 + has_two, 1, sharex=True, squeeze=False)[:, 0].tolist()
    plot_order_parameters(panels[0], courses)
    panels[0].set_ylabel(ORDER_LABELS[1])
    panels[-1].set_xlabel(ORDER_LABELS[0])
    if has_two:
        plot_deviations(panels[1], courses)
        panels[1].set_ylabel(DEVIATION_LABELS[1])
        for line in panels[1].get_lines():
            line.set_label("_")  # is named above
    finish(figure, panels, PANEL_SHAPE)
    return figure


def plot_order_parameters(axes: Axes, courses: Sequence[Courses]) -> None:
    """Draw the mean order parameter of the trials of each course over time."""
    _plot(axes, courses, [each.order_parameter for each in courses])
    axes.set_ylim(-0.03, 1.03)


def plot_deviations(axes: Axes, courses: Sequence[Courses]) -> None:
    """Draw the mean deviation from the twin over time, on a logarithmic scale, with gaps where nothing deviates."""
    _plot(axes, courses, [np.where(each.deviation > 0, each.deviation, np.nan) for each in courses])
    make_logarithmic(axes, "y")


def _plot(axes: Axes, courses: Sequence[Courses], values: Sequence[FloatArray]) -> None:
    labels = distinguishing_labels([each.axes for each in courses])
    for place, (each, look) in enumerate(zip(courses, choose_looks(len(courses)), strict=True)):
        axes.plot(
            each.cycle,
            values[place],
            color=look.colour,
            marker=look.marker,
            markevery=space_markers(values[place], place),
            label=typeset(labels[place]) or None,
        )
    if any(each.cycle[-1] > MAX_MOMENTS for each in courses):
        make_logarithmic(axes, "x")
