"""Intervals that hold at every look at a growing number of trials, and how narrow they are."""

import math
from collections.abc import Iterable
from itertools import pairwise
from statistics import NormalDist

import numpy as np
import pytest

from epuck_sim.estimate import LEVEL, UNDETERMINED, Estimate
from epuck_sim.statistics.measured import cut
from epuck_sim.statistics.sequential import (
    Precision,
    look_contrast,
    look_interval,
    look_level,
    look_sizes,
    probability_within,
)
from tests.statistics.fits import measured

LIMIT = 150


def test_the_boundary_is_pococks() -> None:
    """His table has 2.413 standard errors for 5 looks after equal numbers of trials, and 2.555 for 10."""
    for boundary, looks in ((2.413, 5), (2.555, 10)):
        assert probability_within(boundary, tuple(range(20, 20 * looks + 1, 20))) == pytest.approx(LEVEL, abs=2e-4)


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


def test_contrasts_add_half_widths_in_squares_and_ratios_do_in_logarithms() -> None:
    one, other = Estimate(40, 37, 44), Estimate(60, 56, 63)
    difference = look_contrast(one, other, is_relative=False)
    assert difference.ends == pytest.approx((20, 20 - math.hypot(4, 4), 20 + math.hypot(3, 3)))
    ratio, logs = (
        look_contrast(*pair, is_relative=is_relative).ends
        for pair, is_relative in (((one, other), True), ([each.apply(math.log) for each in (one, other)], False))
    )
    assert ratio == pytest.approx([math.exp(end) for end in logs])
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


def test_nothing_is_known_of_a_point_whose_trials_have_all_failed() -> None:
    assert look_interval(measured([]), LIMIT) == UNDETERMINED


def test_a_width_is_that_of_half_the_interval_over_what_is_asked() -> None:
    assert Precision.parse("10%").width(Estimate(40, 34, 50)) == pytest.approx(2)
    assert Precision.parse("4").width(Estimate(40, 34, 50)) == pytest.approx(2)
    for found in (UNDETERMINED, Estimate(40), Estimate(40, 34, math.inf), Estimate(0, -1, 1)):
        assert Precision.parse("10%").width(found) == math.inf


def test_the_last_look_is_at_the_limit_and_not_close_behind_another() -> None:
    for limit in range(20, 2000):
        sizes = look_sizes(limit)
        assert (sizes[0], sizes[-1]) == (20 if limit >= 25 else limit, limit)
        assert all(1.2 < after / before < 2 for before, after in pairwise(sizes))
