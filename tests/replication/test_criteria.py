"""Each test of claims, against closed forms, scipy's tests, slow twins, and curves that are made up."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import stats

from epuck_sim import load_scenario
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import Estimate
from epuck_sim.replication import criteria
from epuck_sim.replication.criteria import largest_rise, level, likelier, mean_with_error, ratio, share, slope
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.comparison import contrast, pair_up
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.extrema import Place
from epuck_sim.statistics.statistic import restrict, student_estimate
from tests.statistics.fits import LIMIT, lognormal, measured, times, truths

SOME = st.lists(st.floats(1, 100), min_size=5, max_size=12, unique=True)


def knows_nothing(effect) -> bool:
    return math.isnan(effect.estimate.low) and effect.p_above(0.1) == effect.p_below(0.1) == 1


def check_p_values(effect, threshold, test, larger="greater", smaller="less") -> None:
    """Check those of an effect against a test of scipy's, a function of its alternative."""
    for p, side in ((effect.p_above, larger), (effect.p_below, smaller)):
        expected = test(alternative=side).pvalue
        assert p(threshold) == pytest.approx(expected, abs=1e-9) or math.isnan(expected)


@given(SOME, st.floats(1, 100))
@settings(max_examples=30)
def test_a_level_is_tested_as_students_test_does(values, threshold) -> None:
    effect = level(measured(values))
    check_p_values(effect, threshold, partial(stats.ttest_1samp, values, threshold))
    interval = stats.ttest_1samp(values, 0).confidence_interval()
    assert effect.estimate.ends == pytest.approx((np.mean(values), interval.low, interval.high))


@given(st.integers(5, 60).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))), st.floats(0.05, 0.95))
def test_a_share_is_tested_by_the_exact_binomial_test(counts, threshold) -> None:
    effect = share(truths(*counts))
    check_p_values(effect, threshold, partial(stats.binomtest, *counts, threshold))
    assert effect.estimate.low <= effect.estimate.value == counts[0] / counts[1] <= effect.estimate.high


@given(*(st.integers(5, 40).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))) for _ in range(2)))
@settings(max_examples=30)
def test_shares_are_compared_by_fishers_exact_test(first, second) -> None:
    effect = criteria.share_difference(truths(*first), truths(*second))
    counts = [[second[0], second[1] - second[0]], [first[0], first[1] - first[0]]]
    check_p_values(effect, 0, partial(stats.fisher_exact, counts))
    assert effect.estimate.value == pytest.approx(second[0] / second[1] - first[0] / first[1])
    assert effect.estimate.low <= effect.estimate.value <= effect.estimate.high


def test_a_share_below_one_is_shown_by_one_trial_and_no_number_of_trials_shows_one() -> None:
    assert share(times([5, 7, 9, 2000, 3000, 4000, 1, 2])).estimate.value == 5 / 8  # of those that are synchronised
    assert share(truths(999, 1000)).p_below(1) == 0
    assert share(truths(1000, 1000)).p_above(1) == share(truths(1000, 1000)).p_below(1) == 1


@given(SOME, SOME)
@settings(max_examples=30)
def test_a_ratio_of_two_points_is_that_of_compare_but_less_sure(first, second) -> None:
    pair = measured(first), measured(second)
    expected = contrast(pair_up(*pair), of_logarithms=True)
    effect = ratio([pair])
    assert effect.estimate.value == pytest.approx(math.exp(expected.mean))
    reach = stats.t.ppf(0.975, min(map(len, (first, second))) - 1)
    assert math.log(effect.estimate.high / effect.estimate.value) == pytest.approx(reach * expected.error)
    assert effect.estimate.high >= math.exp(student_estimate(*expected).high) * (1 - 1e-9)
    assert effect.p_above(effect.estimate.low) == pytest.approx(0.025)
    assert effect.p_below(effect.estimate.high) == pytest.approx(0.025)


def test_a_ratio_over_several_pairs_is_their_geometric_mean() -> None:
    pairs = [(lognormal(10, 50, 1), lognormal(20, 50, 2)), (lognormal(30, 50, 3), lognormal(300, 50, 4))]
    each = [ratio([pair]).estimate.value for pair in pairs]
    effect = ratio(pairs)
    assert effect.estimate.value == pytest.approx(math.sqrt(each[0] * each[1]))
    widths = [math.log(found.estimate.high / found.estimate.low) for found in (effect, *(ratio([p]) for p in pairs))]
    assert widths[0] < max(widths[1:])  # two pairs know more than the worse of them


@given(st.lists(SOME, min_size=2, max_size=5), st.floats(0.5, 2))
@settings(max_examples=20)
def test_the_largest_rise_is_that_of_all_pairs(curve, threshold) -> None:
    samples = [measured(values) for values in curve]
    pairs = [(samples[i], samples[j]) for j in range(len(samples)) for i in range(j)]
    each = [ratio([pair]) for pair in pairs]
    effect = largest_rise([samples])
    assert effect.estimate.value == pytest.approx(max(one.estimate.value for one in each))
    assert effect.estimate.high == pytest.approx(max(one.estimate.high for one in each))
    lows = []  # of intervals that are wider for their number
    for one, pair in zip(each, pairs, strict=True):
        freedom = min(len(sample.values) for sample in pair) - 1
        wider = stats.t.ppf(0.025 / len(each), freedom) / stats.t.ppf(0.025, freedom)
        lows.append(one.estimate.value * (one.estimate.value / one.estimate.high) ** wider)
    assert effect.estimate.low == pytest.approx(max(lows))
    assert effect.p_below(threshold) == pytest.approx(max(one.p_below(threshold) for one in each))
    smallest = min(one.p_above(threshold) for one in each)
    assert effect.p_above(threshold) == pytest.approx(min(1, len(each) * smallest), rel=1e-6)


def test_only_rises_count_and_only_within_a_curve() -> None:
    falling, rising = [[lognormal(mean, 100, mean) for mean in means] for means in ((90, 30, 10), (10, 30, 90))]
    assert largest_rise([falling]).p_below(1) < 1e-6
    assert largest_rise([falling, [lognormal(900, 100, 7), lognormal(300, 100, 8)]]).p_below(1) < 1e-6
    assert largest_rise([falling, rising]).p_above(5) < 1e-6


def test_a_slope_is_that_of_weighted_least_squares_and_less_sure_where_points_scatter() -> None:
    x = np.array([1.0, 2, 3, 4, 5])
    samples = [lognormal(mean, trials, trials) for mean, trials in ((3, 10), (9, 40), (8, 90), (30, 20), (20, 60))]
    means = [mean_with_error(sample) for sample in samples]
    weights = [each.mean / each.error for each in means]
    logs = np.log([each.mean for each in means])
    (expected, _), covariance = np.polyfit(x, logs, 1, w=weights, cov=True)
    effect = slope(x, samples)
    reach = stats.t.ppf(0.975, 3) * math.sqrt(covariance[0, 0])
    assert effect.estimate.ends == pytest.approx((expected, expected - reach, expected + reach))
    straight = [lognormal(3 * place, 40, 5) for place in x]  # of one seed, exactly on a line
    weights = [each.mean / each.error for each in map(mean_with_error, straight)]
    _, unscaled = np.polyfit(np.log(x), np.log(x), 1, w=weights, cov="unscaled")
    width = slope(np.log(x), straight).estimate.high - 1
    assert width == pytest.approx(stats.t.ppf(0.975, 3) * math.sqrt(unscaled[0, 0]))


def test_means_are_restricted_to_one_limit_and_all_censored_ones_scatter_as_if_one_had_ended_at_once() -> None:
    some, none = restrict([times([100, 200, 300, 400, 5000]), times([9000] * 20)])
    assert mean_with_error(some).mean == pytest.approx(400)
    one_at_once = [0.0] + [LIMIT] * 19
    assert mean_with_error(none) == pytest.approx((LIMIT, np.std(one_at_once, ddof=1) / math.sqrt(20), 19))
    assert ratio([(some, none)]).p_above(1) < 0.1
    assert level(none).p_below(2 * LIMIT) == level(some).p_below(LIMIT) == 1  # of what lies beyond nothing is known
    assert level(some).p_below(0.99 * LIMIT) < 0.05
    low, high = restrict([times([10, 20, 30, 40, 900]), times([10, 2000, 30, 40, 50], limit=100)])
    assert low.values.tolist() == [10, 20, 30, 40, 100]
    assert high.limit == low.limit == 100


def test_little_is_not_taken_for_much() -> None:
    few, alike, enough = measured([1, 2, 3, 4]), measured([7] * 30), lognormal(10, 30, 1)
    assert knows_nothing(level(few))
    assert knows_nothing(level(alike))
    assert knows_nothing(share(truths(4, 4)))
    assert knows_nothing(criteria.share_difference(truths(0, 4), truths(40, 40)))
    assert all(knows_nothing(ratio([pair])) for pair in ((few, enough), (enough, alike), (measured([]), enough)))
    assert all(knows_nothing(largest_rise([[enough, other]])) for other in (few, alike, measured([])))
    assert knows_nothing(slope(np.log([1.0, 2]), [enough, enough]))
    assert knows_nothing(slope(np.log([1.0, 2, 3]), [enough, enough, few]))
    assert knows_nothing(ratio([(lognormal(-5, 20, 1), enough)]))


COARSE = st.lists(st.integers(1, 40), min_size=5, max_size=15)


@given(COARSE, COARSE)
@settings(max_examples=30)
def test_superiority_is_tested_as_brunner_and_munzel_do(first, second) -> None:
    effect = criteria.superiority(measured(first), measured(second))
    wins = [(b > a) + (a == b) / 2 for a in first for b in second]
    assert effect.estimate.value == pytest.approx(np.mean(wins))
    if max(first) < min(second) or max(second) < min(first) or len({*first, *second}) == 1:
        return  # scipy divides by zero
    check_p_values(effect, 0.5, partial(stats.brunnermunzel, first, second), "less", "greater")


def test_censored_trials_are_ties_few_trials_tell_nothing_and_equal_distributions_are_within_some_of_a_half() -> None:
    first, second = times([10, 20, 30, 5000, 9000, 7000]), times([10, 20, 30, 1000, 2000, 3000])
    assert criteria.superiority(first, second).estimate.value == 0.5
    assert math.isnan(criteria.superiority(measured([1, 2, 3]), measured([5, 6, 7, 8, 9])).estimate.value)
    apart = criteria.superiority(measured([1, 2, 3, 4, 5]), measured([6, 7, 8, 9, 10]))
    assert (apart.p_above(0.5), apart.p_below(0.5)) == (0.5**5, 1)  # five independent pairs, all of them alike
    assert (apart.estimate.low, apart.estimate.high) == (pytest.approx(0.025**0.2), 1)
    reverse = criteria.superiority(measured([6, 7, 8, 9, 10]), measured([1, 2, 3, 4, 5]))
    assert (reverse.p_below(0.4), reverse.p_above(0.4), reverse.estimate.low) == (pytest.approx(0.6**5), 1, 0)
    effect = criteria.superiority(lognormal(10, 900, 1), lognormal(10, 900, 2))
    assert effect.p_above(0.4) < 1e-6
    assert effect.p_below(0.6) < 1e-6
    assert criteria.superiority(lognormal(10, 900, 1), lognormal(30, 900, 2)).p_above(0.6) < 1e-6


@given(st.lists(COARSE, min_size=2, max_size=5))
@settings(max_examples=30)
def test_a_rank_trend_is_spearmans(curves) -> None:
    x = np.arange(1.0, len(curves) + 1)
    effect = criteria.rank_trend(x, [measured(each) for each in curves])
    values = [value for each in curves for value in each]
    if len(set(values)) == 1:
        assert effect.p_above(0) == effect.p_below(0) == 1
        return
    expected = stats.spearmanr(np.repeat(x, list(map(len, curves))), values).statistic
    assert effect.estimate.value == pytest.approx(expected)
    assert effect.estimate.low <= expected <= effect.estimate.high
    assert effect.p_above(effect.estimate.low) == pytest.approx(0.025, abs=1e-6)


def test_a_perfect_trend_is_one_intervals_hold_strong_ones_and_numbers_have_no_share_that_is_true() -> None:
    effect = criteria.rank_trend(np.arange(5.0), [measured([value] * 4) for value in range(5)])
    assert effect.estimate.value == pytest.approx(1)
    assert effect.p_above(0.9) < 1e-6
    with pytest.raises(EpuckSimError, match="this measure has other values"):
        share(measured([0, 0, 0, 0, 0]))
    truth, rng = 6 / math.pi * math.asin(0.9 / 2), np.random.default_rng(4)  # of normal pairs that correlate by 0.9
    held = []
    for _ in range(300):
        x = rng.normal(size=30)
        y = 0.9 * x + math.sqrt(1 - 0.81) * rng.normal(size=30)
        _, low, high = criteria.rank_trend(x, [measured([value]) for value in y]).estimate.ends
        held.append(low <= truth <= high)
    assert 0.92 < np.mean(held) < 0.98


def test_trials_are_likelier_by_the_law_they_were_drawn_from_but_for_points_censored_few_or_coarse() -> None:
    rng = np.random.default_rng(5)
    of_weibull = [measured(scale * rng.weibull(1.3, 300)) for scale in (10, 100)]
    of_lognormal = [measured(scale * rng.lognormal(0, 0.8, 300)) for scale in (10, 100)]
    assert likelier(of_weibull, "Weibull", "log-normal").p_above(0) < 1e-4
    assert likelier(of_lognormal, "Weibull", "log-normal").p_below(0) < 1e-4
    other = likelier(of_weibull, "log-normal", "Weibull").estimate
    assert likelier(of_weibull, "Weibull", "log-normal").estimate.value == pytest.approx(-other.value)
    # the gain of a law is the difference of its likelihood
    values = np.random.default_rng(6).lognormal(1, 0.7, 40)
    logs = np.log(values)
    # closed form of the log-normal distribution's largest log likelihood
    largest = -logs.sum() - 20 * math.log(2 * math.pi * logs.var()) - 20
    weibull = stats.weibull_min.logpdf(values, *stats.weibull_min.fit(values, floc=0))
    effect = likelier([measured(values)], "log-normal", "Weibull")
    assert effect.estimate.value == pytest.approx((largest - weibull.sum()) / 40, rel=1e-4)
    gains = stats.norm.logpdf(logs, logs.mean(), logs.std()) - logs - weibull
    assert effect.p_above(0) == pytest.approx(stats.ttest_1samp(gains, 0, alternative="greater").pvalue, rel=1e-3)
    good = measured(np.random.default_rng(7).exponential(5, 60) + 1)
    bad = [times([*range(1, 40), 5000]), lognormal(5, 19, 1), measured([3, 4, 5] * 20)]
    assert likelier([good, *bad], "Weibull", "gamma").estimate == likelier([good], "Weibull", "gamma").estimate
    assert math.isnan(likelier(bad, "Weibull", "gamma").estimate.value)


def test_weibull_trials_have_their_mean_which_is_as_sure_as_trials_drawn_anew_and_others_have_not(monkeypatch) -> None:
    random = np.random.default_rng(1)
    right = criteria.weibull_ratio(measured(1000 * random.weibull(1.4, 400)), 900)
    assert right.estimate.low < 1 < right.estimate.high
    assert right.estimate.high / right.estimate.low < 1.5
    wrong = criteria.weibull_ratio(measured(100 * random.lognormal(0, 2, 400)), 100)
    assert wrong.p_below(0.7) < 1e-3
    for sample in (times([100, 200, 300, 400, 5000, 600]), measured([1, 2, 3])):  # censored, or few
        assert knows_nothing(criteria.weibull_ratio(sample, 250))
    monkeypatch.setattr(criteria, "RESAMPLES", 40)
    random = np.random.default_rng(2)
    many = [criteria.weibull_ratio(measured(1000 * random.weibull(1.4, 60)), 900).estimate for _ in range(12)]
    spread = np.std(np.log([each.value for each in many]), ddof=1)
    assert np.median([math.log(each.high / each.value) / 2 for each in many]) == pytest.approx(spread, rel=0.4)


SPEEDS = np.geomspace(0.05, 100, 15)
TRIALS = 40


def curve(values, noise: float = 0.05, seed: int = 0, trials: int = TRIALS) -> Curve:
    """Return a curve over SPEEDS whose resamples scatter by so much in the logarithm."""
    rng = np.random.default_rng(seed)
    values = np.array(values, float)
    drawn = values * np.exp(noise * rng.normal(size=(400, len(values))))
    count, ends = np.full(len(values), trials), np.column_stack([values, values])
    return Curve({}, load_scenario("particles"), Statistic.MEAN, SPEEDS, count, 0.0 * values, values, ends, drawn)


def bump(place: float) -> np.ndarray:
    """Return T_sync that falls with speed but for a peak at this speed."""
    x = np.log(SPEEDS)
    return np.exp(5 - 0.3 * x + 2 * np.exp(-((x - math.log(place)) ** 2)))


def place(value: float, error: float, seed: int) -> Place:
    return Place(Estimate(value), value * np.exp(error * np.random.default_rng(seed).normal(size=500)))


def test_places_of_a_curve_are_those_of_fit() -> None:
    found = criteria.find_place(curve(bump(3)), "V_p")
    assert found is not None
    assert found.estimate.value == pytest.approx(3, rel=0.15)
    fast = criteria.find_place(curve(np.maximum(1000 / SPEEDS, 100)), "V_f")
    assert fast is not None
    assert fast.estimate.value == pytest.approx(5, rel=0.05)
    # without a peak, or with few trials
    assert criteria.find_place(curve(1000 / SPEEDS), "V_p") is None
    assert criteria.find_place(curve(bump(3), trials=19), "V_m") is None
    assert criteria.find_place(curve(1000 / SPEEDS), "V_f") is None


@given(st.floats(-2, 2), st.floats(0.1, 9))
def test_the_exponent_of_places_on_a_power_law_is_found(exponent, factor) -> None:
    x = np.array([5.0, 10, 20, 40])
    places = [place(factor * at**exponent, 0.1, seed) for seed, at in enumerate(x)]
    effect = criteria.place_exponent(x, places, TRIALS)
    assert effect.estimate.value == pytest.approx(exponent, abs=1e-9)
    assert effect.p_above(exponent) == pytest.approx(0.5, abs=1e-6)


def test_its_error_is_that_of_places_drawn_anew_larger_where_these_scatter_and_two_say_nothing() -> None:
    x, rng = np.array([5.0, 10, 20, 40]), np.random.default_rng(1)
    slopes = [np.polyfit(np.log(x), np.log(x) + 0.1 * rng.normal(size=4), 1)[0] for _ in range(4000)]
    effect = criteria.place_exponent(x, [place(at, 0.1, int(at)) for at in x], 10_000)
    assert effect.estimate.high - effect.estimate.value == pytest.approx(1.96 * np.std(slopes), rel=0.1)
    straight = criteria.place_exponent(x, [place(at, 0.05, 1) for at in x], TRIALS).estimate
    scattered = [place(at * off, 0.05, 1) for at, off in zip(x, (1, 2, 0.5, 1), strict=True)]
    bent = criteria.place_exponent(x, scattered, TRIALS)
    assert bent.estimate.high - bent.estimate.low > 5 * (straight.high - straight.low)
    missing = criteria.place_exponent(x, [place(5, 0.1, 1), None, None, place(40, 0.1, 2)], TRIALS)
    assert math.isnan(missing.estimate.value)
    left = criteria.place_exponent(x, [None, *(place(at, 0.1, int(at)) for at in x[1:])], TRIALS)
    assert left.estimate.value == pytest.approx(1)


def test_curves_that_are_one_over_another_quantity_collapse() -> None:
    """Curves over speed have their peak at 3 over a factor, over a rate that is the factor times the speed at 3."""
    curves = [curve(factor**-0.3 * bump(3 / factor), seed=seed) for seed, factor in enumerate((0.3, 1, 3))]
    rates = [curve(factor * SPEEDS, 0.01, 50 + seed) for seed, factor in enumerate((0.3, 1, 3))]
    drawn = [*zip(curves, rates, strict=True)]
    assert criteria.collapse(drawn, TRIALS).p_below(0.5) < 1e-6
    wrong = [(made, curve(SPEEDS / f)) for (made, _), f in zip(drawn, (0.3, 1, 3), strict=True)]
    assert criteria.collapse(wrong, TRIALS).p_above(1) < 1e-6
    alike = [(made, curve(2 * SPEEDS, 0)) for made, _ in drawn]
    assert criteria.collapse(alike, TRIALS).estimate.value == pytest.approx(1, rel=0.05)
    assert math.isnan(criteria.collapse(drawn[:1], TRIALS).estimate.value)


X = np.linspace(-2, 3, 11)


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=6), st.floats(0.1, 5), st.floats(0.2, 2))
def test_curves_are_as_far_apart_as_their_heights_and_lines_by_slope_times_shift(heights, slope, shift) -> None:
    courses = [(X, np.sin(X) + height) for height in heights]
    assert criteria.spread(courses) == pytest.approx(np.std(heights, ddof=1), abs=1e-9)
    courses = [(X, slope * X), (X + shift, slope * X)]  # where both are
    assert criteria.spread(courses) == pytest.approx(slope * shift / math.sqrt(2), rel=1e-6)


def test_the_order_of_points_and_of_curves_does_not_matter_nor_do_places_that_one_curve_reaches_alone() -> None:
    rng = np.random.default_rng(1)
    courses = [(rng.normal(size=9), rng.normal(size=9)) for _ in range(4)]
    mixed = [tuple(np.array(each)[:, rng.permutation(9)]) for each in courses[::-1]]
    assert criteria.spread(mixed) == pytest.approx(criteria.spread(courses))
    near, far = (X, 0 * X), (X + 2, 0 * X + 1)
    longer = (np.append(X, 50), np.append(0 * X, 900))
    assert criteria.spread([near, far]) == pytest.approx(math.sqrt(0.5))
    assert math.isnan(criteria.spread([(X[:3], X[:3]), (X[-3:], X[-3:])]))
    assert math.isnan(criteria.spread([longer]))
    nowhere = (np.full(3, -math.inf), np.zeros(3))
    assert criteria.spread([near, nowhere, far]) == criteria.spread([near, far])
    assert math.isnan(criteria.spread([near, nowhere]))
