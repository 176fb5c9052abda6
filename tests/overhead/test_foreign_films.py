"""The tracker on films by another renderer, and on films that cameras and rooms spoil: right, or doubtful."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from docs.figures.overhead_confidence import examine
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.floor import find_corners
from epuck_sim.overhead.light import ring_light
from epuck_sim.overhead.rings import DISC_LIGHT, RingFinder
from epuck_sim.overhead.track import Track, track_film
from tests.overhead.cameras import camera_of, picture_of
from tests.overhead.films import Score, passed, read_rings, save, score_rows
from tests.overhead.webcam import EFFECTS, GOOD, KINDS, Extra, Swarm, Webcam, padded, shoot, swarm

NOWHERE = np.empty((0, 2))
OF_POINTS = {"is_fisheye": True, "above_cm": 38.0, "focal_px": 320.0}
CAMERAS = KINDS | {"fisheye of points": KINDS["points"]._replace(**OF_POINTS)}


def tracked(folder: Path, camera: Webcam, filmed: Swarm, extras: tuple[Extra, ...] = ()) -> tuple[Track, Score]:
    """Return what is found in a film of a swarm, told all about it, and how well its rings are found."""
    table, shot = folder / "rings.csv", list(shoot(camera, filmed, 12.0, extras))
    film = save(folder / "film.mp4", [frame for frame, _ in shot])
    truth = [(frame.time_s, lit_cm, NOWHERE) for frame, lit_cm in shot]
    floor = tuple((float(x), float(y)) for x, y in camera.floor_px(filmed.arena_cm))
    told = TrackOptions(filmed.arena_cm, camera.above_cm, floor, filmed.period_s, len(filmed.homes_cm))
    return track_film(film, told, table, passed), score_rows(read_rings(table), truth)


@pytest.mark.parametrize(
    "kind",
    [
        *("burnt out, white", "fisheye of points", "typical webcam"),
        *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("orange", "flicker in bands")),
    ],
)
def test_rings_are_found_where_they_are(kind: str, tmp_path: Path) -> None:
    track, score = tracked(tmp_path, CAMERAS[kind].scaled(0.4), swarm(5, 4, 2, seed=1, period_s=1.6))
    assert score.found + score.missed > 20
    assert (score.recall >= 0.95, score.precision >= 0.99, score.rms_cm <= 0.4) == (True, True, True), score
    assert track.reasons == ()
    assert track.t_sync_cycles == pytest.approx(3, abs=0.25)


def test_what_is_outside_of_the_floor_and_what_never_goes_off_are_left_out(tmp_path: Path) -> None:
    robots = swarm(4, 4, 2, seed=2, period_s=1.6)
    neighbour = Extra((68.0, 30.0), tuple(0.3 + 1.3 * np.arange(5)), 0.3)
    free = max(
        ((x, y) for x in (10.0, 30.0, 50.0) for y in (10.0, 30.0, 50.0)),
        key=lambda place: np.hypot(*(robots.homes_cm - place).T).min(),
    )
    camera = GOOD._replace(focal_px=640.0, size_px=(640, 480)).scaled(0.4)
    track, _ = tracked(tmp_path, camera, robots, (neighbour, Extra(free)))
    assert (track.rings_outside > 10, track.always_lit, track.confidence) == (True, 1, "low")
    assert track.histogram_periods == pytest.approx(2.55, abs=0.25)
    assert any("outside of the floor" in warning for warning in track.warnings)
    assert any("stayed lit" in warning for warning in track.warnings)


@pytest.mark.parametrize(
    ("kind", "strength"),
    [
        ("burnt out", 40.0),
        *(
            pytest.param(kind, strengths[-1], marks=pytest.mark.slow)
            for kind, (_, strengths) in EFFECTS.items()
            if kind not in {"burnt out", "rolling shutter"}  # flashes of 1.4 frames are cut in the middle
        ),
    ],
)
def test_an_answer_is_right_or_doubtful(kind: str, strength: float) -> None:
    _, confidence, is_right = examine(EFFECTS[kind][0](strength), 1, 1)
    assert is_right or confidence != "high"


@pytest.mark.parametrize(("kind", "strength"), [("lamp", 0.06), ("screen", 0.08)])
def test_what_shines_and_flickers_is_told_from_rings_and_doubted(kind: str, strength: float) -> None:
    _, confidence, is_right = examine(EFFECTS[kind][0](strength), 1, 1)
    assert (is_right, confidence) == (True, "low")


def test_groups_apart_are_not_synchronised() -> None:
    cycles, confidence, _ = examine(iter, 3, 2)
    assert cycles == "" or confidence != "high"


def test_the_edge_of_padding_is_no_floor() -> None:
    wide = np.full((480, 560, 3), 145, np.uint8)
    wide[:, 40:-40] = picture_of([], room=True)
    assert find_corners(wide) is not None
    grey = np.full((480, 480, 3), 145, np.uint8)
    (frame,) = padded(0.1, 0.05)([Frame(0.0, grey)])
    assert find_corners(frame.picture) is None
    assert find_corners(np.pad(grey, ((40, 40), (60, 60), (0, 0)))) is None  # bars all round
    assert find_corners(np.pad(grey, ((40, 40), (60, 60), (0, 0)), constant_values=20)) is not None


def test_rings_that_are_burnt_out_to_discs_are_found_where_the_scale_is_known() -> None:
    camera = camera_of()
    places = np.array([(15.0, 15.0), (30.0, 40.0), (30.0 + 8.5, 40.0), (50.0, 20.0)])
    picture = np.zeros((480, 480, 3), np.uint8)
    for x_px, y_px in camera.project(np.column_stack([places, np.full(4, 4.0)])):
        cv2.circle(picture, (round(x_px), round(y_px)), round(5.0 * 480 / 65), (255, 255, 255), -1)
    light, _ = ring_light(picture)
    rings = RingFinder(camera, sees_discs=True).find(light)
    found = np.array(sorted((ring.x_cm, ring.y_cm) for ring in rings))
    assert found == pytest.approx(np.array(sorted(map(tuple, places))), abs=0.5)
    assert {ring.light for ring in rings} == {DISC_LIGHT}
    assert RingFinder(camera).find(light) == []
