"""A film in a file is tracked from end to end."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from epuck_sim.epuck import RING_HEIGHT_CM
from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.overhead.annotate import Annotator
from epuck_sim.overhead.calibration import DESCRIPTION, LIGHT, TrackOptions
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.camera_fit import CORNERS, RINGS
from epuck_sim.overhead.film import open_film
from epuck_sim.overhead.flashes import Flash, TrackedFrame
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.track import Track, annotate_film, ring_table, snapshot, track_film
from tests.overhead.films import (
    PLACES,
    SMALL,
    described,
    even,
    flashing,
    in_step,
    make_camera,
    passed,
    read_rings,
    save,
    save_stamped,
    shoot,
)
from tests.overhead.score import Score, compare
from tests.overhead.small_films import cut_off

TIMES = even(4.5)
LIT = in_step(TIMES)


@pytest.fixture(scope="module")
def reel() -> list[Frame]:
    """Frames of six robots that flash together from 2 s on."""
    return shoot(TIMES, LIT)


@pytest.fixture(scope="module")
def lit_reel() -> list[Frame]:
    """The same in the light of the room."""
    return shoot(TIMES, LIT, light="lit")


@pytest.fixture(scope="module")
def named(reel: list[Frame], tmp_path_factory: pytest.TempPathFactory) -> str:
    """A film of them with a description."""
    return save(tmp_path_factory.mktemp("films") / "named.mp4", reel, described())


@pytest.fixture(scope="module")
def foreign(reel: list[Frame], tmp_path_factory: pytest.TempPathFactory) -> str:
    """A film of them without a description."""
    return save(tmp_path_factory.mktemp("films") / "foreign.mp4", reel)


@pytest.fixture(scope="module")
def tracked(named: str) -> Track:
    return track_film(named, TrackOptions(), None, passed)


def score(rows: list[dict[str, float]], times_s: Any, ring_on: Any) -> Score:
    """Compare a table of rings with where they were lit."""
    total = Score()
    for time_s, on in zip(times_s, ring_on, strict=True):
        reported = [(row["x_cm"], row["y_cm"]) for row in rows if abs(row["time_s"] - time_s) < 2e-3]
        total += compare(np.array(reported).reshape(-1, 2), PLACES[on], np.empty((0, 2)))
    return total


# --- a film that is whole ---------------------------------------------------------------------------


def test_described_film_gives_its_trial(tracked: Track, named: str) -> None:
    assert (tracked.film, tracked.frames, tracked.calibration) == (named, len(TIMES), DESCRIPTION)
    assert tracked.counts.tolist() == LIT.sum(axis=1).tolist()
    assert tracked.times_s == pytest.approx(TIMES, abs=1e-4)
    assert (tracked.period_s, tracked.estimated, tracked.warnings) == (1.0, ("threshold_ms",), ())
    assert tracked.robots_seen == 6
    assert tracked.histogram_s == pytest.approx(2.55, abs=1e-3)
    assert tracked.flash_ms == pytest.approx(100, abs=5)


def test_foreign_film_gives_the_same_trial(tracked: Track, foreign: str) -> None:
    track = track_film(foreign, TrackOptions(), None, passed)
    assert (track.calibration, track.estimated) == (RINGS, ("period_s", "threshold_ms"))
    assert track.counts.tolist() == tracked.counts.tolist()
    assert track.period_s == pytest.approx(1, abs=0.01)
    assert track.histogram_s == pytest.approx(tracked.histogram_s)


def test_options_override_the_film(named: str) -> None:
    track = track_film(named, TrackOptions(period_s=1.25, robots=3, threshold_ms=500.0), None, passed)
    assert (track.period_s, track.threshold_ms, track.estimated) == (1.25, 500.0, ())
    assert track.calibration == DESCRIPTION
    assert track.reasons == ("6 rings were lit at once, but there are 3 robots: check --robots, or what else is lit",)
    assert (track.histogram_s, track.confidence) == (None, "none")


def test_rings_are_listed_where_they_are(named: str, tmp_path: Path) -> None:
    track_film(named, TrackOptions(), tmp_path / "rings.csv", passed)
    rows = read_rings(tmp_path / "rings.csv")
    total = score(rows, TIMES, LIT)
    assert (total.found, total.missed, total.false) == (LIT.sum(), 0, 0)
    assert total.worst_cm <= 0.2
    assert all(abs(row["radius_cm"] - 3.5) <= 0.2 for row in rows)
    at_px = make_camera().project(np.array([(row["x_cm"], row["y_cm"], 4.0) for row in rows]))
    assert at_px == pytest.approx(np.array([(row["x_px"], row["y_px"]) for row in rows]), abs=0.01)
    assert [path.name for path in tmp_path.iterdir()] == ["rings.csv"]


def test_corners_that_are_given_are_taken(named: str, tmp_path: Path) -> None:
    corners = make_camera().project(np.array([(0, 0, 0), (60, 0, 0), (60, 60, 0), (0, 60, 0)], float))
    options = TrackOptions(corners_px=tuple((float(x), float(y)) for x, y in corners))
    track = track_film(named, options, tmp_path / "rings.csv", passed)
    assert (track.calibration, track.period_s, track.estimated) == (CORNERS, 1.0, ("threshold_ms",))
    assert track.counts.tolist() == LIT.sum(axis=1).tolist()
    assert score(read_rings(tmp_path / "rings.csv"), TIMES, LIT).worst_cm <= 0.5  # its distortion is not known


def test_scaled_film_is_not_that_of_its_description(reel: list[Frame], tmp_path: Path) -> None:
    name = save(tmp_path / "scaled.mp4", reel, described(width_px=480, height_px=480))
    track = track_film(name, TrackOptions(), None, passed)
    assert (track.calibration, track.period_s) == (RINGS, 1.0)
    assert track.counts.tolist() == LIT.sum(axis=1).tolist()


# --- light ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def begins_lit(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A film that is lit for 1 s, with the same trial after it."""
    times_s = even(5.5)
    frames = shoot(times_s, in_step(times_s, from_s=3), lit_until_s=1 - 1e-9)
    return save(tmp_path_factory.mktemp("films") / "begins_lit.mp4", frames)


def test_trial_begins_in_the_dark(begins_lit: str, tracked: Track, tmp_path: Path) -> None:
    track = track_film(begins_lit, TrackOptions(period_s=1.0), tmp_path / "rings.csv", passed)
    assert (track.calibration, track.frames) == (LIGHT, 165)
    assert track.start_s == pytest.approx(1, abs=1e-4)
    assert track.duration_s == pytest.approx(4.5, abs=1e-3)
    assert track.counts.tolist() == tracked.counts.tolist()
    assert track.histogram_s == pytest.approx(tracked.histogram_s, abs=1e-3)
    assert score(read_rings(tmp_path / "rings.csv"), 1 + TIMES, LIT).worst_cm <= 0.3
    assert snapshot(track).time_s == pytest.approx(3.5, abs=0.1)
    assert len(snapshot(track).rings_px) == 6


def test_lit_film_is_tracked(lit_reel: list[Frame], tmp_path: Path, tracked: Track) -> None:
    name = save(tmp_path / "lit.mp4", lit_reel, described(light="lit"))
    track = track_film(name, TrackOptions(), tmp_path / "rings.csv", passed)
    assert track.start_s == 0
    assert track.counts.tolist() == LIT.sum(axis=1).tolist()
    assert score(read_rings(tmp_path / "rings.csv"), TIMES, LIT).worst_cm <= 0.2
    assert track.histogram_s == pytest.approx(tracked.histogram_s)


def test_light_that_goes_on_for_a_moment_hides_no_ring(
    reel: list[Frame], lit_reel: list[Frame], tmp_path: Path
) -> None:
    frames = [lit_reel[k] if 50 <= k < 55 or 100 <= k < 140 else dark for k, dark in enumerate(reel)]
    track = track_film(save(tmp_path / "flicker.mp4", frames, described()), TrackOptions(), None, passed)
    assert track.start_s == 0
    assert track.counts.tolist() == LIT.sum(axis=1).tolist()


def test_dark_film_is_refused(tmp_path: Path) -> None:
    frames = shoot(even(1), np.zeros((30, 6), bool))
    with pytest.raises(FilmError, match=r"plain\.mp4: no lit ring is seen"):
        track_film(save(tmp_path / "plain.mp4", frames), TrackOptions(), None, passed)
    with pytest.raises(FilmError, match=r"described\.mp4: no lit ring is seen in 30 frames"):
        track_film(save(tmp_path / "described.mp4", frames, described()), TrackOptions(), None, passed)


# --- frames that come as they like ------------------------------------------------------------------

OF_ANY_PERIOD = described() | {"period_s": None}


def test_doubled_and_dropped_frames_move_nothing(reel: list[Frame], tracked: Track, tmp_path: Path) -> None:
    dropped = {20, 40, 41, 83, 110}
    frames = [frame for k, frame in enumerate(reel) if k not in dropped for _ in range(3 if k % 7 == 0 else 1)]
    track = track_film(save_stamped(tmp_path / "doubled.mkv", frames, OF_ANY_PERIOD), TrackOptions(), None, passed)
    kept = [k for k in range(len(reel)) if k not in dropped]
    assert track.counts.tolist() == tracked.counts[kept].tolist()
    assert track.times_s == pytest.approx(TIMES[kept], abs=1e-3)
    assert track.period_s == pytest.approx(1, abs=0.01)
    assert track.histogram_s == pytest.approx(tracked.histogram_s, abs=0.02)
    assert any("left out" in warning for warning in track.warnings)
    assert any("frames were dropped" in warning for warning in track.warnings)


def test_synchrony_is_not_detected_in_a_period_half_of_which_is_missing(reel: list[Frame], tmp_path: Path) -> None:
    frames = [frame for frame in reel if not 2.7 < frame.time_s < 3.05]
    track = track_film(save_stamped(tmp_path / "gap.mkv", frames, described()), TrackOptions(), None, passed)
    assert track.histogram_s == pytest.approx(3.55, abs=0.02)


def test_rate_that_wanders_moves_nothing(tracked: Track, tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    times_s = np.cumsum(random.uniform(0.02, 0.045, 140))
    times_s = np.round(times_s - times_s[0], 3)
    ring_on = in_step(times_s)
    name = save_stamped(tmp_path / "uneven.mkv", shoot(times_s, ring_on), OF_ANY_PERIOD)
    track = track_film(name, TrackOptions(), None, passed)
    assert track.counts.tolist() == ring_on.sum(axis=1).tolist()
    assert track.period_s == pytest.approx(1, abs=0.01)
    assert track.histogram_s == pytest.approx(tracked.histogram_s, abs=0.05)


def test_film_that_was_cut_off_is_tracked_to_its_end(reel: list[Frame], tmp_path: Path) -> None:
    path = tmp_path / "cut.mkv"
    save_stamped(path, reel, described())
    track = track_film(str(cut_off(path, 0.8)), TrackOptions(), None, passed)
    assert track.histogram_s == pytest.approx(2.55, abs=0.02)
    assert track.frames < len(reel)


# --- the moment of synchrony ------------------------------------------------------------------------


def test_snapshot_shows_all_rings_of_the_moment(tracked: Track) -> None:
    shown = snapshot(tracked)
    assert shown.time_s == pytest.approx(2.5 + 1 / 30, abs=1e-3)
    ring_px = make_camera().project(np.column_stack([PLACES, np.full(6, 4.0)]))
    away = np.linalg.norm(shown.rings_px[:, None, :2] - ring_px, axis=2)
    assert away.shape == (6, 6)
    assert (away.min(axis=0) <= 1).all()


def test_snapshot_leaves_out_rings_that_stay_lit(tracked: Track) -> None:
    x_px, y_px, _ = snapshot(tracked).rings_px[0]
    (x_cm, y_cm), *_ = tracked.geometry.camera.back_project(np.array([[x_px, y_px]]), RING_HEIGHT_CM)
    lamp = Flash(0.0, math.inf, float(x_cm), float(y_cm), 80.0)
    shown = snapshot(tracked._replace(steady=(lamp,)))
    assert len(shown.rings_px) == 5
    gone = snapshot(tracked._replace(steady=(lamp._replace(end_s=0.1),)))
    assert len(gone.rings_px) == 6


def test_snapshot_shows_a_mode_that_lasts_for_one_frame(tmp_path: Path) -> None:
    phases = [0.5, 0.5, 0.5, 0.56, 0.56, 0.56]  # all are lit in the third frame only
    name = save(tmp_path / "brief.mp4", shoot(TIMES, flashing(TIMES, phases)), described())
    track = track_film(name, TrackOptions(threshold_ms=100.0), None, passed)
    assert track.evaluations[0].rings == 6
    assert track.histogram_s is not None
    assert len(snapshot(track).rings_px) == 6


def test_snapshot_of_a_swarm_that_never_synchronises_is_the_last_frame(tmp_path: Path) -> None:
    times_s = even(2.55)
    name = save(tmp_path / "never.mp4", shoot(times_s, flashing(times_s, [0.5, 0.8])), described())
    shown = snapshot(track_film(name, TrackOptions(), None, passed))
    assert shown.time_s == pytest.approx(times_s[-1], abs=1e-4)
    assert len(shown.rings_px) == 1


# --- files: whole or nothing ------------------------------------------------------------------------


def breaking(error: type[BaseException], after: int) -> Callable[[Iterable[Frame], float | None], Iterator[Frame]]:
    """Return a progress wrapper that yields some frames and then raises an error."""

    def progress(frames: Iterable[Frame], _: float | None) -> Iterator[Frame]:
        yield from itertools.islice(frames, after)
        raise error

    return progress


def test_annotated_film_has_the_frames_and_a_strip(tracked: Track, tmp_path: Path) -> None:
    annotate_film(tracked, tmp_path / "annotated.mp4", passed)
    with open_film(str(tmp_path / "annotated.mp4")) as film:
        frames = list(film.frames())
        assert film.description is None
    assert [frame.time_s for frame in frames] == pytest.approx(tracked.times_s, abs=1e-4)
    assert frames[0].picture.shape[0] > SMALL["height_px"]
    colours = [frame.picture[:240].astype(int) for frame in frames]
    green = [np.count_nonzero(colour[..., 1] > colour[..., 0] + 40) for colour in colours]
    assert [amount > 10 for amount in green] == (tracked.counts > 0).tolist()
    assert [path.name for path in tmp_path.iterdir()] == ["annotated.mp4"]


@pytest.mark.parametrize("threshold_ms", [None, 10.0])
def test_annotation_says_what_the_track_says(
    named: str, tmp_path: Path, threshold_ms: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    track = track_film(named, TrackOptions(threshold_ms=threshold_ms), None, passed)
    annotated: list[TrackedFrame] = []

    def annotate(annotator: Annotator, tracked: TrackedFrame) -> Any:
        annotated.append(tracked)
        return np.zeros((annotator.height_px, annotator.width_px, 3), np.uint8)

    monkeypatch.setattr(Annotator, "annotate", annotate)
    annotate_film(track, tmp_path / "annotated.mp4", passed)
    assert annotated[-1].histogram_s == track.histogram_s
    assert [tracked.evaluation for tracked in annotated if tracked.evaluation] == list(track.evaluations)
    assert [len(tracked.rings) for tracked in annotated] == track.counts.tolist()


@pytest.mark.parametrize("error", [KeyboardInterrupt, FilmError])
@pytest.mark.parametrize("after", [0, 10])
def test_interrupted_annotation_leaves_nothing(
    tracked: Track, tmp_path: Path, error: type[BaseException], after: int
) -> None:
    with pytest.raises(error):
        annotate_film(tracked, tmp_path / "annotated.mp4", breaking(error, after))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [KeyboardInterrupt, FilmError])
@pytest.mark.parametrize("after", [0, 30])
def test_interrupted_table_leaves_what_was_there(
    named: str, tmp_path: Path, error: type[BaseException], after: int
) -> None:
    (tmp_path / "rings.csv").write_text("older")
    with pytest.raises(error):
        track_film(named, TrackOptions(), tmp_path / "rings.csv", breaking(error, after))
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("rings.csv", "older")]


def test_table_that_cannot_be_written_is_refused(named: str, tmp_path: Path) -> None:
    with pytest.raises(EpuckSimError, match=r"cannot be written"):
        track_film(named, TrackOptions(), tmp_path / "none" / "rings.csv", passed)
    with pytest.raises(EpuckSimError, match=r"cannot be written: is a directory"):
        track_film(named, TrackOptions(), tmp_path, passed)


def test_table_keeps_the_times_of_a_long_film(tmp_path: Path) -> None:
    times_s = 40_000 + np.arange(5) / 15
    with ring_table(tmp_path / "rings.csv") as note:
        for time_s in times_s:
            note(Frame(float(time_s), np.zeros((2, 2, 3), np.uint8)), [Ring(12.345678, 1, 3.5, 10, 10, 5)])
    rows = read_rings(tmp_path / "rings.csv")
    assert [row["time_s"] for row in rows] == pytest.approx(times_s, abs=1e-5, rel=0)
    assert rows[0]["x_cm"] == pytest.approx(12.345678, abs=1e-3)
    assert list(rows[0]) == ["time_s", *Ring._fields]
