"""Tests of places of curves and of their collapse, on curves that are made up."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim import load_scenario
from epuck_sim.estimate import Estimate
from epuck_sim.replication.criteria import collapse, find_place, place_exponent, spread
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.extrema import Place
from epuck_sim.statistics.names import Statistic

SPEEDS = np.geomspace(0.05, 100, 15)
TRIALS = 40
SCENARIO = load_scenario("particles")


def curve(values, noise: float = 0.05, seed: int = 0, trials: int = TRIALS) -> Curve:
    """Return a curve over SPEEDS whose resamples scatter by so much in the logarithm."""
    rng = np.random.default_rng(seed)
    values = np.array(values, float)
    drawn = values * np.exp(noise * rng.normal(size=(400, len(values))))
    count, ends = np.full(len(values), trials), np.column_stack([values, values])
    return Curve({}, SCENARIO, Statistic.MEAN, SPEEDS, count, 0.0 * values, values, ends, drawn)


def bump(place: float) -> np.ndarray:
    """Return T_sync that falls with speed but for a peak at this speed."""
    x = np.log(SPEEDS)
    return np.exp(5 - 0.3 * x + 2 * np.exp(-((x - math.log(place)) ** 2)))


def place(value: float, error: float, seed: int) -> Place:
    return Place(Estimate(value), value * np.exp(error * np.random.default_rng(seed).normal(size=500)))


def test_places_of_a_curve_are_those_of_fit() -> None:
    found = find_place(curve(bump(3)), "V_p")
    assert found is not None
    assert found.estimate.value == pytest.approx(3, rel=0.15)
    fast = find_place(curve(np.maximum(1000 / SPEEDS, 100)), "V_f")
    assert fast is not None
    assert fast.estimate.value == pytest.approx(5, rel=0.05)

    # without a peak, or with few trials
    assert find_place(curve(1000 / SPEEDS), "V_p") is None
    assert find_place(curve(bump(3), trials=19), "V_m") is None
    assert find_place(curve(1000 / SPEEDS), "V_f") is None


@given(st.floats(-2, 2), st.floats(0.1, 9))
def test_the_exponent_of_places_on_a_power_law_is_found(exponent, factor) -> None:
    x = np.array([5.0, 10, 20, 40])
    places = [place(factor * at**exponent, 0.1, seed) for seed, at in enumerate(x)]
    effect = place_exponent(x, places, TRIALS)
    assert effect.estimate.value == pytest.approx(exponent, abs=1e-9)
    assert effect.p_above(exponent) == pytest.approx(0.5, abs=1e-6)


def test_its_error_is_that_of_places_drawn_anew() -> None:
    x, rng = np.array([5.0, 10, 20, 40]), np.random.default_rng(1)
    slopes = [np.polyfit(np.log(x), np.log(x) + 0.1 * rng.normal(size=4), 1)[0] for _ in range(4000)]
    effect = place_exponent(x, [place(at, 0.1, int(at)) for at in x], 10_000)
    assert effect.estimate.high - effect.estimate.value == pytest.approx(1.96 * np.std(slopes), rel=0.1)


def test_scatter_about_the_law_makes_it_less_sure_and_two_places_say_nothing() -> None:
    x = np.array([5.0, 10, 20, 40])
    straight = place_exponent(x, [place(at, 0.05, 1) for at in x], TRIALS).estimate
    bent = place_exponent(x, [place(at * off, 0.05, 1) for at, off in zip(x, (1, 2, 0.5, 1), strict=True)], TRIALS)
    assert bent.estimate.high - bent.estimate.low > 5 * (straight.high - straight.low)
    missing = place_exponent(x, [place(5, 0.1, 1), None, None, place(40, 0.1, 2)], TRIALS)
    assert math.isnan(missing.estimate.value)
    left = place_exponent(x, [None, *(place(at, 0.1, int(at)) for at in x[1:])], TRIALS)
    assert left.estimate.value == pytest.approx(1)


def shifted(factor: float, seed: int) -> tuple[Curve, Curve]:
    """Return a curve with its peak at a speed that is 3 over the factor, and a rate of so much times the speed.

    The factor enters T_sync, too, as speed to the power of -0.3.
    """
    return curve(factor**-0.3 * bump(3 / factor), seed=seed), curve(factor * SPEEDS, 0.01, seed + 50)


def test_curves_that_are_one_over_another_quantity_collapse() -> None:
    drawn = [shifted(factor, seed) for seed, factor in enumerate((0.3, 1, 3))]
    assert collapse(drawn, TRIALS).p_below(0.5) < 1e-6
    wrong = [(made, curve(SPEEDS / f)) for (made, _), f in zip(drawn, (0.3, 1, 3), strict=True)]
    assert collapse(wrong, TRIALS).p_above(1) < 1e-6
    alike = [(made, curve(2 * SPEEDS, 0)) for made, _ in drawn]
    assert collapse(alike, TRIALS).estimate.value == pytest.approx(1, rel=0.05)
    assert math.isnan(collapse(drawn[:1], TRIALS).estimate.value)


X = np.linspace(-2, 3, 11)


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=6))
def test_parallel_curves_are_as_far_apart_as_their_heights(heights) -> None:
    courses = [(X, np.sin(X) + height) for height in heights]
    assert spread(courses) == pytest.approx(np.std(heights, ddof=1), abs=1e-9)


@given(st.floats(0.1, 5), st.floats(0.2, 2))
def test_shifted_lines_are_apart_by_slope_times_shift_where_both_are(slope, shift) -> None:
    courses = [(X, slope * X), (X + shift, slope * X)]
    assert spread(courses) == pytest.approx(slope * shift / math.sqrt(2), rel=1e-6)


def test_the_order_of_points_and_of_curves_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    courses = [(rng.normal(size=9), rng.normal(size=9)) for _ in range(4)]
    mixed = [tuple(np.array(each)[:, rng.permutation(9)]) for each in courses[::-1]]
    assert spread(mixed) == pytest.approx(spread(courses))


def test_places_that_one_curve_reaches_alone_do_not_count() -> None:
    near, far = (X, 0 * X), (X + 2, 0 * X + 1)
    longer = (np.append(X, 50), np.append(0 * X, 900))
    assert spread([near, far]) == pytest.approx(math.sqrt(0.5))
    assert math.isnan(spread([(X[:3], X[:3]), (X[-3:], X[-3:])]))
    assert math.isnan(spread([longer]))
    nowhere = (np.full(3, -math.inf), np.zeros(3))
    assert spread([near, nowhere, far]) == spread([near, far])
    assert math.isnan(spread([near, nowhere]))
