"""A film in a file is tracked from end to end."""

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from epuck_sim.epuck import RING_HEIGHT_CM
from epuck_sim.overhead.annotate import Annotator, TrackedFrame
from epuck_sim.overhead.calibration import DESCRIPTION, LIGHT, TrackOptions
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.flashes import Flash
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.track import Track, look_again, ring_writer, track_film
from tests.overhead.cameras import floor_corners
from tests.overhead.films import (
    LIT,
    PLACES,
    TIMES,
    described,
    even,
    in_step,
    make_camera,
    passed,
    read_rings,
    reel,
    save,
    score_rows,
    shoot,
    write_packets,
)


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> Track:
    """Return what is found in a film that describes itself."""
    name = save(tmp_path_factory.mktemp("films") / "named.mp4", reel(), described())
    return track_film(name, TrackOptions(), Path(name).with_suffix(".csv"), passed)


def test_described_film_gives_its_trial(tracked: Track) -> None:
    assert (tracked.frames, tracked.calibration) == (len(TIMES), DESCRIPTION)
    assert tracked.counts.tolist() == LIT.sum(axis=1).tolist()
    assert tracked.times_s == pytest.approx(TIMES, abs=1e-4)
    assert (tracked.period_s, tracked.estimated, tracked.warnings) == (1.0, ("threshold_ms",), ())
    assert tracked.robots_seen == 6
    assert tracked.histogram_s == pytest.approx(2.55, abs=1e-3)
    assert tracked.flash_ms == pytest.approx(100, abs=5)


def test_trial_begins_in_the_dark(tracked: Track, tmp_path: Path) -> None:
    times_s = even(5.5)
    frames = shoot(times_s, in_step(times_s, from_s=3), lit_until_s=1 - 1e-9)
    name = save(tmp_path / "begins_lit.mp4", frames)
    track = track_film(name, TrackOptions(period_s=1.0), tmp_path / "rings.csv", passed)
    assert (track.calibration, track.frames) == (LIGHT, 165)
    assert track.start_s == pytest.approx(1, abs=1e-4)
    assert track.duration_s == pytest.approx(4.5, abs=1e-3)
    assert track.counts.tolist() == tracked.counts.tolist()
    assert track.histogram_s == pytest.approx(tracked.histogram_s, abs=1e-3)
    truth = ((time_s, PLACES[on], np.empty((0, 2))) for time_s, on in zip(1 + TIMES, LIT, strict=True))
    score = score_rows(read_rings(tmp_path / "rings.csv"), truth)
    assert (score.found, score.missed, score.false, score.worst_cm <= 0.3) == (LIT.sum(), 0, 0, True)
    assert look_again(track, None, passed).time_s == pytest.approx(3.5, abs=0.1)
    assert len(look_again(track, None, passed).rings_px) == 6


def test_doubled_and_dropped_frames_move_nothing(tracked: Track, tmp_path: Path) -> None:
    kept = [k for k in range(len(TIMES)) if k not in {20, 40, 41, 83, 110}]
    frames = [reel()[k] for k in kept for _ in range(3 if k % 7 == 0 else 1)]
    stamps, pictures = [round(1000 * frame.time_s) for frame in frames], [frame.picture for frame in frames]
    comment = json.dumps(described() | {"period_s": None})
    film = write_packets(tmp_path / "doubled.mkv", stamps, pictures=pictures, comment=comment)
    track = track_film(str(film), TrackOptions(), None, passed)
    assert track.counts.tolist() == tracked.counts[kept].tolist()
    assert track.times_s == pytest.approx(TIMES[kept], abs=1e-3)
    assert track.period_s == pytest.approx(1, abs=0.01)
    assert track.histogram_s == pytest.approx(tracked.histogram_s, abs=0.02)
    assert any("left out" in warning for warning in track.warnings)
    assert any("frames were dropped" in warning for warning in track.warnings)


def test_only_numbered_pictures_whose_rate_is_not_given_are_doubted_for_it(tmp_path: Path) -> None:
    for number, frame in enumerate(reel()[:40]):
        cv2.imwrite(str(tmp_path / f"{7 + number}.png"), frame.picture[..., ::-1])
    options = TrackOptions(period_s=1.0, robots=6, corners_px=floor_corners(make_camera()))
    assumed, given = (
        track_film(str(tmp_path / "%d.png"), options._replace(fps=fps), None, passed) for fps in (None, 30.0)
    )
    assert "numbered pictures have no times: 25 frames per second are assumed; give --fps" in assumed.warnings
    assert (given.frames, given.fps, given.warnings) == (40, pytest.approx(30), ())


def test_snapshot_shows_all_rings_of_the_moment(tracked: Track) -> None:
    shown = look_again(tracked, None, passed)
    assert shown.time_s == pytest.approx(2.5 + 1 / 30, abs=1e-3)
    ring_px = make_camera().project(np.column_stack([PLACES, np.full(6, 4.0)]))
    away = np.linalg.norm(shown.rings_px[:, None, :2] - ring_px, axis=2)
    assert away.shape == (6, 6)
    assert (away.min(axis=0) <= 1).all()
    assert look_again(tracked._replace(histogram_s=None), None, passed).time_s == pytest.approx(
        TIMES[-1], abs=1e-4
    )  # never


def test_snapshot_leaves_out_rings_that_stay_lit(tracked: Track) -> None:
    x_px, y_px, _ = look_again(tracked, None, passed).rings_px[0]
    (x_cm, y_cm), *_ = tracked.geometry.camera.back_project(np.array([[x_px, y_px]]), RING_HEIGHT_CM)
    lamp = Flash(0.0, math.inf, float(x_cm), float(y_cm), 80.0)
    shown = look_again(tracked._replace(steady=(lamp,)), None, passed)
    assert len(shown.rings_px) == 5
    gone = look_again(tracked._replace(steady=(lamp._replace(end_s=0.1),)), None, passed)
    assert len(gone.rings_px) == 6


def test_annotation_says_what_the_track_says(tracked: Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    annotated: list[TrackedFrame] = []

    def annotate(annotator: Annotator, tracked: TrackedFrame) -> Any:
        annotated.append(tracked)
        return np.zeros((annotator.height_px, annotator.width_px, 3), np.uint8)

    monkeypatch.setattr(Annotator, "annotate", annotate)
    look_again(tracked, tmp_path / "annotated.mp4", passed)
    assert annotated[-1].histogram_s == tracked.histogram_s
    assert [each.evaluation for each in annotated if each.evaluation] == list(tracked.evaluations)
    assert [len(each.rings) for each in annotated] == tracked.counts.tolist()


def test_table_keeps_the_times_of_a_long_film(tmp_path: Path) -> None:
    times_s = 40_000 + np.arange(5) / 15
    with (tmp_path / "rings.csv").open("w") as file:
        write_rings = ring_writer(file)
        for time_s in times_s:
            write_rings(Frame(float(time_s), np.zeros((2, 2, 3), np.uint8)), [Ring(12.345678, 1, 3.5, 10, 10, 5)])
    rows = read_rings(tmp_path / "rings.csv")
    assert [row["time_s"] for row in rows] == pytest.approx(times_s, abs=1e-5, rel=0)
    assert rows[0]["x_cm"] == pytest.approx(12.345678, abs=1e-3)
    assert list(rows[0]) == ["time_s", *Ring._fields]
