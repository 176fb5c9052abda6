"""Claims about V_f: where T_sync becomes level, and that a curve that still falls has none."""

import math

import numpy as np
import pytest

from epuck_sim.statistics.curves import Curve, read_curves
from epuck_sim.statistics.extrema import find_fast_speed
from tests.runs.made_folders import MANY_SPEEDS, SPEED, censored, in_memory, sweep, weibull


def level_beyond(speed: float, power: float = 2):
    """Return T_sync that falls like a power of the speed to 50 cycles at `speed`, and is level from there on."""
    return lambda v: 50 * max(1, (speed / v) ** power)


def curve_of(mean, trials: int = 200, stop: int = 5000, hidden: int = 0) -> Curve:
    def law(point):
        is_hidden = point.number < hidden
        return censored(point, trials) if is_hidden else weibull(point, mean(point.axes[SPEED]))

    scenario = sweep({SPEED: MANY_SPEEDS}, trials=trials, stop={"max_cycles": stop})
    (curve,) = read_curves(in_memory(scenario, law), SPEED)
    return curve


@pytest.mark.parametrize("speed", [0.5, 1.5, 4.0])
@pytest.mark.parametrize("hidden", [0, 2])
def test_v_f_is_where_t_sync_is_twice_that_at_the_largest_speed(speed: float, hidden: int) -> None:
    estimate, resampled = find_fast_speed(curve_of(level_beyond(speed), hidden=hidden))
    assert estimate.low < estimate.value < estimate.high < 1.5 * estimate.low
    assert estimate.value == pytest.approx(speed / math.sqrt(2), rel=0.12)
    assert np.median(resampled) == pytest.approx(estimate.value, rel=0.1)


@pytest.mark.parametrize(
    "curve",
    [
        curve_of(lambda v: 60 / v**0.5),
        curve_of(lambda _: 50),
        curve_of(level_beyond(1.5), trials=19),
        curve_of(lambda _: 5000, stop=3000),
    ],
    ids=["still falls", "level", "few trials", "censored"],
)
def test_where_nothing_becomes_level_or_nothing_is_known_there_is_none(curve: Curve) -> None:
    assert find_fast_speed(curve) is None


def test_a_bump_before_v_f_does_not_count() -> None:
    def bump(v):
        return 150 if v < 0.3 else 60 if v < 0.9 else 200 if v < 2.2 else 50

    estimate, _ = find_fast_speed(curve_of(bump))
    assert 2.0 < estimate.value < 3.2
