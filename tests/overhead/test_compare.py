"""A film beside simulated trials."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import load_scenario
from epuck_sim.cli.tables import print_comparison
from epuck_sim.estimate import Estimate
from epuck_sim.figures.films import draw_comparison
from epuck_sim.overhead import compare
from epuck_sim.overhead.compare import QUANTITIES, QuantityComparison, compare_film, fit_film, judge, track_trial
from epuck_sim.overhead.flashes import Flash
from epuck_sim.overhead.robots import find_robots
from epuck_sim.overhead.tags import Readings
from epuck_sim.overhead.track import Track
from tests.overhead.films import TRACK

SCENARIO = load_scenario("thesis", ["count=4", "speed_cm_s=1.5", "period_s=2.0", "seed=3"])
FILM = TRACK._replace(fps=15.0, duration_s=24.0, options=TRACK.options._replace(period_s=2.0))
TAGGED = FILM._replace(tags=Readings(np.empty(0), np.empty(0, int), np.empty((0, 3))))


def compared(film: float, trials: list[float]) -> QuantityComparison:
    return QuantityComparison("T_sync", "cycles", film, np.array(trials))


def test_the_percentile_counts_trials_with_smaller_values_and_beyond_the_end_of_a_film_is_named(capsys) -> None:
    assert compared(3.0, [1, 2, 3, 4]).percentile == 62.5
    assert compared(3.0, [1, 2, math.nan, 4]).percentile == pytest.approx(200 / 3)
    assert compared(math.inf, [1, 2, math.inf, math.inf]).percentile == 75
    rounded = compared(5 + 1e-15, [5.0, 5.0, 5 + 2e-15])
    assert rounded.percentile == 50
    panel, other, *_ = draw_comparison([rounded, compared(2.0, [1.0, 3.0, math.inf])]).axes
    assert other.get_title("left").splitlines() == ["1 trial beyond the film's end", "film at 33 %"]
    assert (panel.get_xlabel(), panel.get_yticks().tolist()) == (r"$T_\mathrm{sync}$ (cycles)", [0, 1, 2, 3, 4])
    assert panel.patches[0].get_edgecolor()[3] == 1  # which shows a bar that is narrower than a pixel
    assert math.isnan(compared(math.nan, [1, 2]).percentile)
    assert math.isnan(compared(1.0, [math.nan]).percentile)
    unknown = compared(math.nan, [3.0, 4.0, 5.0])._replace(name="clocks")
    print_comparison(TRACK, "thesis", [compared(math.inf, [3.0, math.inf, math.inf]), unknown], {})
    told = capsys.readouterr().out
    assert "beyond [3, beyond]" in told
    assert "clocks" not in told


def rows_of(film: list[float], trials: np.ndarray) -> list[QuantityComparison]:
    return [QuantityComparison(*named, *row) for named, *row in zip(QUANTITIES, film, trials.T, strict=False)]


def test_few_films_like_the_trials_are_called_unlike_and_a_verdict_names_what_is_far_off_and_known() -> None:
    random = np.random.default_rng(0)
    mixing = np.array([[1.0, 0.9, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 1.0]])  # the first two depend on each other
    p_values = []
    for _ in range(300):
        drawn = 5 + random.standard_normal((41, 3)) @ mixing
        p_values.append(judge(rows_of(drawn[0].tolist(), drawn[1:])).p_value)
    assert np.mean(np.array(p_values) <= compare.UNLIKE) <= 0.08  # exactly 2 of 41, give or take
    assert np.mean(np.array(p_values) <= 0.5) == pytest.approx(0.5, abs=0.1)
    trials = 5 + np.random.default_rng(1).standard_normal((40, 3))
    for off, way in ((-6.0, "shorter"), (6.0, "longer")):
        verdict = judge(rows_of([5.0, 5.0, 5.0 + off], trials))
        assert verdict.p_value == pytest.approx(1 / 41)
        unlike = "the film is unlike the simulated trials (p = 0.024): "
        assert verdict.sentence == f"{unlike}flash duration {way} than theirs"
    trials = 5 + np.random.default_rng(1).standard_normal((40, 5))
    assert judge(rows_of([5.0, 5.0, 1.0, -3.0, 15.0], trials)).sentence == (
        f"{unlike}speed straight ahead higher, median cycle shorter, flash duration shorter than theirs; if flash and "
        "cycle are so by the same factor, check the film's clock (--fps)"
    )
    trials = 5 + np.random.default_rng(2).standard_normal((40, 2))
    assert "like the simulated trials" in judge(rows_of([5.0, math.nan], trials)).sentence
    trials[:30, 1] = math.nan
    assert judge(rows_of([5.0, 99.0], trials)).p_value > compare.UNLIKE
    verdict = judge(rows_of([math.nan, math.nan], trials))
    assert (math.isnan(verdict.p_value), "nothing can be said" in verdict.sentence) == (True, True)


def test_one_trial_hides_no_film_that_is_far_off_and_too_few_trials_and_too_short_a_film_are_said() -> None:
    trials = np.full((40, 3), math.inf)
    trials[3, 0], trials[5, 1] = 8.0, 9.0
    trials[:, 2] = np.random.default_rng(0).normal(401, 2, 40)
    for film, off in (([math.inf, math.inf, 384.0], "flash duration"), ([7.0, math.inf, 401.0], "T_sync")):
        verdict = judge([row._replace(end=20.0) for row in rows_of(film, trials)])
        assert verdict.p_value <= 2 / 41
        assert f"{off} shorter than" in verdict.sentence
    trials = 5 + np.random.default_rng(3).standard_normal((40, 1))
    few = judge(rows_of([99.0], trials[:18]))
    assert few.sentence == "18 trials are too few to tell whether the film is like them; give --trials 19 or more"
    assert math.isnan(few.p_value)
    enough = judge(rows_of([99.0], trials[:19]))
    assert (enough.p_value, enough.sentence[:18]) == (0.05, "the film is unlike")
    trials = np.append(np.full(37, 5.0), (4.0, 6.2))[:, None]  # one of 39 is farther off than the film
    assert judge(rows_of([6.1], trials)).sentence.endswith("(p = 0.05): T_sync longer than theirs")
    trials = 8 + np.random.default_rng(3).standard_normal((40, 1))
    never = [row._replace(end=148.0) for row in rows_of([math.inf], trials)]
    assert judge(never).p_value == pytest.approx(1 / 41)
    trials = 5 + np.random.default_rng(3).standard_normal((40, 1))
    trials[:21] = math.inf
    verdict = judge(rows_of([math.inf], trials))
    longer = "21 of 40 trials are not synchronised when the film ends, so film for longer; as"
    assert verdict.sentence.startswith(longer)
    assert "the film is like" in verdict.sentence
    assert verdict.p_value > compare.UNLIKE
    trials[18:26] = math.nan  # films of these end too early to tell
    assert "18 of 32 trials are not synchronised" in judge(rows_of([math.inf], trials)).sentence


def test_a_trial_is_tracked_as_if_it_were_filmed_and_told_the_number_of_robots_if_the_film_is() -> None:
    robots = track_trial(SCENARIO, 5, FILM)
    track = robots.track
    assert len(track.times_s) == pytest.approx(24 * 15, abs=1)
    assert track.robots_seen <= 4
    assert track.flashes_per_period == pytest.approx(4, abs=0.6)
    assert track.flash_ms == pytest.approx(200, abs=20)  # two control steps
    assert robots.identities.robots == 4
    assert robots.identities.speed_cm_s == pytest.approx(1.5, rel=0.03)
    assert track_trial(SCENARIO, 5, FILM).track.flashes == track.flashes
    assert track_trial(SCENARIO, 6, FILM).track.flashes != track.flashes
    slower = load_scenario(SCENARIO, ["schedule=[{at_cycle: 1, set: {robots.0.parameters.speed_cm_s: 0.5}}]"])
    assert track_trial(slower, 5, FILM).identities.speed_cm_s == pytest.approx(0.5, rel=0.1)
    for told, expected in ((None, None), (9, 4)):
        film = FILM._replace(options=FILM.options._replace(robots=told, corners_px=((0.0, 0.0),) * 4))
        track = track_trial(SCENARIO, 5, film).track
        assert track.options == film.options._replace(robots=expected)
        assert track.confidence != "none"


@pytest.mark.parametrize(("period_s", "doubted"), [(2.0, False), (1.8, True), (2.4, True)])
def test_a_wrong_period_or_clock_is_doubted_of_a_swarm_that_is_never_in_step(period_s: float, doubted: bool) -> None:
    film = FILM._replace(options=FILM.options._replace(period_s=period_s, robots=4))
    track = track_trial(load_scenario(SCENARIO, ["robots.0.parameters.coupling=0"]), 5, film).track
    assert track.t_sync_s is None
    assert any(f"robots flash every 2 s, not every {period_s:g} s" in each for each in track.warnings) == doubted


def test_a_film_of_the_scenario_itself_is_like_its_trials() -> None:
    film = track_trial(SCENARIO, 12345, FILM)
    rows = compare_film(film, SCENARIO, 6, lambda trials: trials)
    assert [row[:2] for row in rows] == list(QUANTITIES)
    by_name = {row.name: row for row in rows}
    speeds = by_name["speed straight ahead"]
    assert speeds.film == pytest.approx(np.median(speeds.trials), rel=0.02)
    assert all(len(row.trials) == 6 for row in rows)
    fast = load_scenario(SCENARIO, ["robots.0.parameters.speed_cm_s=3"])
    other = compare_film(film, fast, 2, lambda trials: trials)
    assert next(row for row in other if row.name == "speed straight ahead").percentile == 0
    aside = film._replace(track=film.track._replace(geometry=film.track.geometry._replace(knows_floor=False)))
    measured = QUANTITIES["flashes within 5 cm of a wall", "share"]
    assert (measured(film) > 0, math.isnan(measured(aside))) == (True, True)


def test_robots_of_several_groups_are_not_fitted_none_is_faster_than_its_wheels_and_equal_values_have_a_mean(tmp_path):
    film = track_trial(SCENARIO, 1, FILM)
    both = load_scenario({"robots": [{"count": 2}, {"count": 3}]})
    assert compare.fitted_values(both, film).keys() == {"overhead.frames_per_s"}
    film_values = {"robots.0.parameters.speed_cm_s": 12.9, "overhead.frames_per_s": 200.0}
    fast = {key: Estimate(value, 0.99 * value, 1.01 * value) for key, value in film_values.items()}
    compare.save_fitted(tmp_path / "fast.yaml", SCENARIO, fast, "film.mp4")
    saved = load_scenario(tmp_path / "fast.yaml")
    assert (saved.robots[0].parameters["speed_cm_s"], saved.overhead.exposure_ms) == (12.8, 5.0)
    for value in (0.0, 3.0):
        mean, _ = compare.fit_uniform(np.full(4, value), np.zeros(4))
        assert mean.value == pytest.approx(value, abs=1e-6)


def test_robots_of_trials_are_told_apart_by_tags_as_in_the_film_and_those_that_leave_are_nowhere() -> None:
    mixed = load_scenario(SCENARIO, ["robots.0.count=8", "robots.0.parameters.speed_cm_s=12"])
    by_motion, by_tags = (track_trial(mixed, 5, film) for film in (FILM, TAGGED))
    assert by_motion.identities.unsure > 0.2
    assert (by_tags.by, by_tags.identities.unsure) == ("tags", 0)
    assert by_tags.numbers.tolist() == list(range(8))
    assert (by_tags.identities.robot >= 0).all()
    rows = compare_film(track_trial(mixed, 6, TAGGED), mixed, 2, lambda trials: trials)
    assert next(row for row in rows if row.name == "half-width of clock rates").unknown == 0
    leaves = [{"at_s": 5 + number / 10, "remove": [number]} for number in range(1, 4)]  # robot 0 is the reference
    scenario = load_scenario(SCENARIO, [f"schedule={leaves}"])
    for seed in range(6):
        track = track_trial(scenario, seed, FILM).track
        assert (track.counts[track.times_s > 6] <= 1).all()
        assert not np.isnan(track.flashes).any()


FPS = 15.0
HOMES = np.array([(x, y) for y in (8.0, 20.0, 32.0, 44.0) for x in (8.0, 30.0)])


def track_of(seed: int, clock_rate=0.0, speed_cm_s=0.0, wheel_speed=0.0, *, cycles: int = 10) -> Track:
    """Return a film of eight robots that see no flashes; its frames come 15 times a second."""
    generator, period_s = np.random.default_rng(seed), 4.0
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
    times = {"times_s": np.arange(round((cycles + 1) * period_s * FPS)) / FPS, "fps": FPS, "start_s": 0.0}
    return TRACK._replace(flashes=tuple(sorted(flashes)), period_s=period_s, flash_ms=75 * period_s, **times)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("clock_rate", "wheel_speed"), [(0.0, 0.0), (0.01, 0.08)])
def test_intervals_hold_what_is_true(seed: int, clock_rate: float, wheel_speed: float) -> None:
    robots = find_robots(track_of(seed, clock_rate, 0.4, wheel_speed))
    assert robots.identities.unsure == 0
    fitted = fit_film(robots)
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
    flash, by_steps = (found["robots.0.parameters.flash_fraction"] for found in (fitted, fit_film(robots, 0.1)))
    off = (flash.value - by_steps.value) * fitted["robots.0.parameters.period_s"].value
    assert (off, by_steps.high) == (pytest.approx(0.05), flash.high)
    assert by_steps.low < flash.low


def test_robots_mixed_up_tell_no_differences_coupled_ones_no_period_and_those_that_stand_no_speed() -> None:
    track = track_of(0, 0.01, 0.4, 0.08)
    robots = find_robots(track)
    unsure = robots._replace(identities=robots.identities._replace(certainty=np.full(len(track.flashes), 0.6)))
    told = fit_film(unsure).keys()
    assert told == {"robots.0.parameters.speed_cm_s", "robots.0.parameters.flash_fraction", "overhead.frames_per_s"}
    track = track_of(0, cycles=60)  # coupled, so that hardly any cycle is a robot's own
    generator = np.random.default_rng(0)
    early = [flash._replace(onset_s=flash.onset_s - generator.uniform(0, 1.2)) for flash in track.flashes]
    track = track._replace(flashes=tuple(sorted(early)))
    fitted = fit_film(find_robots(track))
    assert "robots.0.parameters.period_s" not in fitted
    assert "spread.clock_rate" not in fitted
    track = track_of(0)
    still = fit_film(find_robots(track))
    assert not still.keys() & {"robots.0.parameters.speed_cm_s", "spread.wheel_speed"}
    generator = np.random.default_rng(0)
    shaken = (flash._replace(x_cm_s=0.02 * generator.standard_normal()) for flash in track.flashes)
    moved = track._replace(flashes=tuple(shaken))
    assert "spread.wheel_speed" not in fit_film(find_robots(moved))


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.2))
@settings(max_examples=8)
def test_a_known_spread_is_found(seed: int, half_width: float) -> None:
    generator = np.random.default_rng(seed)
    values = 5 * generator.uniform(1 - half_width, 1 + half_width, 200)
    mean, spread = compare.fit_uniform(values, np.full(200, 0.001))
    assert mean.value == pytest.approx(5, rel=0.05 * half_width + 0.001)
    assert spread.value == pytest.approx(half_width, rel=0.08)
    assert spread.low < spread.value < spread.high
