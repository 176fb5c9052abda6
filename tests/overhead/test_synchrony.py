"""Claims about the evolving histogram, order parameters of onsets, estimates of period and flash, and Appendix C."""

import math
from itertools import pairwise
from statistics import median

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from epuck_sim.order_parameter import order_parameter
from epuck_sim.overhead import synchrony
from epuck_sim.overhead.synchrony import Evaluation, estimate_flash_s, estimate_period_s, evaluate, spread_threshold_s
from tests.overhead.films import counted, even, steady, uneven

PERIOD = 5.0
FLASH = 0.375
RATE = 16.0  # frames begin at floating-point numbers that are exact


def slow_evaluations(times, counts, period):
    """Return evaluations by the words of the module's docstring, with the whole film at hand."""
    film = list(zip(times, counts, strict=True))
    runs = []
    for time, count in film:
        if not runs or runs[-1][2] != count:
            if runs:
                runs[-1][1] = time
            runs.append([time, None, count])
    found = []
    for begin, end, count in runs:
        if end is None or not count or end - begin >= period:
            continue
        middle = (begin + end) / 2
        left, right = middle - period / 2, middle + period / 2
        after_last = found[-1].time_s + period / 2 if found else film[0][0] + period / 2
        shown = [
            n for n, (time, _) in enumerate(film) if time < right and (n + 1 == len(film) or film[n + 1][0] > left)
        ]
        if middle < after_last or film[-1][0] < right or max(film[n][1] for n in shown) > count:
            continue
        found.append(slow_evaluation([film[n] for n in shown], middle, period))
    return found


def slow_evaluation(shown, middle, period):
    left, right = middle - period / 2, middle + period / 2
    times = [time for time, _ in shown]
    longest = synchrony.MAX_HOLD_INTERVALS * median(b - a for a, b in pairwise(times))
    seconds, places, lit = [], [], []
    for (time, count), following in zip(shown, [*times[1:], right], strict=True):
        begin, end = max(time, left), min(following, time + longest, right)
        seconds.append(max(0.0, end - begin))
        places.append((begin + end) / 2)
        lit.append(seconds[-1] * count)
    mean = sum(w * x for w, x in zip(lit, places, strict=True)) / sum(lit)
    variance = sum(w * (x - mean) ** 2 for w, x in zip(lit, places, strict=True)) / sum(lit)
    return Evaluation(middle, max(count for _, count in shown), variance**0.5, sum(seconds) / period)


steps = st.sampled_from([1, 1, 1, 1, 1, 1, 2, 3, 8, 30])
films = st.lists(st.tuples(steps, st.sampled_from([0, 0, 0, 1, 1, 2, 3])), min_size=1, max_size=150)


@given(films, st.sampled_from([0.5, 1.0, 2.25]))
def test_evaluations_are_those_of_the_slow_twin(film, period):
    times = np.cumsum([step for step, _ in film]) / RATE
    counts = np.array([count for _, count in film])
    found, expected = evaluate(times, counts, period), slow_evaluations(times, counts, period)
    assert [each[:2] for each in found] == [each[:2] for each in expected]
    for one, other in zip(found, expected, strict=True):
        assert one == pytest.approx(other, abs=1e-9)


def test_evaluations_come_half_a_period_after_their_mode_and_narrow_ones_of_several_rings_show_synchrony():
    found = [Evaluation(time, 9, spread, 1.0) for time, spread in ((3, 0.3), (8, 0.125), (13, 0.1))]
    assert [synchrony.is_synchronised(each, 0.125) for each in found] == [False, True, True]
    just = Evaluation(3.0, 2, 0.125, synchrony.MIN_COVERAGE)
    assert synchrony.is_synchronised(just, 0.125)
    assert not synchrony.is_synchronised(just._replace(rings=1), 0.125)  # a lone flash is in step with nobody
    assert not synchrony.is_synchronised(just._replace(coverage=synchrony.MIN_COVERAGE - 0.001), 0.125)
    detector = synchrony.SynchronyDetector(PERIOD)
    times = even(3 * PERIOD, RATE)
    for time, count in zip(times, counted(steady(np.full(10, 3.0), PERIOD, 15), FLASH, times), strict=True):
        evaluation = detector.update(float(time), int(count))
        if evaluation is not None:
            assert 0 <= time - (evaluation.time_s + PERIOD / 2) < 1 / RATE
    times = 2 / 15 + np.arange(90) / 15  # in floating point, half a period before the middle of 35 to 40 is earlier
    (edge,) = evaluate(times, 2 * (np.arange(90) // 5 == 7), 5.0)
    assert edge[:2] == (pytest.approx(2 / 15 + 2.5), 2)


@given(st.lists(st.integers(0, 2000), min_size=1, max_size=30), st.integers(100, 3000))
def test_order_over_time_is_that_of_the_onsets_within_half_a_period(onsets_ms: list[int], period_ms: int) -> None:
    onsets = np.sort(np.array(onsets_ms, float))
    order, numbers = synchrony.order_over_time(onsets, float(period_ms))
    for onset, value, number in zip(onsets, order, numbers, strict=True):
        near = onsets[(onsets >= onset - period_ms / 2) & (onsets < onset + period_ms / 2)]
        assert number == len(near)
        assert value == pytest.approx(float(order_parameter(near, float(period_ms))), abs=1e-9)


def test_synchrony_begins_with_the_first_flash_together_and_order_and_robots_are_of_flashes_together() -> None:
    onsets = np.concatenate([*(np.arange(6) / 6 + cycle for cycle in range(3)), np.full(6, 4.5), np.full(6, 5.5)])
    assert synchrony.Periods(onsets, 1.0, (0.0, 6.0), 5).first_in_order_s() == 4.5
    assert synchrony.Periods(onsets, 1.0, (0.0, 4.9), 5).first_in_order_s() is None
    assert synchrony.Periods(onsets, 1.0, (4.1, 6.0), 5).first_in_order_s() == 5.5
    assert synchrony.Periods(onsets, 1.0, (0.0, 6.0), 7).first_in_order_s() is None
    for few in (np.array([1.0, 3.0, 5.0]), np.empty(0)):  # a lone flash is in step with nobody
        assert synchrony.Periods(few, 1.0, (0.0, 6.0), 2).first_in_order_s() is None
    early = np.sort(np.concatenate([0.7 * np.arange(5) + shift for shift in (0.0, 0.2, 0.4)]))  # cycles are shortened
    onsets_s = np.concatenate([early, np.repeat(4.5 + np.arange(5), 3) + np.tile([-0.02, 0.0, 0.02], 5)])
    assert synchrony.Periods(onsets_s, 1.0, (0.0, 9.5), 2).robots() == 3
    assert synchrony.Periods(onsets_s, 1.0, (0.0, 9.5), 9).robots() == 0
    assert synchrony.Periods(np.empty(0), 1.0, (0.0, 9.5), 2).robots() == 0
    onsets_s = np.array([1.0, 1.1, 1.2, 2.0, 2.1, 2.2])
    phases = np.array([0.0, 0.1, 0.2])
    assert synchrony.order_at_end(onsets_s, 1.0, 2.3, 3) == pytest.approx(np.abs(np.exp(2j * np.pi * phases).mean()))
    assert synchrony.order_at_end(onsets_s, 1.0, 2.9, 3) == 0.0
    assert synchrony.order_at_end(onsets_s, 1.0, 2.3, 7) == 0.0
    assert synchrony.order_at_end(onsets_s, 1.0, 2.3, 0) == 0.0


SPREAD = np.array([0, 0, 0.05, 0.1, 0.1, 0.13, 0.2, 0.2, 0.2, 0.25])


@given(st.floats(1.5, 12), st.floats(14, 60), st.floats(0.05, 0.15))
@example(1.5, 15.0, 0.0625)
def test_the_period_of_a_synchronised_minute_is_right_to_half_a_percent(period, rate, flash_fraction):
    times = even(max(60, 4 * period), rate)
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
    "never in step": lambda random: steady(random.uniform(0, PERIOD, 10), PERIOD, 60),
    "two clusters of nearly equal size": lambda _: clusters(7, 3),
    "three clusters": lambda _: clusters(4, 2, 2),
    "shortened cycles before synchrony": shortened,
}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", SWARMS)
def test_the_period_is_right_to_half_a_percent_whatever_robots_and_frames_do(kind, seed):
    random = np.random.default_rng(seed)
    onsets = SWARMS[kind](random)
    times = uneven(even(85 if kind.startswith("shortened") else 60, 15.4), random, dropped=0.1)
    assert estimate_period_s(times, counted(onsets, FLASH, times)) == pytest.approx(PERIOD, rel=0.005)


def test_a_long_film_shows_the_period_and_no_multiple_but_flashes_at_random_and_too_few_periods_none():
    times = even(60, 15.4)
    for seed in range(3):
        counts = counted(np.random.default_rng(seed).uniform(-5, 60, 120), FLASH, times)
        assert estimate_period_s(times, counts) is None
    for share, is_enough in ((0.95, False), (1.1, True)):
        times = even(share * synchrony.MIN_PERIODS * PERIOD, 15.0)
        counts = counted(steady(SPREAD + 1, PERIOD, 20), FLASH, times)
        assert (estimate_period_s(times, counts) is not None) == is_enough
    times = even(300, 15.0)
    counts = counted(steady(SPREAD, 4.77, 300), FLASH, times)
    assert estimate_period_s(times, counts) == pytest.approx(4.77, abs=0.01 / 15)


@given(st.lists(st.tuples(st.sampled_from([1, 1, 1, 2, 40]), st.integers(0, 3)), max_size=60))
def test_whatever_is_counted_the_estimates_are_none_or_within_the_film(film):
    times = np.cumsum([step for step, _ in film], dtype=float) / 15
    counts = np.array([count for _, count in film], np.int64)
    for estimate in (estimate_period_s(times, counts), estimate_flash_s(times, counts)):
        assert estimate is None or 0 < estimate < times[-1] - times[0]


@given(st.floats(0.2, 1.0), st.floats(14, 60))
def test_the_flash_of_rings_that_go_on_together_is_right_to_a_frame(flash, rate):
    times = even(60, rate)
    counts = counted(steady(np.zeros(10), 4.99, 60), flash, times)
    assert estimate_flash_s(times, counts) == pytest.approx(flash, abs=1 / rate)


@pytest.mark.parametrize("seed", range(2))
def test_the_flash_is_not_longer_where_one_goes_on_as_another_goes_off(seed):
    random = np.random.default_rng(seed)
    times = even(60, 15.4)
    counts = counted(np.cumsum(random.uniform(3.5, 5, (13, 10)), axis=0) - 5, FLASH, times)
    by_light = counts.mean() * 60 / np.maximum(np.diff(counts), 0).sum()
    assert by_light > 1.08 * FLASH
    assert estimate_flash_s(times, counts) == pytest.approx(FLASH, abs=0.6 / 15.4)


def test_half_early_and_half_late_by_sigma_a_have_that_order_parameter_and_the_threshold_as_spread():
    sigma_s, times = synchrony.FIRING_SPREAD * PERIOD, even(10, 2000.0)  # a fast film
    assert order_parameter(np.array([sigma_s, PERIOD - sigma_s]), PERIOD) == pytest.approx(0.95)
    assert sigma_s == pytest.approx(0.25, abs=0.005)  # the thesis's figure
    assert spread_threshold_s(PERIOD, 0.075 * PERIOD) * 15.5 == pytest.approx(2, abs=0.06)
    for flash_s in (0.05, 0.2, FLASH):
        onsets = 5 + np.repeat([-sigma_s, sigma_s - flash_s], 5)
        (evaluation,) = evaluate(times, counted(onsets, flash_s, times), PERIOD)
        assert evaluation.spread_s == pytest.approx(spread_threshold_s(PERIOD, flash_s), rel=0.005)


@given(st.floats(0.1, 100), st.floats(0.001, 0.5))
def test_the_threshold_leaves_room_above_perfect_synchrony_and_scales_with_time(period, flash):
    threshold_s = spread_threshold_s(period, flash * period)
    assert threshold_s == pytest.approx(period * spread_threshold_s(1.0, flash))
    assert threshold_s > flash * period / math.sqrt(12)
    assert threshold_s >= synchrony.FIRING_SPREAD * period / 2 * (1 - 1e-9)
