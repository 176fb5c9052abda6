"""What tests look at of single samples and curves, made of what the package has for many."""

import math

import numpy as np

from epuck_sim.statistics.statistic import Measured

LIMIT = 1000.0


def measured(values, observed=None, limit: float = math.inf, seed: int = 0) -> Measured:
    """Return values as they are measured; all of them observed by default."""
    values = np.array(values, float)
    return Measured(values, np.ones(len(values), bool) if observed is None else np.array(observed), limit, seed)


def times(values, limit: float = LIMIT) -> Measured:
    """Return T_sync of trials, those of the limit or more being censored there."""
    ended = np.array(values, float)
    return measured(np.minimum(ended, limit), ended < limit, limit)


def truths(true: int, trials: int) -> Measured:
    return measured(np.arange(trials) < true)._replace(is_share=True)


def lognormal(mean: float, trials: int, seed: int) -> Measured:
    return measured(mean * np.random.default_rng(seed).lognormal(-0.08, 0.4, trials))
