"""Intervals hold the truth, and tests find what is not there, as often as they say: by simulation, not by formulas.

docs/statistics.md has the study of which these are parts.
"""

import math

import numpy as np
import pytest

from epuck_sim.replication.criteria import rank_trend, ratio, weighted_slope
from epuck_sim.statistics.comparison import contrast, pair_up, permute, share_as_large, studentised
from epuck_sim.statistics.statistic import estimate_mean
from tests.statistics.fits import lognormal, measured, times

LAWS = {
    "exponential": lambda random, size: random.exponential(1, size),
    "Weibull 0.7": lambda random, size: random.weibull(0.7, size),
    "log-normal": lambda random, size: random.lognormal(0, 0.8, size),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("censored", [0, 0.5])
@pytest.mark.parametrize("trials", [5, 20, 200])
def test_intervals_of_means(law: str, censored: float, trials: int) -> None:
    """Of 300 samples; the worst of 10,000 samples is 88.5 % (Weibull 0.7, 8 trials), and 300 scatter by 1.8 %."""
    many = LAWS[law](np.random.default_rng(99), 200_000)
    limit = float(np.quantile(many, 1 - censored)) if censored else math.inf
    truth, draw = np.minimum(many, limit).mean(), np.random.default_rng(1)
    found = [estimate_mean(times(LAWS[law](draw, trials), limit)) for _ in range(300)]
    known = [each.low <= truth <= each.high for each in found if each.has_interval]
    assert len(known) > 250
    assert 0.85 <= np.mean(known) <= 0.995


def test_intervals_of_differences_and_ratios() -> None:
    held = []
    for seed in range(400):
        pair = pair_up(lognormal(50, 10, 2 * seed), lognormal(100, 20, 2 * seed + 1))
        difference, log_ratio = (contrast(pair, of_logarithms=each).estimate for each in (False, True))
        held.append((difference.low <= 50 <= difference.high, log_ratio.low <= math.log(2) <= log_ratio.high))
    assert (np.mean(held, axis=0) > 0.9).all()


@pytest.mark.parametrize(("points", "scatter"), [(4, 0.0), (4, 1.0), (4, 4.0), (9, 4.0)])
def test_intervals_of_slopes_through_few_points_however_they_scatter(points: int, scatter: float) -> None:
    x, samples, random = np.linspace(0, 1, points), 1500, np.random.default_rng(points)
    rows = 0.5 * x + random.normal(0, math.hypot(1, scatter), (samples, points))
    found = [weighted_slope(x, row, np.ones(points), 5000).estimate for row in rows]
    assert np.mean([each.low <= 0.5 <= each.high for each in found]) > 0.93 - 2 * math.sqrt(0.05 * 0.95 / samples)


def test_chance_in_the_far_tail_of_permutations() -> None:
    ours = []
    for seed in range(1200):
        pair = pair_up(*(measured(np.random.default_rng([seed, n]).lognormal(0, 0.8, 10)) for n in (0, 1)))
        ours.append(share_as_large(studentised([permute(pair, seed, of_logarithms=True, count=599)])))
    assert 0 < np.mean(np.array(ours) <= 0.005) < 0.013  # 0.005 with four standard deviations


def test_chance_in_the_far_tail_of_ratios() -> None:
    """Of exponential times, of which Welch's test finds twice as many as are nominal."""
    draws, chance = 40_000, 2e-4
    drawn = np.random.default_rng(3).exponential(1, (2, draws, 10))
    means, spreads = drawn.mean(axis=2), drawn.std(axis=2, ddof=1)
    farthest = np.argsort(np.log(means[1] / means[0]) / np.hypot(*(spreads / means)))[-60:]
    p_values = np.array([ratio([(measured(drawn[0, n]), measured(drawn[1, n]))]).p_above(1) for n in farthest])
    assert p_values[0] > chance  # none of the others is below it
    assert np.count_nonzero(p_values < chance) <= chance * draws


def test_chance_in_ratios_and_trends() -> None:
    random, x = np.random.default_rng(3), np.array([1.0, 2, 3])
    ratios = [ratio([(lognormal(5, 20, 2 * n), lognormal(5, 20, 2 * n + 1))]).p_above(1) for n in range(600)]
    trends = [rank_trend(x, [measured(random.exponential(size=9)) for _ in x]).p_below(0) for _ in range(600)]
    for p_values in (ratios, trends):
        assert 0.025 < np.mean(np.array(p_values) < 0.05) < 0.08
