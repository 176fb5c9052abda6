"""Distributions of the agents' speeds and of the oscillators' periods (thesis 5.4.2, 6.2)."""

import math
from statistics import NormalDist

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.scenario.agents import AgentsSection

TABLE_SIZE = 1000
"""Number of speeds, all equally likely, that stand for a distribution where speeds are drawn again and again: that of
the fastest of them bounds the motion of all agents, and neighbours are cached by that bound."""


def draw_speeds(agents: AgentsSection, random: np.random.Generator) -> FloatArray:
    """Return (agents,) cm/s: the speed of each agent at the start."""
    spread = agents.speed_spread or 0.0
    if agents.speed_distribution == "uniform":
        shares = random.uniform(1 - spread, 1 + spread, agents.count)
    elif agents.speed_distribution == "normal":
        shares = truncated_normal(random, agents.count, spread, 0, 2)
    elif agents.speed_distribution == "exponential":
        shares = random.exponential(1, agents.count)
    elif agents.speed_distribution == "lognormal":
        sigma = _lognormal_sigma(spread)
        shares = random.lognormal(-(sigma**2) / 2, sigma, agents.count)
    elif agents.speed_distribution == "two_speeds":
        slow, fast = _two_speeds(agents)
        shares = np.where(random.random(agents.count) < (agents.fast_share or 0.0), fast, slow)
    else:
        shares = np.ones(agents.count)
    return agents.speed_cm_s * shares


def speed_table(agents: AgentsSection) -> FloatArray:
    """Return (`TABLE_SIZE`,) cm/s, ascending: the quantiles of the distribution of speeds, scaled to its mean."""
    spread = agents.speed_spread or 0.0
    levels = (np.arange(TABLE_SIZE) + 0.5) / TABLE_SIZE
    if agents.speed_distribution == "uniform":
        shares = 1 + spread * (2 * levels - 1)
    elif agents.speed_distribution == "normal":
        standard = NormalDist()
        cut = standard.cdf(-1 / spread)
        shares = 1 + spread * _normal_quantiles(cut + levels * (1 - 2 * cut))
    elif agents.speed_distribution == "exponential":
        shares = -np.log(1 - levels)
    elif agents.speed_distribution == "lognormal":
        shares = np.exp(_lognormal_sigma(spread) * _normal_quantiles(levels))
    elif agents.speed_distribution == "two_speeds":
        slow, fast = _two_speeds(agents)
        shares = np.where(levels > 1 - (agents.fast_share or 0.0), fast, slow)
    else:
        shares = np.ones(TABLE_SIZE)
    speeds: FloatArray = agents.speed_cm_s * shares / shares.mean()
    return speeds


def _normal_quantiles(levels: FloatArray) -> FloatArray:
    standard = NormalDist()
    return np.array([standard.inv_cdf(level) for level in levels.tolist()])


def _lognormal_sigma(spread: float) -> float:
    """Return the standard deviation of the logarithm of lognormal numbers of mean 1 and deviation `spread`."""
    return math.sqrt(math.log(1 + spread**2))


def _two_speeds(agents: AgentsSection) -> tuple[float, float]:
    """Return the speeds of slow and of fast agents, relative to the mean."""
    share, ratio = agents.fast_share or 0.0, agents.fast_ratio or 1.0
    slow = 1 / (1 + share * (ratio - 1))
    return slow, ratio * slow


def truncated_normal(random: np.random.Generator, count: int, sigma: float, low: float, high: float) -> FloatArray:
    """Return normal numbers of mean 1, (count,), each drawn again until it is between `low` and `high`."""
    drawn = random.normal(1, sigma, count)
    while (outside := (drawn < low) | (drawn > high)).any():
        drawn[outside] = random.normal(1, sigma, np.count_nonzero(outside))
    return drawn
