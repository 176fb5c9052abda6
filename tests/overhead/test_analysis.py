"""Rings are counted frame by frame, and the counts of a whole film analysed: period, flash, synchrony and warnings."""

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.flashes import Flash, FlashLinker, RingCounter, count_lit
from epuck_sim.overhead.light import LightMeter
from epuck_sim.overhead.synchrony import spread_threshold_s
from epuck_sim.overhead.track import Track, analyse, track_frames, without_steady
from tests.overhead.films import code_rings, coded, counted, make_geometry, uneven

RATE = 30.0
PHASES = 0.5 + np.arange(6) / 6


@pytest.fixture(autouse=True, scope="module")
def _rings_are_coded() -> Iterator[None]:
    """Have rings be those coded into frames."""
    with pytest.MonkeyPatch.context() as patch:
        code_rings(patch)
        yield


def make_counter() -> RingCounter:
    return RingCounter(make_geometry()._replace(knows_floor=False))


def analysed(times_s: Any, counts: Any, options: TrackOptions = TrackOptions(), lit_until_s: float = 0.0) -> Track:  # noqa: B008
    """Return the track of a film with these counts."""
    counter = make_counter()
    for frame in coded(times_s, counts, np.asarray(times_s) < lit_until_s):
        counter.process(frame)
    return analyse("film", counter.counted(), options, ("first",))


def swarm(seconds: float = 8.0, from_s: float = 3.0, robots: int = 6) -> tuple[FloatArray, IntArray]:
    """Return times and counts of robots of a period of 1 s that flash for 0.1 s, and together from a time on."""
    times_s = np.arange(round(seconds * RATE)) / RATE
    cycles = np.arange(-1, math.ceil(seconds) + 1)[:, None]
    onsets = cycles + np.where(cycles + 1 < from_s, PHASES[:robots], 0.5)
    return times_s, counted(onsets, 0.1, times_s)


def test_track_of_a_swarm() -> None:
    track = analysed(*swarm())
    assert (track.film, track.calibration, track.frames, track.robots_seen) == ("film", "somewhere", 240, 6)
    assert track.fps == pytest.approx(RATE)
    assert track.duration_s == pytest.approx(8)
    assert track.period_s == pytest.approx(1, abs=0.01)
    assert track.flash_ms == pytest.approx(100, abs=5)
    assert track.threshold_ms == pytest.approx(1000 * spread_threshold_s(track.period_s, track.flash_ms / 1000))
    assert track.estimated == ("period_s", "threshold_ms")
    assert track.flashes_per_period == pytest.approx(51 / 8, rel=0.02)
    assert track.histogram_s == pytest.approx(2.55, abs=0.04) or track.histogram_s == pytest.approx(3.55, abs=0.04)
    assert track.histogram_periods == pytest.approx(track.histogram_s, rel=0.02)
    first, doubt = track.warnings
    assert (first, "2 s fit as well" in doubt) == ("first", True)  # no ring of these pictures has its own place
    assert analysed(*swarm(), TrackOptions(robots=6)).warnings == ("first",)
    assert json.loads(json.dumps(track.summary(), allow_nan=False))["robots_seen"] == 6


def test_flashes_until_synchrony_count_for_each_robot() -> None:
    times_s = np.arange(600) / RATE
    onsets = np.array([*(0.5 + 0.8 * np.arange(8)), *(7.1 + np.arange(13))])  # cycles are shortened at first
    both = np.where(np.arange(21) < 8, onsets + 0.3, onsets)
    track = analysed(times_s, counted(np.concatenate([onsets, both]), 0.1, times_s), TrackOptions(period_s=1.0))
    assert track.robots_seen == 2
    assert track.histogram_s == pytest.approx(7.15, abs=1 / RATE)
    assert track.t_sync_cycles == pytest.approx(9, abs=0.3)
    three = counted(np.concatenate([onsets, both, onsets]), 0.1, times_s)
    assert analysed(times_s, three, TrackOptions(period_s=1.0, robots=3)).t_sync_cycles == pytest.approx(9, abs=0.3)


def test_a_film_that_ends_as_the_swarm_synchronises_is_too_short_to_tell() -> None:
    times_s, counts = swarm(from_s=6.0, seconds=8.0)
    whole, cut = (
        analysed(times_s[times_s < end_s], counts[times_s < end_s], TrackOptions(period_s=1.0, robots=6))
        for end_s in (8.0, 6.54)
    )
    assert (whole.t_sync_s, whole.confidence) == (pytest.approx(6.5, abs=0.6), "low")
    (reason,) = cut.reasons
    assert (cut.t_sync_s, cut.confidence, "ends too early to tell" in reason) == (None, "none", True)


def test_a_lamp_that_flickers_is_no_robot() -> None:
    robots = [Flash(k + 0.5, k + 0.6, 10.0 + 8 * n + 0.7 * k, 20.0, 50.0) for k in range(8) for n in range(4)]
    lamp = [Flash(0.3 * k, 0.3 * k + 0.1, 50.0, 50.0, 90.0) for k in range(26)]
    times_s = np.arange(240) / RATE
    counts = count_lit(sorted(robots + lamp), times_s)
    others, left_out, without = without_steady(tuple(sorted(robots + lamp)), times_s, counts, 1.0)
    assert (sorted(others), sorted(left_out)) == (sorted(robots), lamp)
    assert without.tolist() == count_lit(sorted(robots), times_s).tolist()
    still = tuple(Flash(k + 0.5, k + 0.6, 10.0 + 8 * n, 20.0, 50.0) for k in range(8) for n in range(4))
    for flashes in (tuple(robots), (*still, Flash(0.2, 0.3, 55.0, 55.0, 50.0))):
        assert without_steady(flashes, times_s, counts, 1.0)[1] == ()
    long, short = (Flash(4.0, 4.0 + lit_s, 55.0, 5.0, 50.0) for lit_s in (3.0, 1.0))
    assert without_steady((*robots, long, short), times_s, counts, None)[1] == (long,)


def test_swarm_that_never_synchronises() -> None:
    times_s, counts = swarm(from_s=math.inf)
    track = analysed(times_s, counts, TrackOptions(period_s=1.0))
    assert (track.histogram_s, track.histogram_periods, track.t_sync_cycles) == (None, None, None)
    (reason,) = track.reasons
    assert track.confidence == "low"
    assert "the order parameter was" in reason
    assert reason.endswith("0.95 is needed")  # and no option that `track` refuses
    assert track.flashes_per_period == pytest.approx(6, rel=0.1)
    assert json.loads(json.dumps(track.summary(), allow_nan=False))["histogram_s"] is None


def test_order_parameter_decides_when_the_swarm_is_synchronised() -> None:
    times_s = np.arange(300) / RATE
    off_s = np.where(np.arange(11) < 5, 0.05, 0.0)  # first half in step to 0.1 s, then wholly
    offsets = off_s[:, None] * np.array([-1, -1, 1, 1])
    counts = counted(np.arange(11)[:, None] + 0.5 + offsets, 0.06, times_s)
    strict, loose = (analysed(times_s, counts, TrackOptions(period_s=1.0, order_parameter=r)) for r in (0.9999, 0.9))
    assert loose.t_sync_s == pytest.approx(0.55, abs=0.05)
    assert strict.t_sync_s == pytest.approx(5.5, abs=0.1)


@pytest.mark.parametrize(("frames", "lit"), [(0, 0), (60, 30)])
def test_film_without_light_in_the_dark_is_refused(frames: int, lit: int) -> None:
    counts = np.where(np.arange(frames) < lit, 4, 0)
    with pytest.raises(FilmError, match=rf"^film: no lit ring is seen in {frames} frames;"):
        analysed(np.arange(frames) / RATE, counts, TrackOptions(period_s=1.0), lit_until_s=(lit - 0.5) / RATE)


def test_trial_of_two_frames_has_few_results() -> None:
    with pytest.raises(FilmError, match=r"^film: its trial is one frame long"):
        analysed([0.0], [3], TrackOptions(period_s=1.0))
    for counts in ([3, 3], [0, 3], [3, 0]):
        track = analysed([0.0, 0.1], counts, TrackOptions(period_s=1.0))
        assert (track.histogram_s, track.evaluations) == (None, ())
        json.dumps(track.summary(), allow_nan=False)
        with pytest.raises(FilmError, match=r"^film: the period cannot be estimated from 0\.1 s of film.*--period-s$"):
            analysed([0.0, 0.1], counts)


def process_all(counts: list[int], is_lit: list[bool]) -> RingCounter:
    """Return a counter that has processed frames that are half a second apart."""
    counter = make_counter()
    for frame in coded(np.arange(len(counts)) / 2, counts, is_lit):
        assert len(counter.process(frame)) == frame.picture[0, 0, 2]
    return counter


@pytest.mark.parametrize(
    ("is_lit", "first"),
    [
        ([True] * 5 + [False], 5),
        ([True] * 6, 0),
        ([False, True, True, False, False, False], 0),
        ([True, False, True, True, False, True], 1),
    ],
    ids=["all but one lit", "lit", "goes lit", "flickers"],
)
def test_trial_begins_with_the_first_dark_frame(is_lit: list[bool], first: int) -> None:
    counter = process_all([3, 1, 4, 1, 5, 9], is_lit)
    assert counter.start_s == first / 2
    assert counter.counted().times_s.tolist() == (np.arange(first, 6) / 2).tolist()
    assert counter.counted().counts.tolist() == [3, 1, 4, 1, 5, 9][first:]


def test_ctrl_c_leaves_as_many_counts_as_times(monkeypatch: pytest.MonkeyPatch) -> None:
    counter = process_all([1, 2], [False, False])

    def interrupt(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(LightMeter, "lit_px", interrupt)
    with pytest.raises(KeyboardInterrupt):
        counter.process(next(coded([1.0], [3], [False])))
    counted = counter.counted()
    assert len(counted.times_s) == len(counted.counts) == len(counted.areas_px) == 2


@given(
    seed=st.integers(0, 2**32 - 1),
    together_s=st.floats(0, 8),
    lit=st.integers(0, 60),
    flickers=st.lists(st.integers(0, 179), max_size=3),
    threshold_s=st.floats(0.02, 0.2),
)
@settings(max_examples=12)
def test_tracking_frame_by_frame_agrees_with_the_analysis_of_the_whole_film(
    seed: int, together_s: float, lit: int, flickers: list[int], threshold_s: float
) -> None:
    random = np.random.default_rng(seed)
    onsets = np.arange(-1, 12)[:, None] + 0.5 + random.uniform(-0.05, 0.05, 6)
    onsets = np.where(onsets < together_s, onsets + random.random(6), onsets)
    times_s = uneven(np.arange(180) / 15, random)
    counts = counted(onsets, 0.1, times_s)
    is_lit = np.arange(len(times_s)) < lit
    is_lit[[number for number in flickers if number < len(times_s)]] ^= True
    counter = make_counter()
    frames = coded(times_s, counts, is_lit)
    options = TrackOptions(period_s=1.0, threshold_ms=1000 * threshold_s)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FlashLinker, "lit_since", lambda *_: 0)
        tracked_frames = list(track_frames(frames, counter, 1.0, options))
    if not counter.counted().counts.any():
        return
    track = analyse("film", counter.counted(), options, ())
    assume(not track.steady)  # overlapping flashes may seem to be one ring that stays lit
    last = tracked_frames[-1]

    assert len(tracked_frames) == track.frames == len(times_s)
    assert last.start_s == track.start_s
    in_trial = [tracked for tracked in tracked_frames if tracked.frame.time_s >= track.start_s]
    assert [tracked.evaluation for tracked in in_trial if tracked.evaluation] == list(track.evaluations)
    if track.confidence != "none":
        assert track.histogram_s == (None if last.histogram_s is None else last.histogram_s - track.start_s)
    is_known = [tracked.histogram_s is not None for tracked in in_trial]
    assert is_known == sorted(is_known)
