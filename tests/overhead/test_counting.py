"""Frames are processed one by one: which belong to the trial, and what is known while it goes on."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.flashes import RingCounter, track_frames
from epuck_sim.overhead.light import LightMeter
from epuck_sim.overhead.synchrony import evaluate, first_synchronised
from epuck_sim.overhead.track import analyse
from tests.overhead.counts import counted, uneven
from tests.overhead.films import PLACES, code_rings, coded, even, in_step, make_geometry, shoot
from tests.overhead.score import Score, compare

NOWHERE = np.empty((0, 2))


@pytest.fixture
def counter(monkeypatch: pytest.MonkeyPatch) -> RingCounter:
    """A counter whose rings are those coded into frames."""
    code_rings(monkeypatch)
    return RingCounter(make_geometry()._replace(knows_floor=False))


def none_steady(_time_s: float) -> int:
    """Say that no ring stays lit."""
    return 0


def process_all(counter: RingCounter, counts: list[int], is_lit: list[bool]) -> RingCounter:
    """Have a counter process frames that are half a second apart."""
    for frame in coded(np.arange(len(counts)) / 2, counts, is_lit):
        assert len(counter.process(frame)) == frame.picture[0, 0, 2]
    return counter


@pytest.mark.parametrize(
    ("is_lit", "first"),
    [
        ([False] * 6, 0),
        ([True] * 2 + [False] * 4, 2),
        ([True] * 5 + [False], 5),
        ([True] * 6, 0),
        ([False, True, True, False, False, False], 0),
        ([True, False, True, True, False, True], 1),
    ],
    ids=["dark", "begins lit", "all but one lit", "lit", "goes lit", "flickers"],
)
def test_trial_begins_with_the_first_dark_frame(counter: RingCounter, is_lit: list[bool], first: int) -> None:
    process_all(counter, [3, 1, 4, 1, 5, 9], is_lit)
    assert counter.start_s == first / 2
    assert counter.counted().frames == 6
    assert counter.times_s.tolist() == (np.arange(first, 6) / 2).tolist()
    assert counter.counts.tolist() == [3, 1, 4, 1, 5, 9][first:]


def test_counter_without_frames(counter: RingCounter) -> None:
    assert (counter.counted().frames, counter.start_s) == (0, 0.0)
    assert counter.times_s.shape == counter.counts.shape == (0,)


def test_counts_returned_are_copies(counter: RingCounter) -> None:
    before = process_all(counter, [1, 2], [False, False]).counts
    before[:] = 7
    assert counter.counts.tolist() == [1, 2]
    process_all(counter, [5], [False])
    assert before.tolist() == [7, 7]


def test_ctrl_c_leaves_as_many_counts_as_times(counter: RingCounter, monkeypatch: pytest.MonkeyPatch) -> None:
    process_all(counter, [1, 2], [False, False])

    def interrupt(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(LightMeter, "lit_px", interrupt)
    with pytest.raises(KeyboardInterrupt):
        process_all(counter, [3], [False])
    assert len(counter.times_s) == len(counter.counts) == len(counter.counted().areas_px) == 2


@given(
    seed=st.integers(0, 2**32 - 1),
    together_s=st.floats(0, 8),
    lit=st.integers(0, 60),
    flickers=st.lists(st.integers(0, 179), max_size=3),
    threshold_s=st.floats(0.02, 0.2),
)
@settings(max_examples=25)
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
    with pytest.MonkeyPatch.context() as patch:
        code_rings(patch)
        counter = RingCounter(make_geometry()._replace(knows_floor=False))
        tracked_frames = list(
            track_frames(coded(times_s, counts, is_lit), counter, 1.0, lambda: threshold_s, none_steady)
        )
    if not counter.counts.any():
        return
    track = analyse("film", counter.counted(), TrackOptions(period_s=1.0, threshold_ms=1000 * threshold_s), ())
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


def test_synchrony_in_the_light_is_forgotten_in_the_dark(counter: RingCounter) -> None:
    times_s = np.arange(150) / 15
    counts = counted(np.repeat(0.5 + np.arange(10), 2), 0.1, times_s)
    tracked_frames = list(track_frames(coded(times_s, counts, times_s < 5), counter, 1.0, lambda: 0.05, none_steady))
    found = [tracked.histogram_s for tracked in tracked_frames]
    assert found[74] == pytest.approx(0.5, abs=0.15)
    assert found[75] is None
    assert found[-1] == pytest.approx(5.5, abs=0.15)


def test_a_frame_is_processed_when_it_is_asked_for(counter: RingCounter) -> None:
    tracked_frames = track_frames(coded([0, 1, 2], [1, 2, 3], [False] * 3), counter, 1.0, lambda: 0.1, none_steady)
    for number in range(3):
        assert counter.counted().frames == number
        assert len(next(tracked_frames).rings) == number + 1


@pytest.mark.parametrize("light", ["dark", "lit"])
def test_rings_are_found_where_robots_are(light: str) -> None:
    times_s = even(3.2)
    ring_on = in_step(times_s)
    counter = RingCounter(make_geometry()._replace(knows_floor=False))
    total = Score()
    for frame, on in zip(shoot(times_s, ring_on, light=light), ring_on, strict=True):
        rings = counter.process(frame)
        total += compare(np.array([ring[:2] for ring in rings]).reshape(-1, 2), PLACES[on], NOWHERE)
    assert (total.missed, total.false, total.found) == (0, 0, ring_on.sum())
    assert total.worst_cm <= 0.2
    assert counter.counts.tolist() == ring_on.sum(axis=1).tolist()
    threshold_s = 0.05
    sync = first_synchronised(evaluate(counter.times_s, counter.counts, 1.0, 0.0), threshold_s)
    assert sync is not None
    assert sync.time_s == pytest.approx(2.55)
