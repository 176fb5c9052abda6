"""Claims about the estimates of period and flash, and about the threshold of Appendix C."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from epuck_sim.order_parameter import order_parameter
from epuck_sim.overhead.synchrony import (
    MIN_PERIODS,
    _lags,
    estimate_flash_s,
    estimate_period_s,
    evaluate,
    firing_spread_s,
    spread_threshold_s,
)
from tests.overhead.counts import counted, frames, steady, uneven

PERIOD = 5.0
FLASH = 0.375
SPREAD = np.array([0, 0, 0.05, 0.1, 0.1, 0.13, 0.2, 0.2, 0.2, 0.25])


# --- the period -------------------------------------------------------------------------------------


@given(st.floats(1.5, 12), st.floats(14, 60), st.floats(0.05, 0.15))
@example(1.5, 15.0, 0.0625)
def test_the_period_of_a_synchronised_minute_is_right_to_half_a_percent(period, rate, flash_fraction):
    times = frames(max(60, 4 * period), rate)
    counts = counted(steady(SPREAD * period / 5 + 1, period, times[-1]), flash_fraction * period, times)
    assert estimate_period_s(times, counts) == pytest.approx(period, rel=0.005)


def clusters(*sizes: int) -> np.ndarray:
    """Return onsets of groups of robots that are spaced evenly over the period."""
    phases = [PERIOD * n / len(sizes) for n, size in enumerate(sizes) for _ in range(size)]
    return steady(phases, PERIOD, 60)


def shortened(random: np.random.Generator) -> np.ndarray:
    """Return onsets of robots whose cycles are often shortened, until all flash together."""
    cycles = np.where(random.random((12, 10)) < 0.7, random.uniform(3.3, 5, (12, 10)), PERIOD)
    before = random.uniform(0, PERIOD, 10) + np.cumsum(cycles, axis=0)
    return np.append(before[before < 64], 65 + steady(SPREAD, PERIOD, 20)[1:])


SWARMS = {
    "in step": lambda _: steady(SPREAD + 1, PERIOD, 60),
    "never in step": lambda random: steady(random.uniform(0, PERIOD, 10), PERIOD, 60),
    "two clusters": lambda _: clusters(2, 1),
    "two clusters of nearly equal size": lambda _: clusters(7, 3),
    "three clusters": lambda _: clusters(4, 2, 2),
    "shortened cycles before synchrony": shortened,
}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", SWARMS)
def test_the_period_is_right_to_half_a_percent_whatever_robots_and_frames_do(kind, seed):
    random = np.random.default_rng(seed)
    onsets = SWARMS[kind](random)
    times = uneven(frames(85 if kind.startswith("shortened") else 60, 15.4), random, dropped=0.1)
    assert estimate_period_s(times, counted(onsets, FLASH, times)) == pytest.approx(PERIOD, rel=0.005)


def test_a_long_film_shows_the_period_and_no_multiple_of_it_to_a_hundredth_of_a_frame():
    times = frames(300, 15.0)
    counts = counted(steady(SPREAD, 4.77, 300), FLASH, times)
    assert estimate_period_s(times, counts) == pytest.approx(4.77, abs=0.01 / 15)


@pytest.mark.parametrize("seed", range(5))
def test_flashes_at_random_have_no_period(seed):
    random = np.random.default_rng(seed)
    times = frames(60, 15.4)
    counts = counted(random.uniform(-5, 60, 120), FLASH, times)
    assert estimate_period_s(times, counts) is None


def test_a_film_of_too_few_periods_has_no_estimate():
    times = frames(MIN_PERIODS * PERIOD * 0.95, 15.0)
    assert estimate_period_s(times, counted(steady(SPREAD + 1, PERIOD, 20), FLASH, times)) is None
    times = frames(MIN_PERIODS * PERIOD * 1.1, 15.0)
    assert estimate_period_s(times, counted(steady(SPREAD + 1, PERIOD, 20), FLASH, times)) is not None


@given(st.lists(st.tuples(st.sampled_from([1, 1, 1, 2, 40]), st.integers(0, 3)), max_size=60))
def test_whatever_is_counted_the_estimates_are_none_or_within_the_film(film):
    times = np.cumsum([step for step, _ in film], dtype=float) / 15
    counts = np.array([count for _, count in film], np.int64)
    for estimate in (estimate_period_s(times, counts), estimate_flash_s(times, counts)):
        assert estimate is None or 0 < estimate < times[-1] - times[0]


events = st.lists(st.tuples(st.integers(0, 40), st.integers(1, 3)), max_size=12).map(sorted)


@given(events, events, st.integers(0, 10), st.integers(0, 30))
def test_lags_are_those_of_all_pairs(causes, effects, least, width):
    expected = [(b - a, m * n) for a, m in causes for b, n in effects if least <= b - a < least + width]
    pairs = (np.array(each, float).reshape(-1, 2).T for each in (causes, effects))
    found = _lags(*map(tuple, pairs), (least, least + width))
    assert list(zip(*(each.tolist() for each in found), strict=True)) == expected


# --- the flash --------------------------------------------------------------------------------------


@given(st.floats(0.2, 1.0), st.floats(14, 60))
def test_the_flash_of_rings_that_go_on_together_is_right_to_a_frame(flash, rate):
    times = frames(60, rate)
    counts = counted(steady(np.zeros(10), 4.99, 60), flash, times)
    assert estimate_flash_s(times, counts) == pytest.approx(flash, abs=1 / rate)


@pytest.mark.parametrize("seed", range(4))
def test_the_flash_is_not_longer_where_one_goes_on_as_another_goes_off(seed):
    random = np.random.default_rng(seed)
    times = frames(60, 15.4)
    counts = counted(np.cumsum(random.uniform(3.5, 5, (13, 10)), axis=0) - 5, FLASH, times)
    by_light = counts.mean() * 60 / np.maximum(np.diff(counts), 0).sum()
    assert by_light > 1.08 * FLASH
    assert estimate_flash_s(times, counts) == pytest.approx(FLASH, abs=0.6 / 15.4)


# --- Appendix C -------------------------------------------------------------------------------------


def test_half_early_and_half_late_by_sigma_a_have_that_order_parameter():
    for r in (0.5, 0.95, 0.99):
        sigma_s = firing_spread_s(PERIOD, r)
        assert order_parameter(np.array([sigma_s, PERIOD - sigma_s]), PERIOD) == pytest.approx(r)
    assert firing_spread_s(PERIOD) == pytest.approx(0.25, abs=0.005)  # the thesis's figure
    assert spread_threshold_s(PERIOD, 0.075 * PERIOD) * 15.5 == pytest.approx(2, abs=0.06)


@pytest.mark.parametrize("flash_s", [0.05, 0.2, FLASH])
def test_the_threshold_is_the_spread_of_half_early_and_half_late_in_a_fast_film(flash_s):
    sigma_s = firing_spread_s(PERIOD)
    times = frames(10, 2000.0)
    onsets = 5 + np.repeat([-sigma_s, sigma_s - flash_s], 5)
    (evaluation,) = evaluate(times, counted(onsets, flash_s, times), PERIOD)
    assert evaluation.spread_s == pytest.approx(spread_threshold_s(PERIOD, flash_s), rel=0.005)


@given(st.floats(0.1, 100), st.floats(0.001, 0.5), st.floats(0.001, 0.5))
def test_the_threshold_leaves_room_above_perfect_synchrony_and_scales_with_time(period, short, long):
    short, long = sorted((short, long))
    sigma_s = firing_spread_s(period)
    at_short, at_long = spread_threshold_s(period, short * period), spread_threshold_s(period, long * period)
    assert at_long > long * period / math.sqrt(12)
    assert at_long == pytest.approx(period * spread_threshold_s(1.0, long))
    assert min(at_short, at_long) >= sigma_s / 2 * (1 - 1e-9)
    if short * period > 1.5 * sigma_s:
        assert at_short <= at_long
    if long * period < 1.5 * sigma_s:
        assert at_short >= at_long
