"""A film beside simulated trials."""

import math

import numpy as np
import pytest

from epuck_sim import load_scenario
from epuck_sim.errors import FilmError
from epuck_sim.overhead.film_comparison import (
    QUANTITIES,
    Beside,
    compare_film,
    overlay,
    save_overlay,
    track_trial,
)
from epuck_sim.overhead.track.robots import robots_by_motion
from tests.overhead.track.films import TRACK

SCENARIO = load_scenario(
    "thesis", ["robots.0.count=4", "robots.0.parameters.speed_cm_s=1.5", "robots.0.parameters.period_s=2.0", "seed=3"]
)
FILM = TRACK._replace(fps=15.0, duration_s=24.0, options=TRACK.options._replace(period_s=2.0))


def beside(film: float, trials: list[float]) -> Beside:
    return Beside(QUANTITIES[0], film, np.array(trials))


def test_the_percentile_counts_trials_with_smaller_values() -> None:
    assert beside(3.0, [1, 2, 3, 4]).percentile == 62.5
    assert beside(3.0, [1, 2, math.nan, 4]).percentile == pytest.approx(200 / 3)
    assert beside(math.inf, [1, 2, math.inf, math.inf]).percentile == 75
    assert math.isnan(beside(math.nan, [1, 2]).percentile)
    assert math.isnan(beside(1.0, [math.nan]).percentile)


def test_only_many_trials_show_that_a_film_is_unusual() -> None:
    assert beside(50.0, [*range(40)]).is_unusual
    assert beside(-1.0, [*range(40)]).is_unusual
    assert not beside(39.0, [*range(40)]).is_unusual
    assert not beside(50.0, [*range(39)]).is_unusual
    assert not beside(math.nan, [*range(60)]).is_unusual


def test_a_trial_is_tracked_as_if_it_were_filmed() -> None:
    track = track_trial(SCENARIO, 5, FILM)
    assert len(track.times_s) == pytest.approx(24 * 15, abs=1)
    assert track.robots_seen <= 4
    assert track.flashes_per_period == pytest.approx(4, abs=0.6)
    assert track.flash_ms == pytest.approx(200, abs=20)  # two control steps
    robots = robots_by_motion(track)
    assert robots.identities.robots == 4
    assert robots.identities.speed_cm_s == pytest.approx(1.5, rel=0.03)
    assert track_trial(SCENARIO, 5, FILM).flashes == track.flashes
    assert track_trial(SCENARIO, 6, FILM).flashes != track.flashes


def test_a_film_of_the_scenario_itself_is_like_its_trials() -> None:
    film = track_trial(SCENARIO, 12345, FILM)
    rows = compare_film(film, robots_by_motion(film), SCENARIO, 6, lambda trials: trials)
    assert [row.quantity for row in rows] == list(QUANTITIES)
    by_name = {row.quantity.name: row for row in rows}
    speeds = by_name["speed straight ahead"]
    assert speeds.film == pytest.approx(np.median(speeds.trials), rel=0.02)
    assert all(len(row.trials) == 6 for row in rows)
    fast = load_scenario(SCENARIO, ["robots.0.parameters.speed_cm_s=3"])
    other = compare_film(film, robots_by_motion(film), fast, 2, lambda trials: trials)
    assert next(row for row in other if row.quantity.name == "speed straight ahead").percentile == 0


def test_what_a_film_tells_is_written_as_a_scenario(tmp_path) -> None:
    film = track_trial(SCENARIO, 1, FILM)
    start = load_scenario(SCENARIO, ["robots.0.parameters.speed_cm_s=9", "overhead.frames_per_s=10"])
    fitted, values = overlay(start, film, robots_by_motion(film))
    assert fitted.name == "thesis-fitted"
    speed = values["robots.0.parameters.speed_cm_s"]
    assert speed.low <= 1.5 <= speed.high
    assert fitted.robots[0].parameters["speed_cm_s"] == pytest.approx(speed.value, abs=1e-6)
    assert fitted.overhead.frames_per_s == pytest.approx(15)
    save_overlay(tmp_path / "lab.yaml", fitted, values, "film.mp4")
    assert load_scenario(tmp_path / "lab.yaml") == fitted
    comments = [line for line in (tmp_path / "lab.yaml").read_text().splitlines() if line.startswith("#")]
    assert comments[0] == "# Fitted to film.mp4, with 95 % intervals; all else is as it was."
    assert len(comments) == 1 + len(values)


def test_robots_of_several_groups_are_refused() -> None:
    both = load_scenario({"robots": [{"count": 2}, {"count": 3}]})
    with pytest.raises(FilmError, match=r"has 2 groups of robots; allowed: one"):
        overlay(both, TRACK, robots_by_motion(TRACK))
