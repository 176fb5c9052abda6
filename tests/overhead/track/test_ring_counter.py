"""Frames are looked at one by one: what the trial is, and what is known while it goes on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.overhead.track.result import Known, conclude
from epuck_sim.overhead.track.ring_counter import Tracker, follow
from epuck_sim.overhead.track.spread import evaluate, first_synchronised
from tests.overhead.score import Score, compare
from tests.overhead.track.counts import counted, uneven
from tests.overhead.track.films import PLACES, Coded, coded, even, in_step, lens, shoot

NOWHERE = np.empty((0, 2))


@pytest.fixture
def tracker(monkeypatch: pytest.MonkeyPatch) -> Tracker:
    """One that counts what `coded` frames tell."""
    monkeypatch.setattr("epuck_sim.overhead.track.ring_counter.RingFinder", Coded)
    return Tracker(lens())


def looked(tracker: Tracker, counts: list[int], is_lit: list[bool]) -> Tracker:
    """Have a tracker look at frames that are half a second apart."""
    for frame in coded(np.arange(len(counts)) / 2, counts, is_lit):
        assert len(tracker.look(frame)) == frame.picture[0, 0, 2]
    return tracker


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
def test_trial_begins_with_the_first_dark_frame(tracker: Tracker, is_lit: list[bool], first: int) -> None:
    looked(tracker, [3, 1, 4, 1, 5, 9], is_lit)
    assert tracker.start_s == first / 2
    assert tracker.frames == 6
    assert tracker.times_s.tolist() == (np.arange(first, 6) / 2).tolist()
    assert tracker.counts.tolist() == [3, 1, 4, 1, 5, 9][first:]


def test_tracker_that_has_seen_nothing(tracker: Tracker) -> None:
    assert (tracker.frames, tracker.start_s) == (0, 0.0)
    assert tracker.times_s.shape == tracker.counts.shape == (0,)


def test_what_is_told_stays_as_it_was(tracker: Tracker) -> None:
    before = looked(tracker, [1, 2], [False, False]).counts
    before[:] = 7
    assert tracker.counts.tolist() == [1, 2]
    looked(tracker, [5], [False])
    assert before.tolist() == [7, 7]


@given(
    seed=st.integers(0, 2**32 - 1),
    together_s=st.floats(0, 8),
    lit=st.integers(0, 60),
    flickers=st.lists(st.integers(0, 179), max_size=3),
    threshold_s=st.floats(0.02, 0.2),
)
@settings(max_examples=60)
def test_following_a_film_tells_what_its_end_tells(
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
        patch.setattr("epuck_sim.overhead.track.ring_counter.RingFinder", Coded)
        tracker = Tracker(lens())
        moments = list(follow(coded(times_s, counts, is_lit), tracker, 1.0, lambda: threshold_s))
    if not tracker.counts.any():
        return
    track = conclude("film", tracker, "", Known(period_s=1.0, threshold_ms=1000 * threshold_s), ())
    last = moments[-1]

    assert len(moments) == track.frames == len(times_s)
    assert last.start_s == track.start_s
    in_trial = [moment for moment in moments if moment.frame.time_s >= track.start_s]
    assert [moment.evaluation for moment in in_trial if moment.evaluation] == list(track.evaluations)
    assert track.t_sync_s == (None if last.t_sync_s is None else last.t_sync_s - track.start_s)
    is_known = [moment.t_sync_s is not None for moment in in_trial]
    assert is_known == sorted(is_known)


def test_synchrony_in_the_light_is_forgotten_in_the_dark(tracker: Tracker) -> None:
    times_s = np.arange(150) / 15
    counts = counted(0.5 + np.arange(10), 0.1, times_s)
    moments = list(follow(coded(times_s, counts, times_s < 5), tracker, 1.0, lambda: 0.05))
    found = [moment.t_sync_s for moment in moments]
    assert found[74] == pytest.approx(0.5, abs=0.15)
    assert found[75] is None
    assert found[-1] == pytest.approx(5.5, abs=0.15)


def test_follow_looks_at_a_frame_when_it_is_asked_for_it(tracker: Tracker) -> None:
    moments = follow(coded([0, 1, 2], [1, 2, 3], [False] * 3), tracker, 1.0, lambda: 0.1)
    for number in range(3):
        assert tracker.frames == number
        assert len(next(moments).rings) == number + 1


@pytest.mark.parametrize("light", ["dark", "lit"])
def test_rings_are_found_where_robots_are(light: str) -> None:
    times_s = even(3.2)
    ring_on = in_step(times_s)
    tracker = Tracker(lens())
    total = Score()
    for frame, on in zip(shoot(times_s, ring_on, light=light), ring_on, strict=True):
        rings = tracker.look(frame)
        total += compare(np.array([ring[:2] for ring in rings]).reshape(-1, 2), PLACES[on], NOWHERE)
    assert (total.missed, total.false, total.found) == (0, 0, ring_on.sum())
    assert total.worst_cm <= 0.2
    assert tracker.counts.tolist() == ring_on.sum(axis=1).tolist()
    threshold_s = 0.05
    t_sync_s = first_synchronised(evaluate(tracker.times_s, tracker.counts, 1.0, 0.0), threshold_s)
    assert t_sync_s == pytest.approx(2.55)
