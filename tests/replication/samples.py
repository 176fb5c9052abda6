"""What the tests of replications share: trials of a point, made up."""

import math
from collections.abc import Sequence

import numpy as np

from epuck_sim.statistics.measured import Measured

LIMIT = 1000.0


def uncensored(values: Sequence[float]) -> Measured:
    return Measured(np.array(values, float), np.ones(len(values), bool), math.inf, 1)


def times(values: Sequence[float], limit: float = LIMIT) -> Measured:
    """Return T_sync of trials, those of the limit or more being censored there."""
    ended = np.array(values, float)
    return Measured(np.minimum(ended, limit), ended < limit, limit, 1)


def truths(true: int, trials: int) -> Measured:
    return Measured(np.array([1.0] * true + [0.0] * (trials - true)), np.ones(trials, bool), math.inf, 1, is_share=True)


def drawn(mean: float, trials: int, seed: int) -> Measured:
    return uncensored(mean * np.random.default_rng(seed).lognormal(-0.08, 0.4, trials))
