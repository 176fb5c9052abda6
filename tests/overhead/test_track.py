"""Films in files are tracked from end to end, ours, another renderer's and spoilt ones, and annotated."""

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, strategies as st

from docs.figures.overhead_confidence import examine
from epuck_sim.errors import FilmError
from epuck_sim.overhead import annotate
from epuck_sim.overhead.annotate import BARS, BLUE, CYAN, GREY, OLD_BARS, WHITE, Annotator, TrackedFrame
from epuck_sim.overhead.calibration import DESCRIPTION, LIGHT, TrackOptions
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.flashes import Flash
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.synchrony import Evaluation
from epuck_sim.overhead.track import Track, look_again, ring_writer, track_film
from tests.overhead import films, webcam
from tests.overhead.cameras import floor_corners
from tests.overhead.films import LIT, PLACES, TIMES, passed, read_rings, reel, save, score_rows


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> Track:
    """Return what is found in a film that describes itself."""
    name = save(tmp_path_factory.mktemp("films") / "named.mp4", reel(), films.described())
    return track_film(name, TrackOptions(), Path(name).with_suffix(".csv"), passed)


def test_described_film_gives_its_trial_and_a_snapshot_all_its_rings_but_those_that_stay_lit(tracked: Track) -> None:
    assert (tracked.frames, tracked.calibration) == (len(TIMES), DESCRIPTION)
    assert tracked.counts.tolist() == LIT.sum(axis=1).tolist()
    assert tracked.times_s == pytest.approx(TIMES, abs=1e-4)
    assert (tracked.period_s, tracked.estimated, tracked.warnings) == (1.0, ("threshold_ms",), ())
    assert tracked.robots_seen == 6
    assert tracked.histogram_s == pytest.approx(2.55, abs=1e-3)
    assert tracked.flash_ms == pytest.approx(100, abs=5)
    shown = look_again(tracked, None, passed)
    assert shown.frame.time_s == pytest.approx(2.5, abs=1e-3)
    ring_px = films.make_camera().project(np.column_stack([PLACES, np.full(6, 4.0)]))
    away = np.linalg.norm(np.array([ring[3:5] for ring in shown.rings])[:, None] - ring_px, axis=2)
    assert away.shape == (6, 6)
    assert (away.min(axis=0) <= 1).all()
    never = look_again(tracked._replace(t_sync_s=None), None, passed)
    assert never.frame.time_s == pytest.approx(tracked.times_s[tracked.counts.argmax()], abs=1e-4)
    lamp = Flash(0.0, math.inf, *shown.rings[0][:2], 80.0)
    for steady, seen in ((lamp, 5), (lamp._replace(end_s=0.1), 6)):
        assert len(look_again(tracked._replace(steady=(steady,)), None, passed).rings) == seen
    with pytest.raises(FilmError, match="has fewer frames than when it was tracked"):
        look_again(tracked._replace(times_s=tracked.times_s + 60), None, passed)


def test_trial_begins_in_the_dark(tracked: Track, tmp_path: Path) -> None:
    times_s = films.even(5.5)
    frames = films.shoot(times_s, films.in_step(times_s, from_s=3), lit_until_s=1 - 1e-9)
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
    assert look_again(track, None, passed).frame.time_s == pytest.approx(3.5, abs=0.1)
    assert len(look_again(track, None, passed).rings) == 6


def test_doubled_and_dropped_frames_move_nothing(tracked: Track, tmp_path: Path) -> None:
    kept = [k for k in range(len(TIMES)) if k not in {20, 40, 41, 83, 110}]
    frames = [reel()[k] for k in kept for _ in range(3 if k % 7 == 0 else 1)]
    stamps, pictures = [round(1000 * frame.time_s) for frame in frames], [frame.picture for frame in frames]
    comment = json.dumps(films.described() | {"period_s": None})
    film = films.write_packets(tmp_path / "doubled.mkv", stamps, pictures=pictures, comment=comment)
    track = track_film(str(film), TrackOptions(), None, passed)
    assert track.counts.tolist() == tracked.counts[kept].tolist()
    assert track.times_s == pytest.approx(TIMES[kept], abs=1e-3)
    assert track.period_s == pytest.approx(1, abs=0.01)
    assert track.histogram_s == pytest.approx(tracked.histogram_s, abs=0.02)
    assert any("left out" in warning for warning in track.warnings)
    assert any("frames were dropped" in warning for warning in track.warnings)


def test_a_film_that_was_cut_off_does_not_say_never_and_pictures_of_unknown_rate_are_doubted(tmp_path: Path) -> None:
    path = films.cut_off(Path(save(tmp_path / "cut.mp4", reel())), 0.5)
    track = track_film(str(path), TrackOptions(period_s=1.0), None, passed)
    assert (track.t_sync_s, track.confidence, track.reasons[0][:19]) == (None, "none", "the film ends early")
    for number, frame in enumerate(reel()[:40]):
        cv2.imwrite(str(tmp_path / f"{7 + number}.png"), frame.picture[..., ::-1])
    options = TrackOptions(period_s=1.0, robots=6, corners_px=floor_corners(films.make_camera()))
    both = options, options._replace(fps=30.0)
    assumed, given = (track_film(str(tmp_path / "%d.png"), each, None, passed) for each in both)
    assert "numbered pictures have no times: 25 frames per second are assumed; give --fps" in assumed.warnings
    assert (given.frames, given.fps, given.warnings) == (40, pytest.approx(30), ())


def test_annotation_says_what_the_track_says(tracked: Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    annotated: list[TrackedFrame] = []

    def note(annotator: Annotator, tracked: TrackedFrame) -> Any:
        annotated.append(tracked)
        return np.zeros((annotator.height_px, annotator.width_px, 3), np.uint8)

    monkeypatch.setattr(Annotator, "annotate", note)
    look_again(tracked, tmp_path / "annotated.mp4", passed)
    assert annotated[-1][-2:] == (tracked.histogram_s, tracked.t_sync_s)
    (first_s, *_) = (each.frame.time_s for each in annotated if each.t_sync_s)
    assert first_s == pytest.approx(tracked.t_sync_s + tracked.period_s / 2, abs=0.04)
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


SLOW_KINDS = [pytest.param(kind, marks=pytest.mark.slow) for kind in ("orange", "flicker in bands")]
SHINING = [("lamp", 0.06), ("screen", 0.08)]  # which is told from rings, and doubted
SLOW_EFFECTS = [
    pytest.param(kind, strengths[-1], marks=pytest.mark.slow)
    for kind, (_, strengths) in webcam.EFFECTS.items()
    if kind not in {"burnt out", "rolling shutter"}  # flashes of 1.4 frames are cut in the middle
]
OF_POINTS = webcam.KINDS["points"]._replace(is_fisheye=True, above_cm=38.0, focal_px=320.0)


def track_of(folder: Path, camera: webcam.Webcam, filmed: webcam.Swarm, *extras) -> tuple[Track, films.Score]:
    """Return what is found in a film of a swarm, told all about it, and how well its rings are found."""
    table, shot = folder / "rings.csv", list(webcam.shoot(camera, filmed, 12.0, extras))
    film = save(folder / "film.mp4", [frame for frame, _ in shot])
    truth = [(frame.time_s, lit_cm, np.empty((0, 2))) for frame, lit_cm in shot]
    floor = tuple((float(x), float(y)) for x, y in camera.floor_px(filmed.arena_cm))
    told = TrackOptions(filmed.arena_cm, camera.above_cm, floor, filmed.period_s, len(filmed.homes_cm))
    return track_film(film, told, table, passed), score_rows(read_rings(table), truth)


@pytest.mark.parametrize("kind", ["burnt out, white", "fisheye of points", "typical webcam", *SLOW_KINDS])
def test_rings_are_found_where_they_are(kind: str, tmp_path: Path) -> None:
    camera = (webcam.KINDS | {"fisheye of points": OF_POINTS})[kind]
    track, score = track_of(tmp_path, camera.scaled(0.4), webcam.swarm(5, 4, 2, seed=1, period_s=1.6))
    assert score.found + score.missed > 20
    assert (score.recall >= 0.95, score.precision >= 0.99, score.rms_cm <= 0.4) == (True, True, True), score
    assert track.reasons == ()
    assert track.t_sync_cycles == 3


def test_what_is_outside_of_the_floor_and_what_never_goes_off_are_left_out(tmp_path: Path) -> None:
    robots = webcam.swarm(4, 4, 2, seed=2, period_s=1.6)
    neighbour = webcam.Extra((68.0, 30.0), tuple(0.3 + 1.3 * np.arange(5)), 0.3)
    places = [(x, y) for x in (10.0, 30.0, 50.0) for y in (10.0, 30.0, 50.0)]
    free = max(places, key=lambda place: np.hypot(*(robots.homes_cm - place).T).min())
    camera = webcam.GOOD._replace(focal_px=640.0, size_px=(640, 480)).scaled(0.4)
    track, _ = track_of(tmp_path, camera, robots, neighbour, webcam.Extra(free))
    assert (track.rings_outside > 10, track.always_lit, track.confidence) == (True, 1, "low")
    assert track.histogram_periods == pytest.approx(2.55, abs=0.25)
    assert any("outside of the floor" in warning for warning in track.warnings)
    assert any("stayed lit" in warning for warning in track.warnings)


@pytest.mark.parametrize(("kind", "strength"), [("burnt out", 40.0), ("groups apart", 2), *SHINING, *SLOW_EFFECTS])
def test_an_answer_is_right_or_doubtful(kind: str, strength: float) -> None:
    effect, seed, groups = (iter, 3, 2) if kind == "groups apart" else (webcam.EFFECTS[kind][0](strength), 1, 1)
    _, confidence, is_right = examine(effect, seed, groups)
    assert is_right or confidence != "high"
    if (kind, strength) in SHINING:
        assert (is_right, confidence) == (True, "low")


PERIOD_S = 5.0


def ring(*seen_px: float) -> Ring:
    return Ring(0.0, 0.0, 3.5, *seen_px)


def rings(count: int) -> list[Ring]:
    return [ring(30 + 40 * number, 50, 15) for number in range(count)]


def spread(spread_s: float) -> Evaluation:
    return Evaluation(0.0, 2, spread_s, 1.0)


class Film:
    """An annotated film of black pictures."""

    def __init__(self, width_px: int = 480, height_px: int = 480) -> None:
        self.annotator = Annotator(width_px, height_px, PERIOD_S)
        self.black = np.zeros((height_px, width_px, 3), np.uint8)

    def add(self, time_s: float, found=(), start_s=0.0, evaluation=None, histogram_s=None) -> np.ndarray:
        """Return the strip below the next picture."""
        tracked = TrackedFrame(Frame(time_s, self.black), found, start_s, evaluation, histogram_s)
        self.picture = self.annotator.annotate(tracked)
        return self.picture[len(self.black) :]

    def add_counts(self, counts: dict[float, int], start_s: float = 0.0) -> np.ndarray:
        """Return the strip below the last of some pictures; counts: number of rings by time."""
        return [self.add(time_s, rings(count), start_s) for time_s, count in counts.items()][-1]


def has(picture: np.ndarray, *colours: tuple[int, int, int]) -> np.ndarray:
    return np.any([(picture == colour).all(axis=-1) for colour in colours], axis=0)


@pytest.mark.parametrize("size", [(480, 480), (241, 239), (65, 64)])
def test_both_sides_are_even_and_the_picture_is_untouched(size):
    annotator = Annotator(*size, PERIOD_S)
    picture = np.random.default_rng(0).integers(0, 256, (size[1], size[0], 3), np.uint8)
    before = picture.copy()
    annotated = annotator.annotate(TrackedFrame(Frame(3.0, picture), (), 0.0, None, None))
    assert annotated.shape == (annotator.height_px, annotator.width_px, 3)
    assert annotator.width_px % 2 == annotator.height_px % 2 == 0
    np.testing.assert_array_equal(annotated[: size[1], : size[0]], before)
    assert not annotated[: size[1] + size[1] % 2, size[0] :].any()
    annotator.annotate(TrackedFrame(Frame(3.1, picture), [ring(32, 32, 9)], 0.0, None, None))
    np.testing.assert_array_equal(picture, before)


@pytest.mark.parametrize(("x", "y", "radius"), [(250.3, 100.7, 25.6), (35.5, 440.5, 27.25)])
def test_rings_are_drawn_where_they_were_found(x, y, radius):
    """The centre of gravity and the mean radius of their green part are those of the ring, to a fraction of a pixel."""
    film = Film()
    film.add(0.0, [ring(x, y, radius)])
    green = film.picture[:480, :, 1].astype(float)
    rows, columns = np.mgrid[:480, :480]
    far = np.hypot(columns - x, rows - y)
    assert not film.picture[:480, :, 0].any()
    assert green.max() == CYAN[1]
    assert not green[np.abs(far - radius) > 4].any()
    middle = [(green * values).sum() / green.sum() for values in (far, columns, rows)]
    assert middle == pytest.approx([radius, x, y], abs=0.3)


def test_bars_are_as_high_as_the_counts_and_paler_after_a_period():
    """The present is at the right edge, and ten seconds ago at the left one; marks are around the last period."""
    lengths = has(Film().add(0.0), BLUE).sum(axis=0)
    assert np.flatnonzero(lengths).tolist() == [239, 240, 359, 360, 478, 479]
    assert 0 < 2 * lengths[359] < lengths[239] == lengths[479]
    strip = Film().add_counts({0.0: 1, 1.0: 2, 2.0: 4, 3.0: 8, 4.0: 0, 4.5: 0})
    heights = has(strip, BARS).sum(axis=0)[[479 - round(48 * age) for age in (4.2, 3.2, 2.2, 1.2, 0.2)]]
    np.testing.assert_allclose(heights / heights.max(), [1 / 8, 1 / 4, 1 / 2, 1, 0], atol=0.02)
    assert heights.max() > 40
    strip = Film().add_counts({0.0: 4, 10.0: 0})
    assert np.flatnonzero(has(strip, OLD_BARS).any(axis=0)).tolist() == list(range(239))
    assert np.flatnonzero(has(strip, BARS).any(axis=0)).tolist() == list(range(241, 478))  # then the present's mark


def slow_counts_by_column(history, now_s, window_s, width):
    """Return the largest count that holds at some time in each column, which is 1/width of the window."""
    shown = np.zeros(width, int)
    for column in range(width):
        end_s = now_s - (width - 1 - column) * window_s / width
        begin_s = end_s - window_s / width
        for (time_s, count), until_s in zip(history, [time_s for time_s, _ in history[1:]] + [np.inf], strict=True):
            if begin_s < time_s <= end_s or (time_s <= end_s < until_s):
                shown[column] = max(shown[column], count)
    return shown


@given(
    st.lists(st.tuples(st.integers(1, 2000), st.integers(0, 12)), min_size=1, max_size=40),
    st.integers(0, 3000),
    st.integers(1, 97),
)
def test_columns_against_a_slow_twin(steps, later, width):
    """Times are odd multiples of 1/1024 s, and ends of columns are not: none depends on rounding."""
    times = np.cumsum([step for step, _ in steps]) / 512 + 1 / 1024
    history = [(float(time_s), count) for time_s, (_, count) in zip(times, steps, strict=True)]
    now_s = history[-1][0] + later / 512 + 1e-4
    shown = annotate.counts_by_column(history, now_s, 10.0, width)
    np.testing.assert_array_equal(shown, slow_counts_by_column(history, now_s, 10.0, width))


@pytest.mark.parametrize("size", [(64, 64), (1920, 1080)])
def test_each_statement_is_in_its_own_corner_and_cut_off_nowhere(size):
    film, half = Film(*size), size[0] // 2
    text = film.add(0.1, rings(2))
    rows = np.flatnonzero(has(text, BLUE).any(axis=1))[0]
    written = has(text[:rows], GREY) == 0
    assert written[:, :half].any()
    assert not written[:, half:].any()
    film.add(0.2, rings(2), 0.0, spread(12.3456))
    written = has(film.add(12345.6, rings(100), 0.0, None, 9999.0)[:rows], GREY) == 0
    assert written[: rows // 2, half:].any()
    assert written[rows // 2 :, half:].any()
    assert not written[:, [0, half - 1, half, size[0] - 1]].any()
    assert not written[0].any()


def test_the_last_evaluation_stays_but_nothing_from_before_the_beginning_and_synchrony_is_cyan():
    film = Film()
    plain, with_spread, later = film.add(1.0), film.add(1.0, [], 0.0, spread(0.2)), film.add(1.0)
    assert not has(plain, CYAN).any()
    assert has(with_spread, WHITE).sum() > has(plain, WHITE).sum()
    np.testing.assert_array_equal(later, with_spread)
    assert has(film.add(1.0, [], 0.0, None, 0.5), CYAN).any()
    film = Film(64, 64)
    film.add(26.6, rings(3))
    film.add(26.8, [], 0.0, spread(0.2))
    assert not has(film.add(27.0, [], start_s=27.0), BARS).any()
    np.testing.assert_array_equal(film.add(28.0, [], 27.0), Film(64, 64).add_counts({27.0: 0, 28.0: 0}, 27.0))
