"""Claims about planning: so many trials show a difference as often as is said, and each point has its own number."""

import math
from itertools import product

import numpy as np
import pytest

from epuck_sim.statistics.comparison import contrast, mean_contrast, pair_up
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.planning import plan_trials, trials_for_shares, trials_needed
from tests.runs.made_folders import SPEED, SPEEDS, ended, in_memory, sweep, weibull
from tests.statistics.fits import measured

SHAPE = 1.35
SPREAD = math.sqrt(math.gamma(1 + 2 / SHAPE) / math.gamma(1 + 1 / SHAPE) ** 2 - 1)
"""Standard deviation over mean of the Weibull distribution of this shape."""


def drawn(mean: float, trials: int, seed) -> Measured:
    times = mean * np.random.default_rng(seed).weibull(SHAPE, trials) / math.gamma(1 + 1 / SHAPE)
    return measured(times)


def share_seen(difference: float, points: int, trials: int) -> float:
    """Return how often a difference is seen over some points, of 200 experiments."""
    seen = 0
    for seed in range(200):
        pairs = [
            pair_up(drawn(50, trials, [seed, n]), drawn(50 * (1 + difference), trials, [seed, n, 1]))
            for n in range(points)
        ]
        seen += mean_contrast([contrast(pair, of_logarithms=True) for pair in pairs]).low > 0
    return seen / 200


@pytest.mark.parametrize(("difference", "points"), [(0.2, 1), (0.5, 1), (0.2, 12)])
@pytest.mark.parametrize("power", [0.5, 0.8])
def test_so_many_trials_show_the_difference_as_often_as_is_said(difference: float, points: int, power: float) -> None:
    trials = trials_needed([SPREAD] * points, difference, power)
    assert share_seen(difference, points, trials) == pytest.approx(power, abs=0.09)  # 200 scatter by 0.035


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


def of_measure(*values_of_points):
    """Return points of a sweep whose trials have these values."""
    scenario = sweep({SPEED: SPEEDS[: len(values_of_points)]})
    points = in_memory(scenario, lambda point: ended([7] * len(values_of_points[point.number])))
    return [
        point._replace(measured=tuple(values), of="mine")
        for point, values in zip(points, values_of_points, strict=True)
    ]


def test_numbers_are_planned_by_their_scatter_of_either_sign() -> None:
    values = drawn(50, 30, 1).values
    plan, mirrored = (plan_trials(of_measure(sign * values), 0.25, 0.9) for sign in (1, -1))
    (point,), (other,) = plan.points, mirrored.points
    assert (plan.of, plan.is_of_shares) == ("mine", False)
    assert point.trials == trials_needed([np.std(values, ddof=1) / np.mean(values)], 0.25, 0.9)
    assert (other.trials, other.spread, other.mean) == (point.trials, point.spread, -point.mean)
    both = plan_trials(of_measure(values, -values), 0.25, 0.9)
    assert [each.trials for each in both.points] == [point.trials] * 2
    assert both.over_all is None  # a rise of the one is a fall of the other


def test_undetermined_values_do_not_count_and_a_mean_of_0_has_no_per_cent() -> None:
    plan = plan_trials(of_measure([1.0, None, 2.0, 3.0, None, 4.0], [-1.0, 1.0] * 5, [2.0, 3.0] * 5), 0.2, 0.8)
    assert [point.stored for point in plan.points] == [4, 10, 10]
    assert [point.trials is None for point in plan.points] == [True, True, False]
    assert plan.over_all == plan.points[2].trials


def test_truth_values_are_planned_by_their_shares() -> None:
    plan = plan_trials(of_measure([True, False] * 10, [False] * 20, [True] * 3), 0.2, 0.8)
    assert (plan.is_of_shares, [point.statistic for point in plan.points]) == (True, ["share"] * 3)
    assert [point.trials for point in plan.points] == [
        trials_for_shares([0.5], 0.2, 0.8),
        trials_for_shares([0.0], 0.2, 0.8),
        None,
    ]
    assert plan.over_all == trials_for_shares([0.5, 0.0], 0.2, 0.8)
    assert plan_trials(of_measure([True, False] * 10), 0.6, 0.8).over_all is None


def share_of_exact_tests(first: float, second: float, trials: int) -> float:
    """Return how often two shares are told apart by the test of all permutations, with p < 0.05."""

    def binomial(share: float) -> list[float]:
        return [math.comb(trials, true) * share**true * (1 - share) ** (trials - true) for true in range(trials + 1)]

    def p_value(one: int, other: int) -> float:
        splits = range(max(0, one + other - trials), min(trials, one + other) + 1)
        ways = {true: math.comb(trials, true) * math.comb(trials, one + other - true) for true in splits}
        as_large = [ways[true] for true in splits if abs(2 * true - one - other) >= abs(one - other)]
        return sum(as_large) / sum(ways.values())

    chances = zip(product(range(trials + 1), repeat=2), product(binomial(first), binomial(second)), strict=True)
    return sum(one * other for (a, b), (one, other) in chances if one * other > 1e-9 and p_value(a, b) < 0.05)


@pytest.mark.parametrize(("share", "difference"), [(0.5, 0.4), (0.0, 0.3), (0.9, 0.35)])
@pytest.mark.parametrize("power", [0.6, 0.8, 0.9])
def test_so_many_trials_tell_shares_apart_as_often_as_is_said(share: float, difference: float, power: float) -> None:
    trials = trials_for_shares([share], difference, power)
    others = [other for other in (share - difference, share + difference) if 0 <= other <= 1]
    seen = min(share_of_exact_tests(share, other, trials) for other in others)
    assert power - 0.01 < seen < power + (0.17 if share in (0, 1) else 0.08)  # few trials have few outcomes
