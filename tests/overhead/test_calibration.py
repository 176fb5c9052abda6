"""Which camera took a film: by the user's options, else by the film's description, else by its pictures."""

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np
import pytest

from epuck_sim.errors import FilmError
from epuck_sim.overhead.calibration import (
    LIGHT,
    LIT_FRAMES,
    STUDIED_FRAMES,
    TrackOptions,
    calibrate,
    described_geometry,
    excerpt,
    parse_metadata,
)
from epuck_sim.overhead.camera import Frame, Geometry
from epuck_sim.overhead.camera_fit import CORNERS, RINGS
from tests.overhead.cameras import floor_corners, worst_cm
from tests.overhead.films import SMALL, described, even, flashing, make_camera, shoot

SIDE = SMALL["width_px"]
TOLD = TrackOptions()


def calibrated(film: Iterable[Frame], options: TrackOptions = TOLD, *most: float) -> Geometry:
    geometry = calibrate("reel", (SIDE, SIDE), iter(film), options, *most)
    assert geometry.knows_floor == (geometry.calibration != RINGS)
    return geometry


def plain(level: int, count: int) -> list[Frame]:
    """Return frames of one grey."""
    return [Frame(number / 30, np.full((SIDE, SIDE, 3), level, np.uint8)) for number in range(count)]


@cache
def film(seconds: float, lit_until_s: float = 0.0, robots: int = 3, **settings: Any) -> list[Frame]:
    """Return frames of robots that flash one after the other, the first at 0.5 s."""
    times_s = even(seconds)
    return shoot(times_s, flashing(times_s, 0.5 + np.arange(robots) / 5), lit_until_s, **settings)


DESCRIBED = {"epuck_sim": "0", "arena_cm": [90, 80], "period_s": 4.0, "robots": 7}
USER = TrackOptions((60, 50), 100.0, ((0, 0),) * 4, 2.0, 3, 99.0, 0.9)


def test_options_override_the_description() -> None:
    told = parse_metadata(DESCRIBED)
    assert TOLD.with_defaults(told) == TOLD._replace(arena_cm=(90, 80), period_s=4.0, robots=7)
    for empty in (None, {}, {"epuck_sim": "0", "period_s": None, "robots": None}):
        assert TOLD.with_defaults(parse_metadata(empty)) == TOLD
    assert USER.with_defaults(told) == USER
    assert TOLD.with_defaults(told).contradictions(told) == TOLD.contradictions(told) == []
    assert USER.contradictions(told) == [
        f"{option}, but the film's description says {described}"
        for option, described in (("--arena-cm is 60x50", "90x80"), ("--robots is 3", 7), ("--period-s is 2", 4))
    ]


def test_described_geometry_is_that_of_the_scenario() -> None:
    told = parse_metadata(described(height_cm=80.0, distortion=-0.1))
    found = described_geometry((SIDE, SIDE), TrackOptions(period_s=1.0, robots=3), told)
    assert found is not None
    assert (found.floor_cm, found.knows_floor) == ((60.0, 60.0), True)
    expected = make_camera(height_cm=80.0, distortion=-0.1)
    assert found.camera[:3] == expected[:3]
    assert (found.camera.rotation == expected.rotation).all()
    assert (found.camera.position_cm == expected.position_cm).all()


def test_described_geometry_is_not_believed() -> None:
    for options in ({"corners_px": USER.corners_px}, {"arena_cm": (60, 60)}, {"height_cm": 110.0}):
        assert described_geometry((240, 240), TrackOptions(**options), parse_metadata(described())) is None
    assert described_geometry((240, 180), TOLD, parse_metadata(described())) is None
    for change in ({"arena_cm": 60}, {"arena_cm": [60] * 3}, {"overhead": None}, {"overhead": {"width_px": "many"}}):
        assert described_geometry((240, 240), TOLD, parse_metadata(described() | change)) is None
    assert described_geometry((240, 240), TOLD, parse_metadata(None)) is None


def test_corners_that_are_given_need_no_ring() -> None:
    straight = make_camera(distortion=0.0)
    found = calibrated(film(0.1, lit_until_s=1), TrackOptions(corners_px=floor_corners(straight)))
    assert found.calibration == CORNERS
    assert worst_cm(found.camera, straight) <= 0.01


def test_lit_beginning_gives_the_floor_even_behind_a_hand() -> None:
    found = calibrated(plain(120, 9) + film(1, lit_until_s=0.3))
    assert found.calibration == LIGHT
    assert worst_cm(found.camera, make_camera()) <= 0.3


def test_bands_of_light_that_move_are_no_floor() -> None:
    bands = plain(200, LIT_FRAMES)
    for number, frame in enumerate(bands):
        frame.picture[: 60 + 3 * number] = frame.picture[150 + 2 * number :] = 90
        frame.picture[:, :8] = frame.picture[:, -8:] = 90
    found = calibrated(bands + film(1.2))
    assert found.calibration == RINGS
    assert worst_cm(found.camera, make_camera()) <= 1.0


def test_corners_of_a_camera_that_sees_the_floor_from_aside_are_refused() -> None:
    line = ((5.0, 100.0), (235.0, 100.0), (235.0, 124.1), (5.0, 124.1))
    with pytest.raises(FilmError, match=r"the camera is tilted by .* degrees; allowed: up to 75"):
        calibrated(film(1.2), TrackOptions(corners_px=line))


@pytest.mark.parametrize("lit", [LIT_FRAMES, pytest.param(3 * LIT_FRAMES, marks=pytest.mark.slow)])
def test_rings_give_the_camera_if_the_beginning_shows_no_floor(lit: int) -> None:
    found = calibrated(plain(120, lit) + film(1.2))
    assert found.calibration == RINGS
    assert worst_cm(found.camera, make_camera()) <= 1.0


def test_a_long_lit_beginning_leaves_the_frames_in_which_rings_are_studied() -> None:
    options = TrackOptions(corners_px=floor_corners(make_camera()))
    after, at_once = (calibrated(plain(120, lit) + film(1.2), options, 30) for lit in (90, 0))
    assert after.ring_light == at_once.ring_light > 0
    assert after.error_cm == pytest.approx(at_once.error_cm)
    waited = iter(plain(120, 90) + film(1.2))
    assert calibrated(waited, options, 30, 1.0).ring_light == 0
    assert len(list(waited)) == 90 + 36 - 60


def test_rings_of_a_dark_film_give_its_scale() -> None:
    found = calibrated(film(1.2, robots=5, height_cm=150.0))
    assert found.calibration == RINGS
    assert worst_cm(found.camera, make_camera(height_cm=150.0)) <= 1.0


def test_height_and_arena_are_those_that_are_known() -> None:
    found = calibrated(film(1.2), TrackOptions(arena_cm=(80.0, 40.0), height_cm=95.0))
    assert found.camera.position_cm.tolist() == [40, 20, 95]


@pytest.mark.parametrize("dark", [0, 150])
def test_ring_is_found_however_late_it_is_lit(dark: int) -> None:
    flash = film(0.55)[-1:]
    assert flash[0].picture[..., 0].max() > 200
    reel = iter(plain(0, dark) + flash + plain(0, STUDIED_FRAMES + 50))
    assert calibrated(reel).calibration == RINGS
    assert len(list(reel)) >= (50 - 2 if dark else 0)  # in the first frame, it might be a lamp


def test_film_without_light_is_refused() -> None:
    for frames in ([], plain(120, LIT_FRAMES + 5), plain(120, LIT_FRAMES + 5) + plain(3, 5)):
        with pytest.raises(FilmError, match=r"^reel: no lit ring is seen; .*--corners"):
            calibrated(frames)


def test_options_that_leave_less_than_two_frames_are_blamed() -> None:
    for options, said in [
        (TrackOptions(start_s=9.0), r"^--start-s is 9, but the film ends at 0\.3 s; allowed: less$"),
        (TrackOptions(end_s=0.02), r"^--end-s is 0\.02, which leaves 1 of the film's frames; allowed: more"),
        (TrackOptions(start_s=0.11, end_s=0.12), r"^--end-s is 0\.12, which leaves 0 of the film's frames"),
    ]:
        with pytest.raises(FilmError, match=said):
            list(excerpt(plain(0, 10), options))
    assert len(list(excerpt(plain(0, 1), TrackOptions(end_s=0.02)))) == 1  # the film's own fault
