"""A film beside simulated trials."""

import math

import numpy as np
import pytest

from epuck_sim import load_scenario
from epuck_sim.errors import FilmError
from epuck_sim.estimate import Estimate
from epuck_sim.overhead.compare import (
    QUANTITIES,
    UNLIKE,
    QuantityComparison,
    compare_film,
    fit_scenario,
    fitted_values,
    judge,
    track_trial,
)
from epuck_sim.overhead.tags import Readings
from tests.overhead.films import TRACK

SCENARIO = load_scenario(
    "thesis", ["robots.0.count=4", "robots.0.parameters.speed_cm_s=1.5", "robots.0.parameters.period_s=2.0", "seed=3"]
)
FILM = TRACK._replace(fps=15.0, duration_s=24.0, options=TRACK.options._replace(period_s=2.0))
TAGGED = FILM._replace(tags=Readings(np.empty(0), np.empty(0, int), np.empty((0, 3))))


def compared(film: float, trials: list[float]) -> QuantityComparison:
    return QuantityComparison(QUANTITIES[0], film, np.array(trials))


def test_the_percentile_counts_trials_with_smaller_values() -> None:
    assert compared(3.0, [1, 2, 3, 4]).percentile == 62.5
    assert compared(3.0, [1, 2, math.nan, 4]).percentile == pytest.approx(200 / 3)
    assert compared(math.inf, [1, 2, math.inf, math.inf]).percentile == 75
    assert math.isnan(compared(math.nan, [1, 2]).percentile)
    assert math.isnan(compared(1.0, [math.nan]).percentile)


def rows_of(film: list[float], trials: np.ndarray) -> list[QuantityComparison]:
    return [QuantityComparison(*row) for row in zip(QUANTITIES[: len(film)], film, trials.T, strict=True)]


def test_few_films_like_the_trials_are_called_unlike() -> None:
    random = np.random.default_rng(0)
    mixing = np.array([[1.0, 0.9, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 1.0]])  # the first two depend on each other
    p_values = []
    for _ in range(300):
        drawn = 5 + random.standard_normal((41, 3)) @ mixing
        p_values.append(judge(rows_of(drawn[0].tolist(), drawn[1:])).p_value)
    assert np.mean(np.array(p_values) <= UNLIKE) <= 0.08  # exactly 2 of 41, give or take
    assert np.mean(np.array(p_values) <= 0.5) == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(("off", "way"), [(-6.0, "lower"), (6.0, "higher")])
def test_a_verdict_names_what_is_far_off(off: float, way: str) -> None:
    trials = 5 + np.random.default_rng(1).standard_normal((40, 3))
    verdict = judge(rows_of([5.0, 5.0, 5.0 + off], trials))
    assert verdict.p_value == pytest.approx(1 / 41)
    assert verdict.sentence == f"the film is unlike the simulated trials (p = 0.024): flash is {way} than theirs"


def test_what_is_not_known_is_not_judged() -> None:
    trials = 5 + np.random.default_rng(2).standard_normal((40, 2))
    assert "like the simulated trials" in judge(rows_of([5.0, math.nan], trials)).sentence
    trials[:30, 1] = math.nan
    assert judge(rows_of([5.0, 99.0], trials)).p_value > UNLIKE
    verdict = judge(rows_of([math.nan, math.nan], trials))
    assert (math.isnan(verdict.p_value), "nothing can be said" in verdict.sentence) == (True, True)


def test_too_few_trials_and_too_short_a_film_are_said_in_the_one_sentence() -> None:
    trials = 5 + np.random.default_rng(3).standard_normal((40, 1))
    few = judge(rows_of([99.0], trials[:18]))
    assert few.sentence == "18 trials are too few to tell whether the film is like them; give --trials 19 or more"
    assert math.isnan(few.p_value)
    enough = judge(rows_of([99.0], trials[:19]))
    assert (enough.p_value, enough.sentence[:18]) == (0.05, "the film is unlike")
    trials[:21] = math.inf
    verdict = judge(rows_of([math.inf], trials))
    assert verdict.sentence.startswith(
        "21 of 40 trials are not synchronised when the film ends, so film for longer; by"
    )
    assert "the film is like" in verdict.sentence
    assert verdict.p_value > UNLIKE


def test_a_trial_is_tracked_as_if_it_were_filmed() -> None:
    track, robots = track_trial(SCENARIO, 5, FILM)
    assert len(track.times_s) == pytest.approx(24 * 15, abs=1)
    assert track.robots_seen <= 4
    assert track.flashes_per_period == pytest.approx(4, abs=0.6)
    assert track.flash_ms == pytest.approx(200, abs=20)  # two control steps
    assert robots.identities.robots == 4
    assert robots.identities.speed_cm_s == pytest.approx(1.5, rel=0.03)
    assert track_trial(SCENARIO, 5, FILM)[0].flashes == track.flashes
    assert track_trial(SCENARIO, 6, FILM)[0].flashes != track.flashes


def test_a_film_of_the_scenario_itself_is_like_its_trials() -> None:
    film, robots = track_trial(SCENARIO, 12345, FILM)
    rows = compare_film(film, robots, SCENARIO, 6, lambda trials: trials)
    assert [row.quantity for row in rows] == list(QUANTITIES)
    by_name = {row.quantity.name: row for row in rows}
    speeds = by_name["speed straight ahead"]
    assert speeds.film == pytest.approx(np.median(speeds.trials), rel=0.02)
    assert all(len(row.trials) == 6 for row in rows)
    fast = load_scenario(SCENARIO, ["robots.0.parameters.speed_cm_s=3"])
    other = compare_film(film, robots, fast, 2, lambda trials: trials)
    assert next(row for row in other if row.quantity.name == "speed straight ahead").percentile == 0


def test_robots_of_several_groups_are_not_fitted_but_shown() -> None:
    film, robots = track_trial(SCENARIO, 1, FILM)
    both = load_scenario({"robots": [{"count": 2}, {"count": 3}]})
    values = fitted_values(both, film, robots)
    assert values.keys() == {"overhead.frames_per_s"}
    with pytest.raises(FilmError, match=r"has 2 groups of robots; allowed: one"):
        fit_scenario(both, values)


def test_a_speed_beyond_the_wheels_limit_is_fitted_as_the_limit() -> None:
    fast = {"robots.0.parameters.speed_cm_s": Estimate(12.9, 12.5, 13.3)}
    assert fit_scenario(SCENARIO, fast).robots[0].parameters["speed_cm_s"] == 12.8


@pytest.mark.parametrize(("told", "expected"), [(None, None), (9, 4)])
def test_the_number_of_robots_is_told_of_trials_if_it_is_of_the_film(told: int | None, expected: int | None) -> None:
    film = FILM._replace(options=FILM.options._replace(robots=told, corners_px=((0.0, 0.0),) * 4))
    track, _ = track_trial(SCENARIO, 5, film)
    assert track.options == film.options._replace(robots=expected)
    assert track.confidence != "none"


def test_robots_of_trials_are_told_apart_by_tags_where_those_of_the_film_are() -> None:
    mixed = load_scenario(SCENARIO, ["robots.0.count=8", "robots.0.parameters.speed_cm_s=12"])
    by_motion, by_tags = (track_trial(mixed, 5, film)[1] for film in (FILM, TAGGED))
    assert by_motion.identities.unsure > 0.2
    assert (by_tags.by, by_tags.identities.unsure) == ("tags", 0)
    assert by_tags.numbers.tolist() == list(range(8))
    assert (by_tags.identities.robot >= 0).all()
    film, robots = track_trial(mixed, 6, TAGGED)
    rows = compare_film(film, robots, mixed, 2, lambda trials: trials)
    clocks = next(row for row in rows if row.quantity.name == "half-width of clock rates")
    assert clocks.unknown == 0


def test_robots_that_leave_while_they_are_lit_are_nowhere() -> None:
    leaves = [{"at_s": 5 + number / 10, "remove": [number]} for number in range(1, 4)]  # robot 0 is the reference
    scenario = load_scenario(SCENARIO, [f"schedule={leaves}"])
    for seed in range(6):
        track, _ = track_trial(scenario, seed, FILM)
        assert (track.counts[track.times_s > 6] <= 1).all()
        assert not np.isnan(track.flashes).any()
