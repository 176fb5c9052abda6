"""Intervals hold the truth, and tests find what is there, as often as they say: by simulation, not by formulas."""

import math
from collections.abc import Iterable
from functools import partial
from itertools import pairwise, product
from statistics import NormalDist

import numpy as np
import pytest

from epuck_sim.estimate import LEVEL, UNDETERMINED, Estimate
from epuck_sim.replication.criteria import rank_trend, ratio, weighted_slope
from epuck_sim.statistics import comparison, sequential
from epuck_sim.statistics.comparison import contrast, mean_contrast, pair_up, permute, permute_ranks, studentised
from epuck_sim.statistics.planning import plan_trials, trials_for_shares, trials_needed
from epuck_sim.statistics.sequential import Precision, look_contrast, look_interval, look_level, look_sizes
from epuck_sim.statistics.statistic import Measured, cut, estimate_mean, student_estimate
from tests.runs.made_folders import SHAPE, SPEED, SPEEDS, ended, in_memory, sweep, weibull
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
        difference, log_ratio = (student_estimate(*contrast(pair, of_logarithms=each)) for each in (False, True))
        held.append((difference.low <= 50 <= difference.high, log_ratio.low <= math.log(2) <= log_ratio.high))
    assert (np.mean(held, axis=0) > 0.9).all()


@pytest.mark.parametrize(("points", "scatter"), [(4, 0.0), (4, 1.0), (4, 4.0), (9, 4.0)])
def test_intervals_of_slopes_through_few_points_however_they_scatter(points: int, scatter: float) -> None:
    x, samples, random = np.linspace(0, 1, points), 1500, np.random.default_rng(points)
    rows = 0.5 * x + random.normal(0, math.hypot(1, scatter), (samples, points))
    found = [weighted_slope(x, row, np.ones(points), 5000).estimate for row in rows]
    assert np.mean([each.low <= 0.5 <= each.high for each in found]) > 0.93 - 2 * math.sqrt(0.05 * 0.95 / samples)


@pytest.mark.parametrize("permuting", [partial(permute, of_logarithms=True), permute_ranks])
def test_chance_in_the_far_tail_of_permutations(permuting) -> None:
    """Also of 5 and 20 trials that end at random times, of which normal log-rank statistics find twice as many."""
    ours, is_of_ranks = [], permuting is permute_ranks
    for seed in range(1200):
        random, sizes = np.random.default_rng(seed), (5, 20) if is_of_ranks else (10, 10)
        drawn = [(random.lognormal(0, 0.8, n), random.uniform(0.5, 4 if is_of_ranks else 1e9, n)) for n in sizes]
        pair = pair_up(*(measured(np.minimum(*each), each[0] <= each[1]) for each in drawn))
        ours.append(comparison.share_as_large(studentised([permuting(pair, seed, count=599)])))
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


def drawn(mean: float, trials: int, seed) -> Measured:
    return measured(mean * np.random.default_rng(seed).weibull(SHAPE, trials) / math.gamma(1 + 1 / SHAPE))


@pytest.mark.parametrize(
    ("difference", "limits"), [(0.2, [math.inf]), (0.2, [math.inf] * 12), (0.5, [40]), (0.5, [math.inf, 40, 20])]
)
@pytest.mark.parametrize("power", [0.5, 0.8])
def test_so_many_trials_show_a_difference_of_times_as_often_as_is_said(difference, limits, power) -> None:
    def samples(mean: float, trials: int, *seed: int) -> list[Measured]:
        return [cut(drawn(mean, trials, [*seed, n]), limit) for n, limit in enumerate(limits)]

    known = iter(samples(50, 5000, 1))
    points = in_memory(sweep({SPEED: [*range(1, 1 + len(limits))]}), lambda _: ended(*next(known)[:2]))
    trials, seen = plan_trials(points, difference, power).over_all, []
    for seed in range(200):
        pairs = map(pair_up, samples(50, trials, seed, 2), samples(50 * (1 + difference), trials, seed, 3))
        seen.append(mean_contrast([contrast(pair, of_logarithms=True) for pair in pairs]).low > 0)
    assert np.mean(seen) == pytest.approx(power, abs=0.09)  # 200 scatter by 0.035


def test_each_point_has_its_number_and_points_without_a_spread_none() -> None:
    def law(point):
        few = ended([]), ended([5, 6, 7]), ended([*range(20, 40), 5000], [True] * 20 + [False])
        return few[point.number] if point.number < 3 else weibull(point, 40)

    plan = plan_trials(in_memory(sweep({SPEED: SPEEDS}, trials=50), law), 0.25, 0.9)
    assert [point.stored for point in plan.points] == [0, 3, 21, 50, 50]
    assert [point.trials is None for point in plan.points] == [True, True, False, False, False]
    assert [point.statistic for point in plan.points[2:]] == ["restricted mean", "mean", "mean"]
    assert all(point.trials == trials_needed([point.spread], 0.25, 0.9) for point in plan.points[3:])


def of_measure(*values_of_points):
    scenario = sweep({SPEED: SPEEDS[: len(values_of_points)]})
    points = in_memory(scenario, lambda point: ended([7] * len(values_of_points[point.number])))
    return [point._replace(measured=tuple(values_of_points[point.number]), of="mine") for point in points]


def test_numbers_are_planned_by_their_scatter_of_either_sign_and_what_is_undetermined_does_not_count() -> None:
    values = drawn(50, 30, 1).values
    plan, mirrored = (plan_trials(of_measure(sign * values), 0.25, 0.9) for sign in (1, -1))
    (point,), (other,) = plan.points, mirrored.points
    assert (plan.of, plan.is_of_shares) == ("mine", False)
    assert point.trials == trials_needed([np.std(values, ddof=1) / np.mean(values)], 0.25, 0.9)
    assert (other.trials, other.spread, other.mean) == (point.trials, point.spread, -point.mean)
    both = plan_trials(of_measure(values, -values), 0.25, 0.9)
    assert [each.trials for each in both.points] == [point.trials] * 2
    assert both.over_all is None  # a rise of the one is a fall of the other
    plan = plan_trials(of_measure([1.0, None, 2.0, 3.0, None, 4.0], [-1.0, 1.0] * 5, [2.0, 3.0] * 5), 0.2, 0.8)
    assert [point.stored for point in plan.points] == [4, 10, 10]
    assert [point.trials is None for point in plan.points] == [True, True, False]  # a mean of 0 has no per cent
    assert plan.over_all == plan.points[2].trials


def test_truth_values_are_planned_by_their_shares() -> None:
    plan = plan_trials(of_measure([True, False] * 10, [False] * 20, [True] * 3), 0.2, 0.8)
    assert (plan.is_of_shares, [point.statistic for point in plan.points]) == (True, ["share"] * 3)
    alone = [trials_for_shares([share], 0.2, 0.8) for share in (0.5, 0.0)]
    assert [point.trials for point in plan.points] == [*alone, None]
    assert plan.over_all == trials_for_shares([0.5, 0.0], 0.2, 0.8)
    assert plan_trials(of_measure([True, False] * 10), 0.6, 0.8).over_all is None
    for difference, power in ((-0.2, 0.8), (0.2, 80)):
        with pytest.raises(ValueError, match=rf"difference is {difference}, and power {power}; allowed: above 0, and"):
            plan_trials([], difference, power)


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


LIMIT = 150


def test_the_boundary_is_pococks() -> None:
    """His table has 2.413 standard errors for 5 looks after equal numbers of trials, and 2.555 for 10."""
    for boundary, looks in ((2.413, 5), (2.555, 10)):
        within = sequential.probability_within(boundary, tuple(range(20, 20 * looks + 1, 20)))
        assert within == pytest.approx(LEVEL, abs=2e-4)


@pytest.mark.parametrize("limit", [20, 50, 1000])
def test_means_are_within_their_intervals_at_all_looks_as_often_as_asked(limit: int) -> None:
    sums, sizes = 20_000, np.array(look_sizes(limit))
    steps = np.random.default_rng(limit).normal(size=(sums, len(sizes))) * np.sqrt(np.diff(sizes, prepend=0))
    errors = np.abs(steps.cumsum(axis=1)) / np.sqrt(sizes)
    boundary = NormalDist().inv_cdf((1 + look_level(look_sizes(limit))) / 2)
    within = np.mean((errors <= boundary).all(axis=1))
    assert within == pytest.approx(LEVEL, abs=4 * math.sqrt(LEVEL * (1 - LEVEL) / sums))


def shares_that_hold(truth: float, asked: str, experiments: Iterable[list[Estimate]]) -> tuple[float, float, float]:
    """Return in which share of experiments all looks hold the truth, the first narrow one does, and comes early."""
    found = []
    for looks in experiments:
        end = next((look for look in looks if Precision.parse(asked).width(look) <= 1), looks[-1])
        holds = [each.low <= truth <= each.high for each in (*looks, end)]
        found.append((all(holds), holds[-1], end is not looks[-1]))
    return tuple(np.mean(found, axis=0).tolist())


def looks_at(times, limit: float = math.inf) -> list[Estimate]:
    """Return the interval of trials at each look, of which those that last longer are censored."""
    return [look_interval(cut(measured(times[:size]), limit), LIMIT) for size in look_sizes(LIMIT)]


@pytest.mark.parametrize("share_censored", [0.0, 0.4])
def test_intervals_of_skewed_times_hold_at_all_looks_and_at_the_first_narrow_one(share_censored) -> None:
    samples, random = 400, np.random.default_rng(5)
    limit = (-math.log(share_censored)) ** (1 / 1.35) if share_censored else math.inf
    truth = np.minimum(random.weibull(1.35, 10**6), limit).mean()
    experiments = (looks_at(times, limit) for times in random.weibull(1.35, (samples, LIMIT)))
    hold, hold_at_end, _ = shares_that_hold(truth, "25%", experiments)
    error = math.sqrt(LEVEL * (1 - LEVEL) / samples)
    assert hold > LEVEL - 0.01 - 2 * error  # Student's miss the means of skewed times a little more often
    assert hold_at_end > LEVEL


def test_widths_are_of_half_an_interval_over_what_is_asked_and_contrasts_add_them_in_squares_or_logarithms() -> None:
    assert Precision.parse("10%").width(Estimate(40, 34, 50)) == pytest.approx(2)
    assert Precision.parse("4").width(Estimate(40, 34, 50)) == pytest.approx(2)
    for found in (UNDETERMINED, Estimate(40), Estimate(40, 34, math.inf), Estimate(0, -1, 1)):
        assert Precision.parse("10%").width(found) == math.inf
    one, other = Estimate(40, 37, 44), Estimate(60, 56, 63)
    difference = look_contrast(one, other, is_relative=False)
    assert difference.ends == pytest.approx((20, 20 - math.hypot(4, 4), 20 + math.hypot(3, 3)))
    of_logs = look_contrast(one.apply(math.log), other.apply(math.log), is_relative=False)
    ratio = look_contrast(one, other, is_relative=True).ends
    assert ratio == pytest.approx([math.exp(end) for end in of_logs.ends])
    assert look_contrast(Estimate(1, -1, 2), Estimate(2, -1, 3), is_relative=True).ends[1:] == (0, math.inf)


@pytest.mark.parametrize(
    ("is_relative", "asked", "truth"), [(True, "35%", 2.0), (False, "0.6", math.gamma(1 + 1 / 1.35))]
)
def test_contrasts_of_skewed_times_hold_at_all_looks_and_at_the_first_narrow_one(is_relative, asked, truth) -> None:
    samples = 400
    experiments = (
        [look_contrast(*pair, is_relative=is_relative) for pair in zip(looks_at(one), looks_at(2 * two), strict=True)]
        for one, two in np.random.default_rng(6).weibull(1.35, (samples, 2, LIMIT))
    )
    hold, hold_at_end, early = shares_that_hold(truth, asked, experiments)
    assert early > 0.25
    assert hold > LEVEL - 0.01 - 2 * math.sqrt(LEVEL * (1 - LEVEL) / samples)
    assert hold_at_end > LEVEL


def test_where_all_trials_are_censored_few_can_end_sooner() -> None:
    level = look_level(look_sizes(LIMIT))
    widths = []
    for trials in (20, 100):
        found = look_interval(measured(np.full(trials, 60.0), np.zeros(trials, bool), 60), LIMIT)
        assert (found.value, found.high) == (60, 60)
        share_ending = 1 - found.low / 60
        assert (1 - share_ending) ** trials == pytest.approx((1 - level) / 2)
        widths.append(Precision.parse("5%").width(found))
    assert widths[0] > 1 > widths[1]
    assert look_interval(measured([]), LIMIT) == UNDETERMINED  # all have failed


def test_the_last_look_is_at_the_limit_and_not_close_behind_another() -> None:
    for limit in range(20, 2000):
        sizes = look_sizes(limit)
        assert (sizes[0], sizes[-1]) == (20 if limit >= 25 else limit, limit)
        assert all(1.2 < after / before < 2 for before, after in pairwise(sizes))
