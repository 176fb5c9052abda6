"""Claims about planning: so many trials show a difference as often as is said, and each point has its own number."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.statistics.estimate import MIN_TRIALS
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.planning import plan_trials
from epuck_sim.statistics.power import relative_spread, trials_needed
from epuck_sim.statistics.two_samples import contrast, mean_log_ratio, pair_up
from tests.runs.made_folders import SPEED, SPEEDS, ended, in_memory, sweep, weibull

SHAPE = 1.35
SPREAD = math.sqrt(math.gamma(1 + 2 / SHAPE) / math.gamma(1 + 1 / SHAPE) ** 2 - 1)
"""Standard deviation over mean of the Weibull distribution of this shape."""


def drawn(mean: float, trials: int, seed) -> Measured:
    times = mean * np.random.default_rng(seed).weibull(SHAPE, trials) / math.gamma(1 + 1 / SHAPE)
    return Measured(times, np.ones(trials, bool), 1e9, 0)


def share_seen(difference: float, points: int, trials: int) -> float:
    """Return how often a difference is seen over some points, of 300 experiments."""
    seen = 0
    for seed in range(300):
        pairs = [
            pair_up(drawn(50, trials, [seed, n]), drawn(50 * (1 + difference), trials, [seed, n, 1]))
            for n in range(points)
        ]
        seen += mean_log_ratio([contrast(pair) for pair in pairs]).low > 0
    return seen / 300


@pytest.mark.parametrize(("difference", "points"), [(0.2, 1), (0.5, 1), (0.2, 12)])
@pytest.mark.parametrize("power", [0.5, 0.8])
def test_so_many_trials_show_the_difference_as_often_as_is_said(difference: float, points: int, power: float) -> None:
    trials = trials_needed([SPREAD] * points, difference, power)
    assert share_seen(difference, points, trials) == pytest.approx(power, abs=0.09)  # 300 scatter by 0.03


@given(st.floats(0.1, 3), st.floats(0.01, 2), st.floats(0.1, 0.98))
def test_smaller_differences_larger_spreads_and_more_power_take_more_trials(spread, difference, power) -> None:
    trials = trials_needed([spread], difference, power)
    assert trials >= MIN_TRIALS
    assert trials_needed([spread], difference / 2, power) >= trials
    assert trials_needed([2 * spread], difference, power) >= trials
    assert trials_needed([spread], difference, power + 0.01) >= trials
    assert trials_needed([spread] * 4, difference, power) <= trials


def test_the_spread_is_that_of_the_trials_and_unknown_of_few_or_equal_ones() -> None:
    made = drawn(50, 30, 1)
    assert relative_spread(made) == pytest.approx(np.std(made.values, ddof=1) / np.mean(made.values))
    assert relative_spread(drawn(50, 20_000, 2)) == pytest.approx(SPREAD, rel=0.03)
    assert math.isnan(relative_spread(drawn(50, 4, 1)))
    assert math.isnan(relative_spread(made._replace(values=np.full(30, 7.0))))


def test_each_point_has_its_number_and_points_without_a_spread_none() -> None:
    def law(point):
        match point.number:
            case 0:
                return ended([])
            case 1:
                return ended([5, 6, 7])
            case 2:
                return ended([*range(20, 40), 5000], [True] * 20 + [False])
        return weibull(point, 40)

    plan = plan_trials(in_memory(sweep({SPEED: SPEEDS}, trials=50), law), 0.25, 0.9)
    assert [point.stored for point in plan.points] == [0, 3, 21, 50, 50]
    assert [point.trials is None for point in plan.points] == [True, True, False, False, False]
    assert [point.statistic for point in plan.points[2:]] == ["restricted mean", "mean", "mean"]
    spreads = [point.spread for point in plan.points[2:]]
    assert [point.trials for point in plan.points[2:]] == [trials_needed([each], 0.25, 0.9) for each in spreads]
    assert plan.over_all == trials_needed(spreads, 0.25, 0.9)


def test_without_any_spread_there_is_no_number_over_all() -> None:
    plan = plan_trials(in_memory(sweep({SPEED: [1]}), lambda _: ended([5, 6])), 0.2, 0.8)
    assert (plan.over_all, plan.points[0].trials) == (None, None)
