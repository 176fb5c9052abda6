"""Claims about the evolving histogram: when it is evaluated, how wide it is, and what bad films do to it."""

import pickle
from itertools import pairwise
from statistics import median

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.order_parameter import order_parameter
from epuck_sim.overhead.synchrony import (
    MAX_HOLD_INTERVALS,
    MIN_COVERAGE,
    Evaluation,
    SynchronyDetector,
    evaluate,
    first_synchronised,
    is_synchronised,
    order_at_end,
    order_over_time,
    whole_periods,
)
from tests.overhead.counts import counted, frames, steady

PERIOD = 5.0
FLASH = 0.375
RATE = 16.0  # frames begin at floating-point numbers that are exact

TOGETHER = np.zeros(10)
SPREAD = np.array([0, 0, 0.05, 0.1, 0.1, 0.13, 0.2, 0.2, 0.2, 0.25])


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
    longest = MAX_HOLD_INTERVALS * median(b - a for a, b in pairwise(times))
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


def test_an_evaluation_comes_with_the_first_frame_half_a_period_after_its_mode():
    detector = SynchronyDetector(PERIOD)
    times = frames(3 * PERIOD, RATE)
    for time, count in zip(times, counted(steady(TOGETHER + 3, PERIOD, 15), FLASH, times), strict=True):
        evaluation = detector.update(float(time), int(count))
        if evaluation is not None:
            assert 0 <= time - (evaluation.time_s + PERIOD / 2) < 1 / RATE


def test_a_period_is_remembered_however_long_the_film_is():
    detector = SynchronyDetector(PERIOD)
    times = frames(200 * PERIOD, RATE)
    sizes = []
    for time, count in zip(times, counted(steady(SPREAD, PERIOD, 1000), FLASH, times), strict=True):
        detector.update(float(time), int(count))
        sizes.append(len(pickle.dumps(detector)))
    assert max(sizes[2000:]) <= max(sizes[200:2000]) + 50


def test_the_first_narrow_evaluation_is_the_time_of_synchrony():
    found = [Evaluation(time, 9, spread, 1.0) for time, spread in ((3, 0.3), (8, 0.125), (13, 0.1))]
    assert first_synchronised(found, 0.125) is found[1]
    assert first_synchronised(found, 0.09) is None
    assert first_synchronised([], 0.125) is None
    just = Evaluation(3.0, 2, 0.125, MIN_COVERAGE)
    assert is_synchronised(just, 0.125)
    assert not is_synchronised(just._replace(rings=1), 0.125)  # a lone flash is in step with nobody
    assert not is_synchronised(just._replace(coverage=MIN_COVERAGE - 0.001), 0.125)


# --- onsets -----------------------------------------------------------------------------------------

ONSETS_TOGETHER = np.sort(
    np.concatenate([np.arange(6) / 6 + cycle for cycle in range(3)] + [np.full(6, 4.5), np.full(6, 5.5)])
)
"""Onsets of six robots of a period of 1 s that flash together from 4.5 s on."""


@given(st.lists(st.integers(0, 2000), min_size=1, max_size=30), st.integers(100, 3000))
def test_it_is_that_of_the_onsets_within_half_a_period(onsets_ms: list[int], period_ms: int) -> None:
    onsets = np.sort(np.array(onsets_ms, float))
    order, numbers = order_over_time(onsets, float(period_ms))
    for onset, value, number in zip(onsets, order, numbers, strict=True):
        near = onsets[(onsets >= onset - period_ms / 2) & (onsets < onset + period_ms / 2)]
        assert number == len(near)
        assert value == pytest.approx(float(order_parameter(near, float(period_ms))), abs=1e-9)


def test_synchrony_begins_with_the_first_flash_together() -> None:
    assert whole_periods(ONSETS_TOGETHER, 1.0, (0.0, 6.0), 5).first_in_order_s() == 4.5
    assert whole_periods(ONSETS_TOGETHER, 1.0, (0.0, 4.9), 5).first_in_order_s() is None
    assert whole_periods(ONSETS_TOGETHER, 1.0, (4.1, 6.0), 5).first_in_order_s() == 5.5
    assert whole_periods(ONSETS_TOGETHER, 1.0, (0.0, 6.0), 7).first_in_order_s() is None


def test_a_lone_flash_is_in_step_with_nobody() -> None:
    assert whole_periods(np.array([1.0, 3.0, 5.0]), 1.0, (0.0, 6.0), 2).first_in_order_s() is None
    assert whole_periods(np.empty(0), 1.0, (0.0, 6.0), 2).first_in_order_s() is None


def test_robots_are_counted_where_they_are_nearest_together() -> None:
    early = np.sort(np.concatenate([0.7 * np.arange(5) + shift for shift in (0.0, 0.2, 0.4)]))  # cycles are shortened
    onsets_s = np.concatenate([early, np.repeat(4.5 + np.arange(5), 3) + np.tile([-0.02, 0.0, 0.02], 5)])
    assert whole_periods(onsets_s, 1.0, (0.0, 9.5), 2).robots() == 3
    assert whole_periods(onsets_s, 1.0, (0.0, 9.5), 9).robots() == 0
    assert whole_periods(np.empty(0), 1.0, (0.0, 9.5), 2).robots() == 0


def test_the_order_parameter_at_the_end_is_that_of_the_last_flashes() -> None:
    onsets_s = np.array([1.0, 1.1, 1.2, 2.0, 2.1, 2.2])
    phases = np.array([0.0, 0.1, 0.2])
    assert order_at_end(onsets_s, 1.0, 2.3, 3) == pytest.approx(np.abs(np.exp(2j * np.pi * phases).mean()))
    assert order_at_end(onsets_s, 1.0, 2.9, 3) == 0.0
    assert order_at_end(onsets_s, 1.0, 2.3, 7) == 0.0
    assert order_at_end(onsets_s, 1.0, 2.3, 0) == 0.0
