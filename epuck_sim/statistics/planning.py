"""How many trials each point of a sweep needs, from those that are stored."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.measured import Measured, measure_t_sync
from epuck_sim.statistics.names import Statistic, statistic_name
from epuck_sim.statistics.power import relative_spread, trials_needed
from epuck_sim.statistics.statistic import estimate


class PointPlan(NamedTuple):
    """What one point needs."""

    point: int
    axes: dict[str, Any]
    stored: int
    """Number of trials that have a result."""
    statistic: str
    """What the mean is: mean, or restricted mean."""
    mean: float
    """Cycles; NaN where it is undetermined."""
    spread: float
    """Standard deviation of a trial over the mean; NaN with too few trials."""
    trials: int | None
    """Trials of each of two sweeps that show the difference; None where the spread is unknown."""


class TrialPlan(NamedTuple):
    """What a sweep needs for a difference to be seen."""

    difference: float
    """Relative to the smaller mean."""
    power: float
    """Probability with which it is seen."""
    points: list[PointPlan]
    over_all: int | None
    """Trials a point that show it over all points together, if all differ alike; None where no spread is known."""


def plan_trials(points: Sequence[PointTrials], difference: float, power: float) -> TrialPlan:
    """Return how many trials show a difference, relative to the smaller mean, with this probability."""
    planned = [_plan_point(point, measure_t_sync(point), difference, power) for point in points]
    spreads = [each.spread for each in planned if each.trials is not None]
    over_all = trials_needed(spreads, difference, power) if spreads else None
    return TrialPlan(difference, power, planned, over_all)


def _plan_point(point: PointTrials, measured: Measured, difference: float, power: float) -> PointPlan:
    if not len(point.times):
        return PointPlan(point.number, point.axes, 0, "mean", np.nan, np.nan, None)
    name = statistic_name(Statistic.MEAN, measured.censored > 0)
    spread = relative_spread(measured)
    trials = None if np.isnan(spread) else trials_needed([spread], difference, power)
    mean = estimate(measured, Statistic.MEAN).value
    return PointPlan(point.number, point.axes, len(point.times), name, mean, spread, trials)
