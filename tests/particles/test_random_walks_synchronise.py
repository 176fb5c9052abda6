"""What docs/open_questions.md claims of random walks and broad speeds, each with trials enough, all of them quick."""

from functools import cache

import numpy as np
import pytest

from tests.particles.test_thesis import times

TRIALS = 30
CENSORED_AT = 100_000

WALKS = {
    "straight": {"kind": "straight"},
    "short runs": {"kind": "brownian", "run_s": 1},
    "long runs": {"kind": "brownian", "run_s": 10},
    "correlated": {"kind": "correlated", "run_s": 1, "persistence": 0.9},
    "levy": {"kind": "levy", "run_s": 1, "exponent": 2},
}


@cache
def mean(speed: float, walk: str, **agents) -> float:
    """Return the mean T_sync of ten agents, in cycles."""
    agents = {"walk": WALKS[walk], **agents}
    return float(times(speed, TRIALS, 10, CENSORED_AT, agents=agents).mean())


@pytest.mark.parametrize("walk", WALKS)
def test_every_walk_has_the_three_regimes_with_the_peak_at_the_speed_of_straight_motion(walk):
    least, peak, fast = mean({"short runs": 0.7}.get(walk, 0.4), walk), mean(3, walk), mean(20, walk)
    assert peak > 2 * least
    assert fast < least / 5


def test_walks_that_diffuse_equally_fast_take_equally_long_in_slow_swarms():
    straight = mean(0.2, "straight")
    short = mean(0.2, "short runs")
    for walk in ("long runs", "correlated"):
        assert short / 2 < mean(0.2 / np.sqrt(10), walk) < 2 * short
    assert short > 4 * straight


@pytest.mark.parametrize("speed", [0.2, 3, 20])
def test_a_brownian_and_a_correlated_walk_of_one_diffusivity_are_alike_at_every_speed(speed):
    assert 0.5 < mean(speed, "long runs") / mean(speed, "correlated") < 2


@pytest.mark.parametrize("walk", WALKS)
def test_within_a_range_t_sync_falls_with_speed_on_every_walk(walk):
    hood = {"kind": "range", "radius_cm": 25}
    agents = {"walk": WALKS[walk]}
    found = [times(speed, TRIALS, 10, CENSORED_AT, agents=agents, neighbourhood=hood).mean() for speed in (0.4, 3, 20)]
    assert found[0] > 2 * found[1] > 4 * found[2]


BROAD = {
    "lognormal": {"speed_distribution": "lognormal", "speed_spread": 2},
    "two speeds": {"speed_distribution": "two_speeds", "fast_share": 0.1, "fast_ratio": 10},
}


@pytest.mark.parametrize("speeds", BROAD)
def test_broad_speeds_lower_the_peak_and_leave_it_in_place(speeds):
    least, peak, fast = (mean(speed, "straight", **BROAD[speeds]) for speed in (0.4, 3, 20))
    assert mean(3, "straight") > 1.5 * peak
    assert peak > 1.8 * least
    assert fast < least / 5


@pytest.mark.parametrize("speeds", BROAD)
def test_broad_speeds_that_last_begin_the_fast_regime_later(speeds):
    assert mean(10, "straight", **BROAD[speeds]) > 1.5 * mean(10, "straight")
