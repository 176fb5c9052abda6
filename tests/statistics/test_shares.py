"""Shares of trials and their differences: published examples, and how often intervals hold the truth, exactly."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.errors import EpuckSimError
from epuck_sim.statistics.mean import estimate_share, share_difference, wilson_interval
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.statistic import check_statistic, estimate


def truths(true: int, trials: int) -> Measured:
    values = np.arange(trials) < true
    return Measured(values.astype(float), np.ones(trials, bool), math.inf, 0, is_share=True)


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
def test_shares_lie_in_their_intervals_and_these_between_0_and_1(trials, data):
    true = data.draw(st.integers(0, trials))
    found = estimate_share(truths(true, trials))
    assert found.value == true / trials
    assert found.has_interval == (trials >= 5)
    if found.has_interval:
        assert 0 <= found.low <= found.value <= found.high <= 1
        assert found.low < found.high  # though all trials may have one value


def test_the_statistic_of_truth_values_is_their_share():
    assert estimate(truths(3, 10), Statistic.MEAN).ends == estimate_share(truths(3, 10)).ends
    with pytest.raises(EpuckSimError, match="truth values have no median; allowed: mean"):
        check_statistic(truths(3, 10), Statistic.MEDIAN)
    with pytest.raises(EpuckSimError, match="the Weibull mean is of T_sync alone"):
        check_statistic(truths(3, 10), Statistic.WEIBULL_MEAN)
