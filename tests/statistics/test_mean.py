"""Claims about means and shares: how wide their intervals are, against scipy and published examples."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from epuck_sim.estimate import MIN_TRIALS
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.statistic import (
    estimate,
    estimate_mean,
    estimate_share,
    resample_means,
    share_difference,
    wilson_interval,
)
from tests.statistics.fits import measured, truths


def cut(values, limit: float, seed: int = 0) -> Measured:
    """Return values that are censored at a limit."""
    return measured(np.minimum(values, limit), np.array(values) <= limit, limit, seed)


values_of_trials = st.lists(st.integers(1, 10**6), min_size=MIN_TRIALS, max_size=30).filter(lambda v: len(set(v)) > 1)


@given(values_of_trials)
def test_uncensored_the_mean_is_the_samples_and_the_interval_students_of_its_logarithm(values) -> None:
    mean, low, high = estimate_mean(measured(values)).ends
    assert mean == pytest.approx(np.mean(values))
    reach = stats.t.ppf(0.975, len(values) - 1) * stats.sem(values) / mean
    assert np.log([low / mean, high / mean]) == pytest.approx([-reach, reach])


@given(values_of_trials, st.floats(-1e6, 0))
def test_where_values_are_not_positive_the_interval_is_students_own(values, shift) -> None:
    shifted = np.array(values) + shift - min(values)
    expected = stats.t.interval(0.95, len(values) - 1, shifted.mean(), stats.sem(shifted))
    assert estimate_mean(measured(shifted)).ends[1:] == pytest.approx(expected)


@given(values_of_trials, st.integers(0, 29))
def test_values_cut_at_one_limit_have_the_mean_and_the_error_of_the_sample_that_they_are(values, place) -> None:
    limit = sorted(values)[place % len(values)]
    mean, low, high = estimate_mean(cut(values, limit)).ends
    as_sample = np.minimum(values, limit)
    assert mean == pytest.approx(as_sample.mean())
    if np.ptp(as_sample) and max(values) > limit:
        freedom = min(len(values) - 1, np.count_nonzero(np.array(values) <= limit))
        reach = stats.t.ppf(0.975, freedom) * stats.sem(as_sample) / mean
        assert np.log(mean / low) == pytest.approx(reach)
        assert high == pytest.approx(min(mean * math.exp(reach), limit))


@pytest.mark.parametrize("statistic", Statistic)
@pytest.mark.parametrize("trials", [1, 4])
def test_few_trials_have_an_estimate_and_no_interval(statistic: Statistic, trials: int) -> None:
    found = estimate(measured([30, 40, 60, 75][:trials]), statistic)
    assert not found.has_interval
    assert 30 <= found.value <= 75


@pytest.mark.parametrize("limit", [math.inf, 120])
@pytest.mark.parametrize("trials", [5, 200])
def test_resampled_means_are_spread_like_the_means_of_new_trials(trials: int, limit: float) -> None:
    spreads, truth = [], []
    for seed in range(200):
        made = cut(np.ceil(np.random.default_rng(seed).exponential(100, trials)), limit, seed)
        spreads.append(np.log(resample_means(made, 100)).var())
        truth.append(math.log(estimate_mean(made).value))
    assert np.sqrt(np.mean(spreads)) == pytest.approx(np.std(truth), rel=0.15)


def test_resamples_are_widened_as_the_variance_of_few_trials_about_their_own_mean_is_too_small() -> None:
    found = np.unique(resample_means(measured([1, 3]), 200))
    assert found == pytest.approx([2 * 0.5 ** math.sqrt(2), 2, 2 * 1.5 ** math.sqrt(2)])
    below_0 = np.unique(resample_means(measured([-1, 1]), 200))
    assert below_0 == pytest.approx([-math.sqrt(2), 0, math.sqrt(2)])


# Shares


@pytest.mark.parametrize(
    ("true", "trials", "interval"),  # Newcombe 1998, Statistics in Medicine 17:857, table I, method 3
    [(81, 263, (0.2553, 0.3662)), (15, 148, (0.0624, 0.1605)), (0, 20, (0.0, 0.1611)), (1, 29, (0.0061, 0.1718))],
)
def test_intervals_of_shares_are_those_published(true, trials, interval):
    assert wilson_interval(true / trials, trials) == pytest.approx(interval, abs=5e-5)


@pytest.mark.parametrize(
    ("first", "second", "interval"),  # Newcombe 1998, Statistics in Medicine 17:873, table II, method 10
    [
        ((48, 80), (56, 70), (0.0524, 0.3339)),
        ((3, 10), (9, 10), (0.1705, 0.8090)),
        ((0, 29), (5, 56), (-0.0381, 0.1926)),
        ((0, 20), (0, 10), (-0.1611, 0.2775)),
        ((0, 10), (10, 10), (0.6075, 1.0)),
    ],
)
def test_intervals_of_differences_are_those_published(first, second, interval):
    found = share_difference(truths(*first), truths(*second))
    assert found.value == pytest.approx(second[0] / second[1] - first[0] / first[1])
    assert (found.low, found.high) == pytest.approx(interval, abs=6e-5)


@given(st.integers(1, 60), st.data())
@settings(max_examples=30)
def test_shares_lie_in_their_intervals_and_these_between_0_and_1(trials, data):
    true = data.draw(st.integers(0, trials))
    found = estimate_share(truths(true, trials))
    assert found.value == true / trials
    assert found.has_interval == (trials >= 5)
    if found.has_interval:
        assert 0 <= found.low <= found.value <= found.high <= 1
        assert found.low < found.high  # though all trials may have one value
