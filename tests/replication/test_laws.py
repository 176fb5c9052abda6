"""Tests of whole distributions, against scipy's tests and closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from epuck_sim.replication import criteria
from epuck_sim.replication.criteria import likelier, rank_trend, superiority, weibull_ratio
from tests.replication.samples import drawn, times, uncensored

SOME = st.lists(st.integers(1, 40), min_size=5, max_size=15)


@given(SOME, SOME)
def test_superiority_is_tested_as_brunner_and_munzel_do(first, second) -> None:
    effect = superiority(uncensored(first), uncensored(second))
    wins = [(b > a) + (a == b) / 2 for a in first for b in second]
    assert effect.estimate.value == pytest.approx(np.mean(wins))
    if max(first) < min(second) or max(second) < min(first) or len({*first, *second}) == 1:
        return  # scipy divides by zero
    for p, side in ((effect.p_above, "less"), (effect.p_below, "greater")):
        expected = stats.brunnermunzel(first, second, alternative=side).pvalue
        if math.isfinite(expected):
            assert p(0.5) == pytest.approx(expected, abs=1e-9)


def test_censored_trials_are_ties_and_few_trials_tell_nothing() -> None:
    first, second = times([10, 20, 30, 5000, 9000, 7000]), times([10, 20, 30, 1000, 2000, 3000])
    assert superiority(first, second).estimate.value == 0.5
    assert math.isnan(superiority(uncensored([1, 2, 3]), uncensored([5, 6, 7, 8, 9])).estimate.value)
    apart = superiority(uncensored([1, 2, 3, 4, 5]), uncensored([6, 7, 8, 9, 10]))
    assert apart.p_above(0.5) == 1  # no overlap shows no scatter


def test_equal_distributions_are_within_some_of_a_half() -> None:
    effect = superiority(drawn(10, 900, 1), drawn(10, 900, 2))
    assert effect.p_above(0.4) < 1e-6
    assert effect.p_below(0.6) < 1e-6
    assert superiority(drawn(10, 900, 1), drawn(30, 900, 2)).p_above(0.6) < 1e-6


@given(st.lists(SOME, min_size=2, max_size=5))
def test_a_rank_trend_is_spearmans(curves) -> None:
    x = np.arange(1.0, len(curves) + 1)
    effect = rank_trend(x, [uncensored(each) for each in curves])
    values = [value for each in curves for value in each]
    if len(set(values)) == 1:
        assert effect.p_above(0) == effect.p_below(0) == 1
        return
    expected = stats.spearmanr(np.repeat(x, list(map(len, curves))), values).statistic
    assert effect.estimate.value == pytest.approx(expected)
    assert effect.estimate.low <= expected <= effect.estimate.high
    assert effect.p_above(effect.estimate.low) == pytest.approx(0.025, abs=1e-6)


def test_intervals_of_strong_trends_hold_the_truth() -> None:
    truth, rng = 6 / math.pi * math.asin(0.9 / 2), np.random.default_rng(4)  # of normal pairs that correlate by 0.9
    held = []
    for _ in range(400):
        x = rng.normal(size=30)
        y = 0.9 * x + math.sqrt(1 - 0.81) * rng.normal(size=30)
        _, low, high = rank_trend(x, [uncensored([value]) for value in y]).estimate.ends
        held.append(low <= truth <= high)
    assert 0.92 < np.mean(held) < 0.98


def test_trials_are_likelier_by_the_law_that_they_were_drawn_from() -> None:
    rng = np.random.default_rng(5)
    weibull = [uncensored(scale * rng.weibull(1.3, 300)) for scale in (10, 100)]
    lognormal = [uncensored(scale * rng.lognormal(0, 0.8, 300)) for scale in (10, 100)]
    assert likelier(weibull, "Weibull", "log-normal").p_above(0) < 1e-4
    assert likelier(lognormal, "Weibull", "log-normal").p_below(0) < 1e-4
    other = likelier(weibull, "log-normal", "Weibull").estimate
    assert likelier(weibull, "Weibull", "log-normal").estimate.value == pytest.approx(-other.value)


def test_the_gain_of_a_law_is_the_difference_of_its_likelihood() -> None:
    values = np.random.default_rng(6).lognormal(1, 0.7, 40)
    logs = np.log(values)
    # closed form of the log-normal distribution's largest log likelihood
    largest = -logs.sum() - 20 * math.log(2 * math.pi * logs.var()) - 20
    weibull = stats.weibull_min.logpdf(values, *stats.weibull_min.fit(values, floc=0))
    effect = likelier([uncensored(values)], "log-normal", "Weibull")
    assert effect.estimate.value == pytest.approx((largest - weibull.sum()) / 40, rel=1e-4)
    gains = stats.norm.logpdf(logs, logs.mean(), logs.std()) - logs - weibull
    assert effect.p_above(0) == pytest.approx(stats.ttest_1samp(gains, 0, alternative="greater").pvalue, rel=1e-3)


def test_points_that_are_censored_few_or_coarse_are_left_out() -> None:
    good = uncensored(np.random.default_rng(7).exponential(5, 60) + 1)
    bad = [times([*range(1, 40), 5000]), drawn(5, 19, 1), uncensored([3, 4, 5] * 20)]
    assert likelier([good, *bad], "Weibull", "gamma").estimate == likelier([good], "Weibull", "gamma").estimate
    assert math.isnan(likelier(bad, "Weibull", "gamma").estimate.value)


def test_weibull_trials_have_their_mean_though_they_are_censored_and_others_have_not() -> None:
    random = np.random.default_rng(1)
    right = weibull_ratio(uncensored(1000 * random.weibull(1.4, 400)), 900)
    assert right.estimate.low < 1 < right.estimate.high
    assert right.estimate.high / right.estimate.low < 1.5
    wrong = weibull_ratio(uncensored(100 * random.lognormal(0, 2, 400)), 100)
    assert wrong.p_below(0.7) < 1e-3


def test_its_error_is_that_of_trials_drawn_anew(monkeypatch) -> None:
    monkeypatch.setattr(criteria, "RESAMPLES", 60)
    random = np.random.default_rng(2)
    many = [weibull_ratio(uncensored(1000 * random.weibull(1.4, 60)), 900).estimate for _ in range(15)]
    spread = np.std(np.log([each.value for each in many]), ddof=1)
    assert np.median([math.log(each.high / each.value) / 2 for each in many]) == pytest.approx(spread, rel=0.4)


def test_nothing_is_known_of_an_estimator_where_the_truth_is_censored_or_trials_are_few() -> None:
    for sample in (times([100, 200, 300, 400, 5000, 600]), uncensored([1, 2, 3])):
        assert math.isnan(weibull_ratio(sample, 250).estimate.low)
