"""What a film tells of its robots: intervals hold what is true."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.overhead.compare import fit_film, fit_uniform
from epuck_sim.overhead.flashes import Flash
from epuck_sim.overhead.robots import find_robots
from epuck_sim.overhead.track import Track
from tests.overhead.films import TRACK

FPS = 15.0
CYCLES = 10
HOMES = np.array([(x, y) for y in (8.0, 20.0, 32.0, 44.0) for x in (8.0, 30.0)])


def track_of(
    seed: int, period_s: float, clock_rate: float, speed_cm_s: float, wheel_speed: float, cycles: int = CYCLES
) -> Track:
    """Return a film of eight robots that see no flashes; its frames come 15 times a second."""
    generator = np.random.default_rng(seed)
    periods_s = period_s * generator.uniform(1 - clock_rate, 1 + clock_rate, len(HOMES))
    speeds = speed_cm_s * generator.uniform(1 - wheel_speed, 1 + wheel_speed, len(HOMES))
    starts_s = generator.uniform(0, period_s, len(HOMES))
    flashes = []
    for robot, home in enumerate(HOMES):
        for cycle in range(cycles):
            onset_s = np.ceil((starts_s[robot] + cycle * periods_s[robot]) * FPS) / FPS
            end_s = np.ceil((starts_s[robot] + cycle * periods_s[robot] + 0.075 * period_s) * FPS) / FPS
            x_cm = home[0] + speeds[robot] * onset_s
            seen = speeds[robot] * (1 + 0.01 * generator.standard_normal())
            flashes.append(Flash(onset_s, end_s, x_cm, home[1], 80.0, seen, 0.0))
    times_s = np.arange(round((cycles + 1) * period_s * FPS)) / FPS
    return TRACK._replace(
        flashes=tuple(sorted(flashes)), times_s=times_s, fps=FPS, period_s=period_s, flash_ms=75 * period_s, start_s=0.0
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("clock_rate", "wheel_speed"), [(0.0, 0.0), (0.01, 0.08)])
def test_intervals_hold_what_is_true(seed: int, clock_rate: float, wheel_speed: float) -> None:
    track = track_of(seed, 4.0, clock_rate, 0.4, wheel_speed)
    robots = find_robots(track)
    assert robots.identities.unsure == 0
    fitted = fit_film(track, robots)
    truth = {
        "robots.0.parameters.speed_cm_s": 0.4,
        "spread.wheel_speed": wheel_speed,
        "robots.0.parameters.period_s": 4.0,
        "spread.clock_rate": clock_rate,
        "robots.0.parameters.flash_fraction": 0.075,
        "overhead.frames_per_s": FPS,
    }
    assert fitted.keys() == truth.keys()
    for key, value in truth.items():
        assert fitted[key].low - 1e-9 <= value <= fitted[key].high + 1e-9, key
    assert fitted["robots.0.parameters.period_s"].high - fitted["robots.0.parameters.period_s"].low < 0.08
    assert (fitted["spread.clock_rate"].low > 0) == (clock_rate > 0)
    assert (fitted["spread.wheel_speed"].low > 0) == (wheel_speed > 0)


def test_robots_that_are_mixed_up_tell_nothing_of_their_differences() -> None:
    track = track_of(0, 4.0, 0.01, 0.4, 0.08)
    robots = find_robots(track)
    unsure = robots._replace(identities=robots.identities._replace(certainty=np.full(len(track.flashes), 0.6)))
    told = fit_film(track, unsure).keys()
    assert told == {"robots.0.parameters.speed_cm_s", "robots.0.parameters.flash_fraction", "overhead.frames_per_s"}


def test_coupled_robots_whose_cycles_are_hardly_ever_their_own_do_not_tell_the_period() -> None:
    track = track_of(0, 4.0, 0.0, 0.0, 0.0, cycles=60)
    generator = np.random.default_rng(0)
    early = [flash._replace(onset_s=flash.onset_s - generator.uniform(0, 1.2)) for flash in track.flashes]
    track = track._replace(flashes=tuple(sorted(early)))
    fitted = fit_film(track, find_robots(track))
    assert "robots.0.parameters.period_s" not in fitted
    assert "spread.clock_rate" not in fitted


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.2))
@settings(max_examples=20, deadline=None)
def test_a_known_spread_is_found(seed: int, half_width: float) -> None:
    generator = np.random.default_rng(seed)
    values = 5 * generator.uniform(1 - half_width, 1 + half_width, 200)
    mean, spread = fit_uniform(values, np.full(200, 0.001))
    assert mean.value == pytest.approx(5, rel=0.05 * half_width + 0.001)
    assert spread.value == pytest.approx(half_width, rel=0.08)
    assert spread.low < spread.value < spread.high


def test_robots_that_stand_have_no_speed_to_differ_in() -> None:
    track = track_of(0, 4.0, 0.0, 0.0, 0.0)
    still = fit_film(track, find_robots(track))
    assert not still.keys() & {"robots.0.parameters.speed_cm_s", "spread.wheel_speed"}
    generator = np.random.default_rng(0)
    shaken = [flash._replace(x_cm_s=0.02 * generator.standard_normal()) for flash in track.flashes]
    moved = track._replace(flashes=tuple(shaken))
    assert "spread.wheel_speed" not in fit_film(moved, find_robots(moved))


def test_values_that_are_all_the_same_have_a_mean() -> None:
    for value in (0.0, 3.0):
        mean, _ = fit_uniform(np.full(4, value), np.zeros(4))
        assert mean.value == pytest.approx(value, abs=1e-6)
