"""How long the full version of a sweep would take, judged by the trials of its quick version."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.points import points
from epuck_sim.scenario.scenario import Scenario


class Cost(NamedTuple):
    """Computing time in s."""

    least: float
    """If trials that are censored in the quick version end just then in the full one."""
    most: float
    """If they take as long as the full one lets them."""


def estimate_cost(stored: Sequence[PointTrials], wall_s: float, full: Scenario) -> Cost:
    """Return what the full version of a sweep costs, if its trials are like those that are stored.

    Args:
        stored: The points of the quick version.
        wall_s: Time of all its trials.
        full: Scenario of the full version.
    """
    cycles = np.concatenate([point.times for point in stored])
    ended = np.concatenate([point.observed & point.has_t_sync for point in stored])
    if not len(cycles):
        return Cost(0.0, float("inf"))
    last = float(full.stop.max_cycles)
    # a trial without a T_sync goes on to the limit in any case
    goes_on = np.array([not point.has_t_sync for point in stored for _ in point.times])
    least, most = (np.where(still, last, cycles).mean() for still in (goes_on, ~ended))
    per_trial = wall_s / cycles.mean() / len(cycles) * len(points(full)) * full.trials
    return Cost(float(least * per_trial), float(most * per_trial))
