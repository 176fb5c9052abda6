"""Frames are processed one by one: which belong to the trial, and what is known while it goes on."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.flashes import RingCounter, track_frames
from epuck_sim.overhead.light import LightMeter
from epuck_sim.overhead.track import analyse
from tests.overhead.counts import counted, uneven
from tests.overhead.films import code_rings, coded, make_geometry

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
