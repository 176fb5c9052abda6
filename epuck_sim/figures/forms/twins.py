"""Agents beside their undisturbed twins over time, for which trials are simulated again (thesis Figs. 5.8 to 5.11)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import MaxNLocator

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.forms.form import Choices, Form
from epuck_sim.figures.saving import Table, tabulate
from epuck_sim.figures.style import (
    BAR,
    BAR_ASPECT,
    choose_looks,
    count_trials,
    draw_course,
    format_tick,
    make_logarithmic,
    typeset,
)
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import require_model

MAX_MOMENTS = 400
"""Largest number of moments of a course; those of a longer one are farther and farther apart."""

MAX_CYCLES = 20_000
"""Largest number of cycles of a perturbation that are shown."""

MIN_DEVIATION, MAX_DEVIATION = 1e-4, 0.5
"""Deviation in cycles whose colour smaller ones have, too, and the largest of two phases."""


class Course(NamedTuple):
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


@dataclass(kw_only=True)
class Courses(Form):
    """The mean order parameter over time and, if agents were displaced, the mean deviation from the twin below it.

    Deviations have a logarithmic scale, and gaps where nothing deviates (thesis Figs. 5.9, 5.11).
    """

    name = "course"
    shape = 0.5

    courses: Sequence[Course]
    """The courses, at least one."""

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        """Simulate the trials of each point again; raise ScenarioError for a model other than particles."""
        scenarios = map(_require_particles, points)
        courses = [_course(*each) for each in zip(points, scenarios, strict=True) if len(each[0].times)]
        return cls(courses=courses)

    @property
    def titles(self) -> Sequence[str]:
        return [""] * (1 + any(course.is_displaced for course in self.courses))

    @property
    def labels(self) -> Sequence[str]:
        return ["time (cycles)", "order parameter r", "mean |Δϕ| (cycles)"][: 1 + len(self.titles)]

    @property
    def shows(self) -> str:
        what = (
            "Order parameter" if len(self.titles) == 1 else "Order parameter, and deviation from an undisturbed twin,"
        )
        return f"{what} over time; means of {count_trials([course.trials for course in self.courses])}"

    @property
    def tables(self) -> Mapping[str, Table]:
        """A row for each moment of each course."""
        return {
            ".csv": tabulate(
                (each.axes, {"cycle": each.cycle, "order_parameter": each.order_parameter, "deviation": each.deviation})
                for each in self.courses
            )
        }

    def draw(self, panels: Sequence[Axes]) -> None:
        labels = [typeset(label) for label in self.labels_of([course.axes for course in self.courses])]
        deviations = [np.where(course.deviation > 0, course.deviation, np.nan) for course in self.courses]
        self._draw_lines(panels[0], [course.order_parameter for course in self.courses], labels)
        panels[0].set_ylim(-0.03, 1.03)
        for panel in panels[1:]:
            self._draw_lines(panel, deviations, ["_"] * len(labels))  # they are named above
            make_logarithmic(panel, "y")

    def _draw_lines(self, panel: Axes, values: Sequence[FloatArray], labels: Sequence[str]) -> None:
        for place, (course, look) in enumerate(zip(self.courses, choose_looks(len(self.courses)), strict=True)):
            draw_course(panel, course.cycle, values[place], place, look, labels[place])
        if any(course.cycle[-1] > MAX_MOMENTS for course in self.courses):
            make_logarithmic(panel, "x")


class Deviations(NamedTuple):
    """Deviations in one trial of a point of a sweep."""

    axes: dict[str, Any]
    cycle: FloatArray
    """(moments,) periods since the beginning."""
    deviation: FloatArray
    """(moments, agents) deviation from the twin, cycles."""


@dataclass(kw_only=True)
class Perturbation(Form):
    """How a perturbation spreads: the deviation of each agent over time, a row for each agent (thesis Fig. 5.8).

    There is a panel for the first trial of each point, white where nothing deviates.
    """

    name = "perturbation"

    shown: Sequence[Deviations]
    """The deviations of each panel, at least one."""

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        """Simulate the first trial of each point that has any.

        Raises:
            ScenarioError: The model is another than particles.
            EpuckSimError: Nothing can deviate.
        """
        scenarios = [_require_particles(point) for point in points]
        if not any(each.start.displacement > 0 or each.clocks.jitter > 0 for each in scenarios):
            raise EpuckSimError(
                "nothing deviates from the undisturbed twin, because start.displacement and clocks.jitter are 0, so "
                "that --form perturbation would be blank; --form course shows the order parameter"
            )
        shown = [_deviations(*each) for each in zip(points, scenarios, strict=True) if each[0].seeds]
        return cls(shown=shown)

    @property
    def titles(self) -> Sequence[str]:
        return self.labels_of([each.axes for each in self.shown])

    @property
    def labels(self) -> Sequence[str]:
        return "time (cycles)", "agent"

    @property
    def shows(self) -> str:
        return "Deviation of each agent from an undisturbed twin over time; the first trial of each point"

    @property
    def tables(self) -> Mapping[str, Table]:
        """A row for each agent and moment with a deviation."""
        places = [np.nonzero(each.deviation > 0) for each in self.shown]
        return {
            ".csv": tabulate(
                (each.axes, {"cycle": each.cycle[place[0]], "agent": place[1], "deviation": each.deviation[place]})
                for each, place in zip(self.shown, places, strict=True)
            )
        }

    def draw(self, panels: Sequence[Axes]) -> None:
        norm = LogNorm(MIN_DEVIATION, MAX_DEVIATION)
        for panel, each in zip(panels, self.shown, strict=True):
            moments, agents = each.deviation.shape
            places = np.arange(moments + 1), np.arange(agents + 1) - 0.5
            panel.yaxis.set_major_locator(MaxNLocator(integer=True))
            shown = np.ma.masked_equal(each.deviation.T, 0)
            panel.pcolormesh(*places, shown, norm=norm, cmap="viridis", rasterized=True)
        figure = panels[0].get_figure()
        assert figure is not None
        mesh, label = panels[0].collections[0], "|Δϕ| (cycles)"
        bar = figure.colorbar(mesh, ax=list(panels), label=label, extend="min", fraction=BAR, aspect=BAR_ASPECT)
        powers = [10.0**exponent for exponent in range(-4, 0)]
        bar.set_ticks(powers, labels=[format_tick(power, plain=False) for power in powers])


def choose_moments(cycles: int) -> FloatArray:
    """Choose moments, in periods, that lie in the middle of periods, when a synchronised swarm does not fire.

    >>> choose_moments(3).tolist()
    [0.5, 1.5, 2.5]
    """
    if cycles <= MAX_MOMENTS:
        return np.arange(0.5, cycles)
    return np.unique(np.geomspace(1, cycles, MAX_MOMENTS).astype(int)) - 0.5


def _require_particles(point: PointTrials) -> ParticleScenario:
    return require_model(point.scenario, ParticleScenario, "the forms perturbation and course need model: particles")


def _course(point: PointTrials, scenario: ParticleScenario) -> Course:
    cycle = choose_moments(scenario.stop.max_cycles)
    times = cycle * scenario.clocks.period_s
    comparisons = [simulate_with_twin(scenario, seed, times) for seed in point.seeds]
    return Course(
        point.axes,
        scenario.start.displacement > 0,
        cycle,
        np.mean([each.order_parameter for each in comparisons], axis=0),
        np.mean([each.deviation.mean(axis=1) for each in comparisons], axis=0),
        len(comparisons),
    )


def _deviations(point: PointTrials, scenario: ParticleScenario) -> Deviations:
    cycle = np.arange(0.5, min(scenario.stop.max_cycles, MAX_CYCLES))
    comparison = simulate_with_twin(scenario, point.seeds[0], cycle * scenario.clocks.period_s)
    return Deviations(point.axes, cycle, comparison.deviation)
