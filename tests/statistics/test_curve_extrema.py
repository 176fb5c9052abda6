"""Claims about where a minimum and a peak are looked for, and what is said where they are not."""

import math

import numpy as np
import pytest

from epuck_sim.statistics.curve_extrema import search_extrema
from epuck_sim.statistics.curves import Curve, read_curves
from epuck_sim.statistics.extrema import MIN_SPEEDS, MIN_TRIALS, find_minimum_and_peak
from tests.runs.made_folders import MANY_SPEEDS, SPEED, bumpy, censored, ended, falling, in_memory, sweep, weibull


def curve_of(law, speeds=MANY_SPEEDS, trials: int = 60, **changes) -> Curve:
    (curve,) = read_curves(in_memory(sweep({SPEED: speeds}, trials=trials, **changes), law), SPEED)
    return curve


def assert_same(found, expected) -> None:
    for one, two in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, two)


def test_where_all_is_well_the_pair_is_that_of_the_curve() -> None:
    curve = curve_of(bumpy)
    found, reason = search_extrema(curve)
    assert reason == ""
    assert_same(found, find_minimum_and_peak(curve.x, curve.values, curve.resampled))


@pytest.mark.parametrize("trials", [1, 2, 3, 5, MIN_TRIALS - 1])
def test_with_few_trials_there_is_no_p_value_and_it_is_said_how_many_are_the_least(trials: int) -> None:
    found, reason = search_extrema(curve_of(bumpy, trials=trials))
    assert found is None
    assert reason.startswith("fewer than 20 trials at 13 of 13 speeds")
    assert "--trials 20 is the least" in reason
    assert search_extrema(curve_of(bumpy, trials=MIN_TRIALS)).reason == ""


def test_speeds_with_few_trials_are_left_out() -> None:
    curve = curve_of(lambda point: weibull(point, 50, trials=60 if point.number % 2 else 3))
    assert curve.trials.tolist() == [3, 60] * 6 + [3]
    assert_same(
        search_extrema(curve).extrema,
        find_minimum_and_peak(curve.x[1::2], curve.values[1::2], curve.resampled[:, 1::2]),
    )


def test_few_speeds_are_said_to_be_few_and_the_one_at_rest_does_not_count() -> None:
    assert search_extrema(curve_of(falling, [1, 2, 3, 4, 5])).reason == "5 speeds; a minimum and a peak take 6"
    assert search_extrema(curve_of(lambda _: ended(range(1, 40)), range(6))).reason.startswith("5 speeds;")
    assert search_extrema(curve_of(falling, range(1, MIN_SPEEDS + 1))).reason == ""


def half_censored():
    return ended([20, 30] * 15 + [50] * 30, [True] * 30 + [False] * 30)


def test_slow_speeds_half_of_whose_trials_are_censored_are_left_out() -> None:
    curve = curve_of(lambda point: half_censored() if point.number < 3 else bumpy(point))
    found, reason = search_extrema(curve)
    assert reason == ""
    assert_same(found, find_minimum_and_peak(curve.x[3:], curve.values[3:], curve.resampled[:, 3:]))


def test_between_other_speeds_they_may_hide_a_peak() -> None:
    found, reason = search_extrema(curve_of(lambda point: half_censored() if 5 <= point.number <= 7 else bumpy(point)))
    assert found is None
    assert reason == (
        "half of the trials or more are censored from V = 0.5 to 1.3 cm/s, where a peak may be: raise stop.max_cycles"
    )


def test_where_most_speeds_are_censored_that_is_the_reason() -> None:
    curve = curve_of(lambda point: censored(point, 60) if point.number < 9 else falling(point))
    assert search_extrema(curve).reason.startswith("half of the trials or more are censored at 9 of 13 speeds;")


def test_a_curve_that_is_no_longer_known_to_resamples_is_none() -> None:
    curve = curve_of(bumpy)
    lost = curve._replace(resampled=np.full(curve.resampled.shape, math.inf))
    assert search_extrema(lost) == (None, "at fewer than 6 speeds T_sync is known well enough")
