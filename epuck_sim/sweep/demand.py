"""Demands of a sweep, before it is run: valid points, memory, disk and time."""

import math
import random
import time
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.axes import SIMULATED_AGAIN, check_figure_axes, check_labels
from epuck_sim.scenario.base import refused_at
from epuck_sim.scenario.loader import Point, describe_axes
from epuck_sim.trial.model import MODELS, run_trial, simulate
from epuck_sim.trial.result import TrialState
from epuck_sim.util.machine import NEGLIGIBLE_BYTES, available_bytes, in_bytes, lack_of_memory
from epuck_sim.util.messages import counted

ENOUGH_TIMED = 20  # number of trials to time, over all points, if time allows

TRIAL_BYTES = 145
"""Size of a trial in a run folder, without measures; as measured with 10,000 to 1,000,000 trials (docs/speed.md)."""


def check_sweep(points: Sequence[Point]) -> None:
    """Raise ScenarioError for a sweep that cannot be run, or cannot be drawn as its section `figure` says."""
    scenario, form = points[0].scenario, points[0].scenario.figure.form
    with refused_at(scenario.name):
        if form in SIMULATED_AGAIN and scenario.model != "particles":
            raise ScenarioError(f"figure.form is {form!r}, which needs model: particles; allowed: another form")
        check_figure_axes(scenario.figure, [point.axes for point in points])
        check_labels(scenario.figure.labels, points[0].axes, (each.name for each in scenario.measures), "figure.labels")
    for point in points:
        try:
            MODELS[point.scenario.model].check_room(point.scenario)
        except ScenarioError as error:
            name = f"{point.scenario.name}: "
            where = f"sweep: point {point.number} ({describe_axes(point.axes)}): " if point.axes else ""
            raise ScenarioError(f"{name}{where}{str(error).removeprefix(name)}") from error


def check_memory(points: Iterable[Point], workers: int) -> None:
    """Raise ScenarioError for a sweep whose trials need more memory on this machine than there is."""
    largest = max(point.scenario.memory_bytes for point in points)
    if lack := lack_of_memory(workers * largest):
        advice = f"give --workers {max(1, available_bytes() // largest)}, or smaller swarms"
        raise ScenarioError(f"a trial on each of {workers} workers {lack}; {in_bytes(largest)} each: {advice}")


def describe_size(points: Sequence[Point]) -> str:
    """Return how many points and trials a sweep has, how much disk it takes, and how much memory if that is much."""
    count = sum(point.scenario.trials for point in points)
    measures = ", besides its measures" if points[0].scenario.measures else ""
    memory = max(point.scenario.memory_bytes for point in points)
    needed = f"; up to {in_bytes(memory)} of memory for a trial" if memory > NEGLIGIBLE_BYTES else ""
    words = f"{counted(len(points), 'point')}, {counted(count, 'trial')}"
    return f"{words}: about {in_bytes(TRIAL_BYTES * count)} on disk{measures}{needed}"


class TimedTrial(NamedTuple):
    """A trial that was timed."""

    point: int
    wall_s: float
    is_cut: bool  # whether time was up before the trial ended: it takes longer than this
    is_censored: bool = False  # whether it reached its limit without synchrony


def time_trials(points: Sequence[Point], budget_s: float) -> list[TimedTrial]:
    """Time a trial of each point, and more until there are `ENOUGH_TIMED`, for as long as there is time.

    Points come in random order, so that the mean stands for all. Compilation and the making of simulations are not
    counted, as workers keep their simulations. The last trial may be cut.
    """
    order = random.Random(0).sample(range(len(points)), len(points))
    _time_trial(points[order[0]], 0, 0)
    timed: list[TimedTrial] = []
    end = time.perf_counter() + budget_s
    for trial in range(math.ceil(ENOUGH_TIMED / len(points))):
        for place in order:
            left = end - time.perf_counter()
            if left <= 0 or (trial and len(timed) >= ENOUGH_TIMED):
                return timed
            timed.append(_time_trial(points[place], trial, left))
    return timed


def _time_trial(point: Point, trial: int, budget_s: float) -> TimedTrial:
    simulation, begin = simulate(point.scenario, point.seed(trial)), time.perf_counter()

    def look_at_clock(_: TrialState) -> None:
        if time.perf_counter() - begin > budget_s:
            raise TimeoutError

    is_cut = is_censored = False
    try:
        is_censored = run_trial(simulation, progress=look_at_clock).censored is True
    except TimeoutError:
        is_cut = True
    except Exception as error:
        raise ScenarioError(f"point {point.number}: a trial fails: {error!r}") from error
    return TimedTrial(point.number, time.perf_counter() - begin, is_cut, is_censored)
