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
from epuck_sim.figures import style
from epuck_sim.figures.forms.form import Choices, Form
from epuck_sim.figures.saving import tabulate
from epuck_sim.particles.twin import TwinComparison, simulate_with_twin
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import require_model
from epuck_sim.trial.model import simulate

MAX_MOMENTS = 400  # largest number of moments of a course; those of a longer one are farther and farther apart
MAX_CYCLES = 20_000  # largest number of cycles of a perturbation that are shown

MIN_DEVIATION, MAX_DEVIATION = 1e-4, 0.5
"""Ends of the colour scale, in cycles: smaller deviations have the colour of the first; none is above the second."""


class Course(NamedTuple):
    """Mean course of the trials at one point of a sweep."""

    axes: dict[str, Any]
    is_displaced: bool
    """Whether an agent was displaced at the beginning; otherwise deviations only show that clocks differ."""
    cycle: FloatArray  # (moments,) periods since the beginning
    order_parameter: FloatArray  # (moments,) mean of all trials
    deviation: FloatArray  # (moments,) deviation from the twin in cycles, mean of all agents and trials
    trials: int


@dataclass(kw_only=True)
class Courses(Form):
    """The mean order parameter over time and, if agents were displaced, the mean deviation from the twin below it.

    Deviations have a logarithmic scale, and gaps where nothing deviates (thesis Figs. 5.9, 5.11).
    """

    name = "course"
    shape = 0.5

    courses: Sequence[Course]

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        courses = []
        for point in (each for each in points if each.seeds):
            scenario = _scenario(point)
            cycle = choose_moments(_most_cycles(scenario))
            compared = [_compare(scenario, seed, cycle) for seed in point.seeds]
            order = np.mean([each.order_parameter for each in compared], axis=0)
            deviation = np.mean([each.deviation.mean(axis=1) for each in compared], axis=0)
            is_displaced = scenario.start.displacement > 0
            courses.append(Course(point.axes, is_displaced, cycle, order, deviation, len(compared)))
        return cls.made(points, choices, courses=courses)

    def __post_init__(self) -> None:
        self.titles = [""] * (1 + any(course.is_displaced for course in self.courses))
        self.labels = ["time (cycles)", "order parameter r", "mean |Δϕ| (cycles)"][: 1 + len(self.titles)]
        deviation = ", and deviation from an undisturbed twin," if len(self.titles) > 1 else ""
        trials = style.count_trials([course.trials for course in self.courses])
        self.shows = f"Order parameter{deviation} over time; means of {trials}"

    @property
    def tables(self) -> Mapping[str, str]:
        """A row for each moment of each course."""
        names = ("cycle", "order_parameter", "deviation")
        columns = ((each.axes, {name: getattr(each, name) for name in names}) for each in self.courses)
        return {".csv": tabulate(columns)}

    def draw(self, panels: Sequence[Axes]) -> None:
        labels = self.labels_of([course.axes for course in self.courses])
        is_long = any(course.cycle[-1] > MAX_MOMENTS for course in self.courses)
        for is_below, panel in enumerate(panels):
            each = zip(self.courses, labels, style.choose_looks(len(labels)), strict=True)
            for place, (course, label, look) in enumerate(each):
                deviation = np.where(course.deviation > 0, course.deviation, np.nan)
                values, named = (deviation, "_") if is_below else (course.order_parameter, style.typeset(label))
                style.draw_course(panel, course.cycle, values, place, look, named)
            style.make_logarithmic(panel, *["x"] * is_long, *["y"] * is_below)
        panels[0].set_ylim(-0.03, 1.03)


class Deviations(NamedTuple):
    """Deviations in one trial of a point of a sweep."""

    axes: dict[str, Any]
    cycle: FloatArray  # (moments,) periods since the beginning
    deviation: FloatArray  # (moments, agents) deviation from the twin, cycles


@dataclass(kw_only=True)
class Perturbation(Form):
    """How a perturbation spreads: the deviation of each agent over time, a row for each agent (thesis Fig. 5.8).

    There is a panel for the first trial of each point, white where nothing deviates.
    """

    name = "perturbation"

    shown: Sequence[Deviations]

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        tried = [(point, _scenario(point)) for point in points if point.seeds]
        if not any(scenario.start.displacement > 0 or scenario.clocks.jitter > 0 for _, scenario in tried):
            raise EpuckSimError(
                "nothing deviates from the undisturbed twin, because start.displacement and clocks.jitter are 0, so "
                "--form perturbation would be blank; --form course shows the order parameter"
            )
        shown = []
        for point, scenario in tried:
            cycle = np.arange(0.5, min(_most_cycles(scenario), MAX_CYCLES))
            shown.append(Deviations(point.axes, cycle, _compare(scenario, point.seeds[0], cycle).deviation))
        return cls.made(points, choices, shown=shown)

    def __post_init__(self) -> None:
        self.titles = self.labels_of([each.axes for each in self.shown])
        self.labels = "time (cycles)", "agent"
        self.shows = "Deviation of each agent from an undisturbed twin over time; the first trial of each point"

    @property
    def tables(self) -> Mapping[str, str]:
        """A row for each agent and moment with a deviation."""
        groups = []
        for each in self.shown:
            moment, agent = np.nonzero(each.deviation > 0)
            cells = {"cycle": each.cycle[moment], "agent": agent, "deviation": each.deviation[moment, agent]}
            groups.append((each.axes, cells))
        return {".csv": tabulate(groups)}

    def draw(self, panels: Sequence[Axes]) -> None:
        norm = LogNorm(MIN_DEVIATION, MAX_DEVIATION)
        for panel, each in zip(panels, self.shown, strict=True):
            moments, agents = each.deviation.shape
            places = np.arange(moments + 1), np.arange(agents + 1) - 0.5
            panel.yaxis.set_major_locator(MaxNLocator(integer=True))
            shown = np.ma.masked_equal(each.deviation.T, 0)
            mesh = panel.pcolormesh(*places, shown, norm=norm, cmap="viridis", rasterized=True)
        bar = style.add_colour_bar(panels, mesh, label="|Δϕ| (cycles)", extend="min")
        powers = [10.0**exponent for exponent in range(-4, 0)]
        bar.set_ticks(powers, labels=[style.format_tick(power, plain=False) for power in powers])


def choose_moments(cycles: int) -> FloatArray:
    """Choose moments, in periods, that lie in the middle of periods, when a synchronised swarm does not fire.

    >>> choose_moments(3).tolist()
    [0.5, 1.5, 2.5]
    """
    if cycles <= MAX_MOMENTS:
        return np.arange(0.5, cycles)
    return np.unique(np.geomspace(1, cycles, MAX_MOMENTS).astype(int)) - 0.5


def _scenario(point: PointTrials) -> ParticleScenario:
    return require_model(point.scenario, ParticleScenario, "the forms perturbation and course need model: particles")


def _most_cycles(scenario: ParticleScenario) -> int:
    limit, end_s = scenario.stop.max_cycles, scenario.stop.max_time_s
    return limit if end_s is None else max(1, min(limit, int(end_s / scenario.clocks.period_s + 1e-9)))


def _compare(scenario: ParticleScenario, seed: int, cycle: FloatArray) -> TwinComparison:
    started = simulate(scenario, seed).scenario  # agents may start like robots with this seed
    assert isinstance(started, ParticleScenario)
    return simulate_with_twin(started, seed, cycle * scenario.clocks.period_s)
