"""Which camera took a film: by options, its description, corners of the floor, rings, and boards that tell a lens."""

import itertools
import math
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from epuck_sim import epuck
from epuck_sim.errors import FilmError
from epuck_sim.overhead import calibration
from epuck_sim.overhead.calibration import FilmMetadata, SeenRings, TrackOptions, calibrate, expected_rings, fit_camera
from epuck_sim.overhead.camera import CameraModel, Frame, Lens, View, calibrate_lens, find_views, read_lens, save_lens
from epuck_sim.overhead.floor import find_corners
from tests.overhead import cameras
from tests.overhead.cameras import AT_RINGS, FLOOR, camera_of, floor_corners, picture_of, scattered, worst_cm
from tests.overhead.films import SMALL, described, even, flashing, make_camera, shoot
from tests.overhead.webcam import padded

SIDE = SMALL["width_px"]
TOLD = TrackOptions()


def calibrated(film: Iterable[Frame], options: TrackOptions = TOLD, *most: float) -> Any:
    geometry = calibrate("reel", (SIDE, SIDE), iter(film), options, *most)
    assert geometry.knows_floor == (geometry.calibration != calibration.RINGS)
    return geometry


def plain(level: int, count: int) -> list[Frame]:
    return [Frame(number / 30, np.full((SIDE, SIDE, 3), level, np.uint8)) for number in range(count)]


@cache
def film(seconds: float, lit_until_s: float = 0.0, robots: int = 3, **settings: Any) -> list[Frame]:
    """Return frames of robots that flash one after the other, the first at 0.5 s."""
    times_s = even(seconds)
    return shoot(times_s, flashing(times_s, 0.5 + np.arange(robots) / 5), lit_until_s, **settings)


USER = TrackOptions((60, 50), 100.0, ((0, 0),) * 4, 2.0, 3, 99.0, 0.9)


def test_options_override_the_description_and_contradict_its_geometry_which_is_the_scenario_s_else() -> None:
    told = FilmMetadata.of({"epuck_sim": "0", "arena_cm": [90, 80], "period_s": 4.0, "robots": 7})
    assert TOLD.with_defaults(told) == TOLD._replace(arena_cm=(90, 80), period_s=4.0, robots=7)
    for empty in (None, {}, {"epuck_sim": "0", "period_s": None, "robots": None}):
        assert TOLD.with_defaults(FilmMetadata.of(empty)) == TOLD
    assert USER.with_defaults(told) == USER
    assert TOLD.with_defaults(told).contradictions(told, (240, 240)) == TOLD.contradictions(told, (240, 240)) == []
    assert USER.contradictions(told, (240, 240)) == [
        f"{option}, but the film's description says {described}"
        for option, described in (("--arena-cm is 60x50", "90x80"), ("--robots is 3", 7), ("--period-s is 2", 4))
    ]
    for height_cm, warned in ((20.0, ["--height-cm is 20, but the film's description says 110"]), (110.0, [])):
        assert TrackOptions(height_cm=height_cm).contradictions(FilmMetadata.of(described()), (240, 240)) == warned
    told = FilmMetadata.of(described(height_cm=80.0, distortion=-0.1))
    found = told.geometry((SIDE, SIDE), TrackOptions(period_s=1.0, robots=3))
    assert found is not None
    assert (found.floor_cm, found.knows_floor) == ((60.0, 60.0), True)
    expected = make_camera(height_cm=80.0, distortion=-0.1)
    assert found.camera[:3] == expected[:3]
    assert (found.camera.rotation == expected.rotation).all()
    assert (found.camera.position_cm == expected.position_cm).all()
    for options in ({"corners_px": USER.corners_px}, {"arena_cm": (60, 60)}, {"height_cm": 110.0}):
        assert FilmMetadata.of(described()).geometry((240, 240), TrackOptions(**options)) is None
    assert FilmMetadata.of(described()).geometry((240, 180), TOLD) is None
    for change in ({"arena_cm": 60}, {"arena_cm": [60] * 3}, {"overhead": None}, {"overhead": {"width_px": "many"}}):
        assert FilmMetadata.of(described() | change).geometry((240, 240), TOLD) is None
    assert FilmMetadata.of(None).geometry((240, 240), TOLD) is None


def test_corners_need_no_ring_a_lit_beginning_gives_the_floor_and_a_view_from_aside_is_refused() -> None:
    straight = make_camera(distortion=0.0)
    found = calibrated(film(0.1, lit_until_s=1), TrackOptions(corners_px=floor_corners(straight)))
    assert found.calibration == calibration.CORNERS
    assert worst_cm(found.camera, straight) <= 0.01
    line = ((5.0, 100.0), (235.0, 100.0), (235.0, 124.1), (5.0, 124.1))
    with pytest.raises(FilmError, match=r"the camera is tilted by .* degrees; allowed: up to 75"):
        calibrated(film(1.2), TrackOptions(corners_px=line))
    found = calibrated(plain(120, 9) + film(1, lit_until_s=0.3))
    assert found.calibration == calibration.LIGHT
    assert worst_cm(found.camera, make_camera()) <= 0.3
    bands = plain(200, calibration.LIT_FRAMES)
    for number, frame in enumerate(bands):
        frame.picture[: 60 + 3 * number] = frame.picture[150 + 2 * number :] = 90
        frame.picture[:, :8] = frame.picture[:, -8:] = 90
    found = calibrated(bands + film(1.2))
    assert found.calibration == calibration.RINGS
    assert worst_cm(found.camera, make_camera()) <= 1.0


@pytest.mark.parametrize(
    "lit", [calibration.LIT_FRAMES, pytest.param(3 * calibration.LIT_FRAMES, marks=pytest.mark.slow)]
)
def test_rings_give_the_camera_if_the_beginning_shows_no_floor(lit: int) -> None:
    found = calibrated(plain(120, lit) + film(1.2))
    assert found.calibration == calibration.RINGS
    assert worst_cm(found.camera, make_camera()) <= 1.0


def test_a_long_lit_beginning_leaves_the_frames_in_which_rings_are_studied() -> None:
    options = TrackOptions(corners_px=floor_corners(make_camera()))
    after, at_once = (calibrated(plain(120, lit) + film(1.2), options, 30) for lit in (90, 0))
    assert after.ring_light == at_once.ring_light > 0
    assert after.error_cm == pytest.approx(at_once.error_cm)
    waited = iter(plain(120, 90) + film(1.2))
    assert calibrated(waited, options, 30, 1.0).ring_light == 0
    assert len(list(waited)) == 90 + 36 - 60


def test_rings_of_a_dark_film_give_its_scale_and_height_and_arena_are_those_that_are_known() -> None:
    found = calibrated(film(1.2, robots=5, height_cm=150.0))
    assert found.calibration == calibration.RINGS
    assert worst_cm(found.camera, make_camera(height_cm=150.0)) <= 1.0
    found = calibrated(film(1.2), TrackOptions(arena_cm=(80.0, 40.0), height_cm=95.0))
    assert found.camera.position_cm.tolist() == [40, 20, 95]
    far = TrackOptions(
        corners_px=floor_corners(make_camera()), height_cm=1e5
    )  # rounding makes the covariance of the fit lopsided
    assert calibrated(film(1.2), far).camera.position_cm[2] == pytest.approx(1e5)


def test_ring_is_found_however_late_it_is_lit_and_films_without_light_or_of_one_frame_are_told_of() -> None:
    flash = film(0.55)[-1:]
    assert flash[0].picture[..., 0].max() > 200
    for dark, left in ((0, 0), (150, 50 - 2)):  # in the first frame, it might be a lamp
        reel = iter(plain(0, dark) + flash + plain(0, calibration.STUDIED_FRAMES + 50))
        assert calibrated(reel).calibration == calibration.RINGS
        assert len(list(reel)) >= left
    for frames in ([], plain(120, calibration.LIT_FRAMES + 5), plain(120, calibration.LIT_FRAMES + 5) + plain(3, 5)):
        with pytest.raises(FilmError, match=r"^reel: no lit ring is seen; .* dark.* 5 px .* 48 px in .*--corners"):
            calibrated(frames)
    assert len(list(calibration.excerpt(plain(0, 1), TrackOptions(end_s=0.02)))) == 1


NO_RINGS = SeenRings(np.empty((0, 2)), np.empty(0), np.empty((0, 2)))
VGA = {"width_px": 640, "field_of_view_deg": 61.0}


def by_corners(corners, size=(480, 480), floor_cm=(60.0, 60.0), above_cm=110.0, lens=None):
    return fit_camera(size, floor_cm, above_cm, NO_RINGS, corners, lens).camera


def test_pixels_show_points_that_are_seen_there_and_a_tilted_camera_is_aimed_at_the_middle_from_its_height():
    pixels = np.random.default_rng(0).uniform(0, 479, (50, 2))
    pixels[:4] = (0, 0), (479, 0), (0, 479), (479, 479)
    for degrees, k1 in ((None, -0.05), (None, -0.3), (45.0, -0.3), (None, 0.3), (120.0, 0.3)):
        camera = camera_of(field_of_view_deg=degrees, distortion=k1)
        for z_cm in (0.0, epuck.RING_HEIGHT_CM):
            points = np.column_stack([camera.back_project(pixels, z_cm), np.full(50, z_cm)])
            np.testing.assert_allclose(camera.project(points), pixels, atol=1e-3, err_msg=f"{degrees}, {k1}")
    camera = camera_of(tilt_deg=25.0, turn_deg=-40.0)
    assert camera.position_cm[2] == pytest.approx(110)
    assert camera.project(np.array([(30.0, 30.0, 0.0)])) == pytest.approx(np.array([(239.5, 239.5)]))
    assert math.degrees(math.acos(-camera.rotation[2, 2])) == pytest.approx(25)
    above_middle = np.array([(30.0, 30.0, epuck.RING_HEIGHT_CM)])
    for tilt_deg in (1e-4, 1e-3, 1.0):
        straight, tilted = (camera_of(distortion=0.0, tilt_deg=each) for each in (0.0, tilt_deg))
        moved_px = (tilted.project(above_middle) - straight.project(above_middle))[0, 1]
        share = epuck.RING_HEIGHT_CM / (straight.position_cm[2] - epuck.RING_HEIGHT_CM)
        assert moved_px == pytest.approx(straight.lens.focal_px * share * math.radians(tilt_deg), rel=0.01)


@pytest.mark.parametrize("settings", [
    {}, {"width_px": 1920, "height_px": 1080}, {"field_of_view_deg": 22.0},  # corners are beyond the last one's picture
    *({"tilt_deg": tilt, "turn_deg": turn, **VGA} for tilt in (1.0, 30.0) for turn in (-40.0, 0.0, 25.0)),
], ids=str)  # fmt: skip
def test_finds_a_camera_by_four_corners(settings):
    camera = camera_of(distortion=0.0, **settings)
    found = by_corners(camera.project(FLOOR), camera[:2])
    assert found.lens.focal_px == pytest.approx(camera.lens.focal_px, rel=1e-4)
    np.testing.assert_allclose(found.position_cm, camera.position_cm, atol=0.05)
    np.testing.assert_allclose(found.rotation, camera.rotation, atol=1e-3)
    assert worst_cm(found, camera) < 0.01
    known = by_corners(camera.project(FLOOR), camera[:2], above_cm=165.0, lens=camera.lens)  # which tells the height
    np.testing.assert_allclose(known.position_cm, camera.position_cm, atol=0.05)


def test_corners_come_in_any_order_of_arenas_that_are_no_square_and_a_pixel_off_misplace_rings_by_little():
    camera = camera_of(distortion=0.0)
    for mixed in itertools.permutations(camera.project(FLOOR)):
        assert worst_cm(by_corners(mixed), camera) < 0.01
    camera = camera_of(90.0, width_px=640, distortion=0.0)
    seen = camera.project(np.array([(15, 20, 0), (75, 20, 0), (75, 60, 0), (15, 60, 0)], float))
    found = by_corners(seen, (640, 480), (60.0, 40.0), 165.0)
    assert found.lens.focal_px == pytest.approx(camera.lens.focal_px, rel=1e-5)
    (there,) = found.back_project(camera.project(np.array([(20.0, 50.0, 4.0)])), 4.0)
    np.testing.assert_allclose(there, (5.0, 30.0), atol=0.01)
    for seed in range(10):
        generator = np.random.default_rng(seed)
        askew = {"tilt_deg": generator.uniform(0, 20), "turn_deg": generator.uniform(-25, 25)}
        camera = camera_of(distortion=0.0, **VGA, **askew)
        corners = camera.project(FLOOR) + generator.uniform(-0.7, 0.7, (4, 2))
        assert worst_cm(by_corners(corners, camera[:2]), camera) < 0.35
    camera = camera_of(distortion=-0.05)
    assert worst_cm(by_corners(camera.project(FLOOR)), camera) < 0.2


def off_px(camera, corners):
    """Return how far corners found are from the true ones, at most."""
    assert corners is not None
    return max(np.hypot(*(camera.project(FLOOR) - corner).T).min() for corner in corners)


@pytest.mark.parametrize("settings", [
    {"width_px": 240, "height_px": 240, "distortion": -0.1}, {"width_px": 240, "height_px": 240, "distortion": 0.1},
    {"width_px": 640, "height_px": 360, "distortion": 0.0}, {"tilt_deg": 5.0, "turn_deg": -30.0, **VGA},
    {"tilt_deg": 15.0, "turn_deg": 15.0, **VGA},  # farther, walls hide the floor
], ids=str)  # fmt: skip
def test_finds_the_floor(settings):
    picture = picture_of([], room=True, noise_levels=10.0, **settings)
    assert off_px(camera_of(**settings), find_corners(picture)) < 1.0


def test_finds_it_behind_robots_but_none_where_there_is_none():
    at_walls = [(3.7, 3.7), (3.7, 30.0), (45.0, 56.3), (37.5, 56.3), (56.3, 3.7), (20.0, 3.7)]
    free = [c for c in scattered(6, np.random.default_rng(0)) if all(math.dist(c, at) > 7.4 for at in at_walls)]
    assert off_px(camera_of(), find_corners(picture_of(at_walls + free, room=True, lit=False))) < 1.0
    room = picture_of([], room=True, width_px=240, height_px=240)
    assert find_corners(room) is not None
    assert find_corners(picture_of(scattered(8, np.random.default_rng(0)), width_px=240, height_px=240)) is None  # dark
    assert find_corners(np.full((240, 240, 3), 140, np.uint8)) is None  # nothing but floor
    assert find_corners(np.ascontiguousarray(room[30:210, 30:210])) is None  # walls out of the picture
    stripes = np.where(np.arange(240)[:, None, None] // 8 % 2, 60, 220) * np.ones((240, 240, 3))
    assert find_corners(stripes.astype(np.uint8)) is None
    for corners in (cv2.ellipse2Poly((120, 120), (100, 100), 0, 0, 360, 5), [(20, 220), (220, 220), (120, 20)]):
        shape = np.full((240, 240, 3), 30, np.uint8)
        assert find_corners(cv2.fillPoly(shape, [np.array(corners)], (150, 150, 150))) is None
    wide = np.full((480, 560, 3), 145, np.uint8)
    wide[:, 40:-40] = picture_of([], room=True)
    assert find_corners(wide) is not None
    grey = np.full((480, 480, 3), 145, np.uint8)
    (frame,) = padded(0.1, 0.05)([Frame(0.0, grey)])
    assert find_corners(frame.picture) is None
    assert find_corners(np.pad(grey, ((40, 40), (60, 60), (0, 0)))) is None  # bars all round
    assert find_corners(np.pad(grey, ((40, 40), (60, 60), (0, 0)), constant_values=20)) is not None


def seen_by(camera, centres=AT_RINGS[:, :2]):
    places = camera.project(np.column_stack([centres, np.full(len(centres), epuck.RING_HEIGHT_CM)]))
    return expected_rings(camera, places, epuck.RING_RADIUS_CM)


def by_rings(rings, above_cm=110.0, corners=None):
    return fit_camera((640, 480), (60, 60), above_cm, rings, corners)


@pytest.mark.parametrize("tilt_deg", [0.0, 8.0, 25.0])
@pytest.mark.parametrize("k1", [-0.2, 0.0])
def test_size_and_shape_of_rings_tell_tilt_and_distortion(k1, tilt_deg):
    camera = camera_of(tilt_deg=tilt_deg, distortion=k1, width_px=640, field_of_view_deg=49.0)
    fitted = by_rings(seen_by(camera))
    assert worst_cm(fitted.camera, camera) < 0.2
    assert fitted.tilt_deg == pytest.approx(tilt_deg, abs=0.5)
    assert fitted.error_cm < 6  # a bound that rounding moves, where tilt and distortion hardly differ
    assert not fitted.camera.lens.is_fisheye


def test_rings_tell_a_fisheye_and_distortion_one_that_is_none_does_little_harm_and_few_tell_the_scale():
    camera = camera_of(lens="fisheye", height_cm=40.0, width_px=640, field_of_view_deg=110.0)
    fitted = by_rings(seen_by(camera), 40.0)
    assert fitted.camera.lens.is_fisheye
    assert worst_cm(fitted.camera, camera) < 0.1
    camera = camera_of(tilt_deg=5.0, distortion=-0.25, width_px=640, field_of_view_deg=49.0)
    corners = camera.project(FLOOR)
    assert worst_cm(by_corners(corners, (640, 480)), camera) > 0.3
    assert worst_cm(by_rings(seen_by(camera), corners=corners).camera, camera) < 0.15
    camera = camera_of(distortion=-0.2, width_px=640, field_of_view_deg=49.0)
    seen = seen_by(camera)
    radius = seen.radius_px * np.where(np.arange(len(seen.radius_px)) == 4, 1.5, 1.0)
    assert worst_cm(by_rings(seen._replace(radius_px=radius)).camera, camera) < 0.3
    fitted = by_rings(seen_by(camera, np.array([(30.0, 30.0), (20.0, 30.0)])))
    assert fitted.camera.lens.coefficients[0] == fitted.tilt_deg == 0
    assert fitted.camera.lens.focal_px == pytest.approx(camera.lens.focal_px, rel=0.02)


SIZE = (480, 360)


@pytest.mark.parametrize(
    ("board", "is_charuco", "k1", "k2", "is_fisheye"),
    [
        (cameras.checkerboard(9, 6), False, -0.25, 0.05, False),
        (cameras.charuco(9, 6), True, -0.1, 0.0, False),
        (cameras.charuco(9, 6, is_legacy=True), True, -0.1, 0.0, False),
        (cameras.checkerboard(9, 6), False, 0.02, -0.01, True),
    ],
)
def test_a_board_tells_the_lens(board, is_charuco, k1, k2, is_fisheye, tmp_path) -> None:
    coefficients = (k1, k2, 0.0, 0.0)
    matrix = cameras.lens_matrix(315.0, SIZE)
    true_lens = Lens(matrix[0, 0], matrix[1, 1], (matrix[0, 2], matrix[1, 2]), coefficients, is_fisheye)
    frames = cameras.film_of(board, matrix, np.array(coefficients), is_fisheye, SIZE, 10)
    views = find_views(frames, (9, 6), is_charuco)
    found = calibrate_lens("film", views, SIZE, is_fisheye)
    assert found.views >= 6
    assert found.error_px < 0.5
    points = np.array([(x, y, 10.0) for x in (-4.0, 0.0, 4.0) for y in (-3.0, 0.0, 3.0)])
    one, other = (CameraModel(*SIZE, each, np.eye(3), np.zeros(3)).project(points) for each in (found.lens, true_lens))
    assert np.linalg.norm(one - other, axis=1).max() < 3.0
    save_lens(tmp_path / "lens.json", found)
    assert read_lens(tmp_path / "lens.json", SIZE) == found.lens
    text = (tmp_path / "lens.json").read_text()
    (tmp_path / "lens.json").write_text(text.replace('"error_px": 0.', '"error_px": 1.'))
    with pytest.raises(FilmError, match="was changed since epuck-sim calibrate wrote it; calibrate again"):
        read_lens(tmp_path / "lens.json", SIZE)


def test_boards_are_missed_where_there_is_none_and_found_anew_only_where_they_have_moved(monkeypatch) -> None:
    nothing = [Frame(float(second), np.full((120, 160, 3), 120, np.uint8)) for second in range(10)]
    views = find_views(nothing, (9, 6), is_charuco=False)
    with pytest.raises(FilmError, match=r"^dull\.mp4: the board is found in 0 .*--board .*not corners"):
        calibrate_lens("dull.mp4", views, (160, 120), False)
    (view,) = views_of_a_board([20.0], False)
    flickers = [dict([*view.items()][number:]) for number in (0, 1, 0, 1)]
    views = views_of_a_board(np.linspace(-30, 30, 10), False)
    monkeypatch.setattr("epuck_sim.overhead.camera._charuco_corners", lambda *_: flickers.pop())
    monkeypatch.setattr("epuck_sim.overhead.camera._checkerboard_corners", lambda *_: views.pop())
    frames = [Frame(number / 25, np.zeros((4, 4, 3), np.uint8)) for number in range(10)]
    assert len(find_views(frames[:4], (9, 6), is_charuco=True, apart_s=0.0)) == 1
    assert len(find_views(frames, (9, 6), is_charuco=False, apart_s=0.0)) == 10


def views_of_a_board(tilts_deg: Sequence[float], is_fisheye: bool, focal_px: float = 450.0) -> list[View]:
    """Return views through a lens, with noise of 0.1 px, of a board that is moved, turned and tilted."""
    random = np.random.default_rng(3)
    across, down = np.meshgrid(np.arange(6.0), np.arange(4.0))
    board = np.column_stack([across.ravel(), down.ravel(), np.zeros(across.size)])[:, None]
    views, project = [], cv2.fisheye.projectPoints if is_fisheye else cv2.projectPoints
    for tilt_deg in tilts_deg:
        turn = Rotation.from_euler("zx", [random.uniform(-40, 40), tilt_deg], degrees=True).as_rotvec()
        shift = np.array([*random.uniform(-6, -1, 2), random.uniform(12, 18) * focal_px / 450])
        pixels, _ = project(board, turn, shift, cameras.lens_matrix(focal_px, SIZE), np.zeros(4))
        noisy = (pixels + random.normal(0, 0.1, pixels.shape)).reshape(-1, 2)
        views.append(dict(zip(map(tuple, board[:, 0].tolist()), noisy, strict=True)))
    return views


@pytest.mark.parametrize("focal_px", [120.0, 150.0, 190.0])
def test_a_board_tells_a_very_wide_fisheye_lens(focal_px: float) -> None:
    views = views_of_a_board(np.linspace(-50, 50, 12), True, focal_px)
    assert calibrate_lens("film", views, SIZE, is_fisheye=True).focal_px == pytest.approx(focal_px, rel=0.02)


@pytest.mark.parametrize("is_fisheye", [False, True])
def test_a_view_with_misplaced_corners_is_left_out(is_fisheye: bool) -> None:
    views = views_of_a_board(np.linspace(-35, 35, 12), is_fisheye)
    whole = calibrate_lens("film", views, SIZE, is_fisheye)
    views[3] = {place: pixel + place[0] * place[1] for place, pixel in views[3].items()}
    found = calibrate_lens("film", views, SIZE, is_fisheye)
    assert (whole.views, found.views) == (12, 11)
    assert found.error_px < 0.2
    assert found.middle_px == pytest.approx(whole.middle_px, abs=2.0)


@pytest.mark.parametrize(("is_fisheye", "tilt_deg"), [(False, 0.0), (False, 12.0), (True, 12.0)])
def test_a_board_that_is_never_or_always_tilted_alike_does_not_determine_a_lens(is_fisheye: bool, tilt_deg) -> None:
    views = views_of_a_board(np.linspace(-35, 35, 12), is_fisheye)
    assert calibrate_lens("film", views, SIZE, is_fisheye).focal_px == pytest.approx(450, rel=0.02)
    with pytest.raises(FilmError, match=r"^film: the views of the board do not determine a lens; show it tilted"):
        calibrate_lens("film", views_of_a_board([tilt_deg] * 12, is_fisheye), SIZE, is_fisheye)
