"""Runs some trials of a sweep beforehand, to measure how long they take."""

import random
import time
from collections.abc import Sequence
from typing import NamedTuple

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.points import Point
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.trial.result import TrialState


class TimedTrial(NamedTuple):
    """A trial that was timed."""

    point: int
    wall_s: float
    is_cut: bool
    """Whether time was up before the trial ended: it takes longer than this."""
    is_censored: bool = False
    """Whether it reached its limit without synchrony."""


class _TimeIsUpError(Exception):
    """Ends a trial."""


def time_trials(points: Sequence[Point], budget_s: float) -> list[TimedTrial]:
    """Time the first trial of as many points as there is time for, in random order; compilation is not counted.

    Points are drawn with equal chances, so that the mean is that of all points. The last trial may be cut.
    """
    order = random.Random(0).sample(range(len(points)), len(points))
    _time_trial(points[order[0]], 0)
    timed: list[TimedTrial] = []
    end = time.perf_counter() + budget_s
    for place in order:
        left = end - time.perf_counter()
        if left <= 0:
            break
        timed.append(_time_trial(points[place], left))
    return timed


def _time_trial(point: Point, budget_s: float) -> TimedTrial:
    begin = time.perf_counter()

    def look_at_clock(_: TrialState) -> None:
        if time.perf_counter() - begin > budget_s:
            raise _TimeIsUpError

    is_cut = is_censored = False
    try:
        result = run_trial(simulate(point.scenario, point.seed(0)), progress=look_at_clock)
        is_censored = result.censored is True
    except _TimeIsUpError:
        is_cut = True
    except Exception as error:
        raise ScenarioError(f"point {point.number}: a trial fails: {error!r}") from error
    return TimedTrial(point.number, time.perf_counter() - begin, is_cut, is_censored)
