"""What becomes of synchrony over time: the mean course of trials, simulated again (thesis Figs. 5.9, 5.11)."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.csv_tables import rounded, save_table
from epuck_sim.figures.labels import format_axis_values
from epuck_sim.figures.style import disable_mathtext, make_logarithmic, output_paths, save_drawing
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.statistics.curves import distinguishing_axes

MOST_MOMENTS = 400
"""Of a course; of a longer one they are farther and farther apart."""


class Courses(NamedTuple):
    """What happened at one point of a sweep."""

    axes: dict[str, Any]
    is_displaced: bool
    """Whether an agent was displaced at the beginning; else deviations tell no more than that clocks differ."""
    cycle: FloatArray
    """(moments,) periods since the beginning."""
    order_parameter: FloatArray
    """(moments,) mean of all trials."""
    deviation: FloatArray
    """(moments,) mean of all agents and trials, in cycles."""


def read_courses(points: Sequence[PointTrials]) -> list[Courses]:
    """Return the mean course of each point's trials; raises EpuckSimError for another model than particles."""
    return [_courses(point, particles_of(point)) for point in points if len(point.times)]


def _courses(point: PointTrials, scenario: ParticleScenario) -> Courses:
    cycle = choose_moments(scenario.stop.max_cycles)
    times = cycle * scenario.clocks.period_s
    found = [simulate_with_twin(scenario, seed, times) for seed in point.seeds]
    return Courses(
        point.axes,
        scenario.start.displacement > 0,
        cycle,
        np.mean([course.order_parameter for course in found], axis=0),
        np.mean([course.deviation.mean(axis=1) for course in found], axis=0),
    )


def choose_moments(cycles: int) -> FloatArray:
    """Return moments, in periods, in the middle of a period, when a synchronised swarm does not fire.

    >>> choose_moments(3).tolist()
    [0.5, 1.5, 2.5]
    """
    if cycles <= MOST_MOMENTS:
        return np.arange(0.5, cycles)
    return np.unique(np.geomspace(1, cycles, MOST_MOMENTS).astype(int)) - 0.5


def particles_of(point: PointTrials) -> ParticleScenario:
    """Return the scenario of a point; raises EpuckSimError for another model than particles."""
    scenario = point.scenario
    if not isinstance(scenario, ParticleScenario):
        raise EpuckSimError(
            f"{scenario.name}: the forms perturbation and course are for model: particles; this is {scenario.model}"
        )
    return scenario


def save_courses(stem: Path, title: str, courses: Sequence[Courses]) -> list[Path]:
    """Write the courses as STEM.png, STEM.svg and STEM.csv, and return the files."""
    files = output_paths(stem, ".png", ".svg", ".csv")
    save_drawing(draw_courses(title, courses), *files[:2])
    columns = (*courses[0].axes, "cycle", "order_parameter", "deviation")
    save_table(files[2], columns, _course_rows(courses))
    return files


def _course_rows(courses: Sequence[Courses]) -> Iterator[list[Any]]:
    for each in courses:
        for row in zip(each.cycle, each.order_parameter, each.deviation, strict=True):
            yield [*each.axes.values(), *map(rounded, row)]


def draw_courses(title: str, courses: Sequence[Courses]) -> Figure:
    """Return the figure: the order parameter and, below, if agents were displaced, the deviation from the twin."""
    has_two = any(each.is_displaced for each in courses)
    figure = Figure(figsize=(7, 6 if has_two else 4), layout="constrained")
    panels = figure.subplots(1 + has_two, 1, sharex=True, squeeze=False)[:, 0]
    above, below = panels[0], panels[-1]
    labels = [format_axis_values(each) for each in distinguishing_axes([each.axes for each in courses])]
    colours = colormaps["viridis"](np.linspace(0, 0.9, len(courses)))
    for each, label, colour in zip(courses, labels, colours, strict=True):
        above.plot(each.cycle, each.order_parameter, color=colour, label=label)
        if has_two:
            below.plot(each.cycle, np.where(each.deviation > 0, each.deviation, np.nan), color=colour)
    if any(each.cycle[-1] > MOST_MOMENTS for each in courses):
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
