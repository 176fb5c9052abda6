"""Mean courses of synchrony over time, for which trials are simulated again (thesis Figs. 5.9, 5.11)."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.csv_tables import Table, rounded
from epuck_sim.figures.labels import distinguishing_labels
from epuck_sim.figures.style import disable_mathtext, make_logarithmic
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import require_model

MAX_MOMENTS = 400
"""Largest number of moments of a course; those of a longer one are farther and farther apart."""


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


def read_courses(points: Sequence[PointTrials]) -> list[Courses]:
    """Simulate the mean course of the trials of each point; raise ScenarioError for a model other than particles."""
    return [_simulate(point, require_particles(point)) for point in points if len(point.times)]


def require_particles(point: PointTrials) -> ParticleScenario:
    """Return the scenario of a point; raise ScenarioError for a model other than particles."""
    return require_model(point.scenario, ParticleScenario, "the forms perturbation and course need model: particles")


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


def draw_courses(title: str, courses: Sequence[Courses]) -> Figure:
    """Draw the order parameter and, if agents were displaced, the deviation from the twin below it."""
    has_two = any(each.is_displaced for each in courses)
    figure = Figure(figsize=(7, 6 if has_two else 4), layout="constrained")
    panels = figure.subplots(1 + has_two, 1, sharex=True, squeeze=False)[:, 0]
    above, below = panels[0], panels[-1]
    labels = distinguishing_labels([each.axes for each in courses])
    colours = colormaps["viridis"](np.linspace(0, 0.9, len(courses)))
    for each, label, colour in zip(courses, labels, colours, strict=True):
        above.plot(each.cycle, each.order_parameter, color=colour, label=label)
        if has_two:
            below.plot(each.cycle, np.where(each.deviation > 0, each.deviation, np.nan), color=colour)
    if any(each.cycle[-1] > MAX_MOMENTS for each in courses):
        make_logarithmic(below, "x")
    if has_two:
        make_logarithmic(below, "y")
        below.set_ylabel("mean |Δϕ| [cycles]")
    above.set(ylabel="order parameter r", ylim=(-0.03, 1.03))
    below.set_xlabel("time [cycles]")
    figure.suptitle(title, parse_math=False)
    if any(labels):
        disable_mathtext(above.legend(fontsize="small"))
    return figure
