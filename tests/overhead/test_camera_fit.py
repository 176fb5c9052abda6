"""A camera is found from the corners of the floor and from rings, and the corners in a lit picture."""

import itertools
import math

import cv2
import numpy as np
import pytest

from epuck_sim import epuck
from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera_fit import SeenRings, expected_rings, fit_camera
from epuck_sim.overhead.floor import find_corners
from tests.overhead.cameras import AT_RINGS, FLOOR, camera_of, picture_of, scattered, worst_cm

NO_RINGS = SeenRings(np.empty((0, 2)), np.empty(0), np.empty((0, 2)))
VGA = {"width_px": 640, "field_of_view_deg": 61.0}


def by_corners(corners, size=(480, 480), floor_cm=(60.0, 60.0), above_cm=110.0):
    """Return the camera that follows from corners alone."""
    return fit_camera(size, floor_cm, above_cm, NO_RINGS, corners).camera


@pytest.mark.parametrize(("degrees", "k1"), [(None, -0.05), (None, -0.3), (45.0, -0.3), (None, 0.3), (120.0, 0.3)])
def test_pixels_show_the_points_that_are_seen_there(degrees, k1):
    camera = camera_of(field_of_view_deg=degrees, distortion=k1)
    pixels = np.random.default_rng(0).uniform(0, 479, (50, 2))
    pixels[:4] = (0, 0), (479, 0), (0, 479), (479, 479)
    for z_cm in (0.0, epuck.RING_HEIGHT_CM):
        points = np.column_stack([camera.back_project(pixels, z_cm), np.full(50, z_cm)])
        np.testing.assert_allclose(camera.project(points), pixels, atol=1e-3)


@pytest.mark.parametrize("tilt_deg", [1e-4, 1e-3, 1.0])
def test_a_camera_that_hangs_almost_straight_shows_its_tilt(tilt_deg):
    straight, tilted = (camera_of(distortion=0.0, tilt_deg=each) for each in (0.0, tilt_deg))
    above_middle = np.array([(30.0, 30.0, epuck.RING_HEIGHT_CM)])
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


def test_corners_that_are_a_pixel_off_and_a_usual_distortion_misplace_rings_by_little():
    for seed in range(10):
        generator = np.random.default_rng(seed)
        askew = {"tilt_deg": generator.uniform(0, 20), "turn_deg": generator.uniform(-25, 25)}
        camera = camera_of(distortion=0.0, **VGA, **askew)
        corners = camera.project(FLOOR) + generator.uniform(-0.7, 0.7, (4, 2))
        assert worst_cm(by_corners(corners, camera[:2]), camera) < 0.35
    camera = camera_of(distortion=-0.05)
    assert worst_cm(by_corners(camera.project(FLOOR)), camera) < 0.2


def test_corners_come_in_any_order_and_the_origin_is_at_the_lower_left():
    camera = camera_of(distortion=0.0)
    for mixed in itertools.permutations(camera.project(FLOOR)):
        assert worst_cm(by_corners(mixed), camera) < 0.01


def test_an_arena_that_is_no_square():
    camera = camera_of(90.0, width_px=640, distortion=0.0)
    seen = camera.project(np.array([(15, 20, 0), (75, 20, 0), (75, 60, 0), (15, 60, 0)], float))
    found = by_corners(seen, (640, 480), (60.0, 40.0), 165.0)
    assert found.lens.focal_px == pytest.approx(camera.lens.focal_px, rel=1e-5)
    (there,) = found.back_project(camera.project(np.array([(20.0, 50.0, 4.0)])), 4.0)
    np.testing.assert_allclose(there, (5.0, 30.0), atol=0.01)


def test_corners_that_cannot_be():
    for corners, why in [
        ([(10, 10), (400, 10), (150, 150), (10, 400)], "no.*convex quadrilateral"),
        ([(10, 10), (400, 10), (400, 400), (10, 10)], "convex quadrilateral"),
        ([(10, 10), (980, 10), (400, 400), (10, 400)], "980,10.*far outside of the picture of 480 x 480 px"),
        ([(-500, 10), (400, 10), (400, 400), (10, 400)], "-500,10.*far outside"),
        ([(10, 10), (40, 10), (40, 40), (10, 40)], "shortest side is 30 px.*at least 48"),
    ]:
        with pytest.raises(FilmError, match=rf"^--corners .*{why}"):
            by_corners(corners)


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


def test_finds_it_behind_robots():
    at_walls = [(3.7, 3.7), (3.7, 30.0), (45.0, 56.3), (37.5, 56.3), (56.3, 3.7), (20.0, 3.7)]
    free = [c for c in scattered(6, np.random.default_rng(0)) if all(math.dist(c, at) > 7.4 for at in at_walls)]
    corners = find_corners(picture_of(at_walls + free, room=True, lit=False))
    assert off_px(camera_of(), corners) < 1.0


def test_finds_no_floor_where_there_is_none():
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


def seen_by(camera, centres=AT_RINGS[:, :2]):
    """Return rings as a camera shows them."""
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


def test_a_fisheye_is_told_from_a_usual_lens():
    camera = camera_of(lens="fisheye", height_cm=40.0, width_px=640, field_of_view_deg=110.0)
    fitted = by_rings(seen_by(camera), 40.0)
    assert fitted.camera.lens.is_fisheye
    assert worst_cm(fitted.camera, camera) < 0.1


def test_rings_tell_the_distortion_that_corners_alone_do_not():
    camera = camera_of(tilt_deg=5.0, distortion=-0.25, width_px=640, field_of_view_deg=49.0)
    corners = camera.project(FLOOR)
    assert worst_cm(by_corners(corners, (640, 480)), camera) > 0.3
    assert worst_cm(by_rings(seen_by(camera), corners=corners).camera, camera) < 0.15


def test_a_ring_that_is_none_does_little_harm_and_a_few_tell_the_scale_alone():
    camera = camera_of(distortion=-0.2, width_px=640, field_of_view_deg=49.0)
    seen = seen_by(camera)
    radius = seen.radius_px * np.where(np.arange(len(seen.radius_px)) == 4, 1.5, 1.0)
    assert worst_cm(by_rings(seen._replace(radius_px=radius)).camera, camera) < 0.3
    fitted = by_rings(seen_by(camera, np.array([(30.0, 30.0), (20.0, 30.0)])))
    assert fitted.camera.lens.coefficients[0] == fitted.tilt_deg == 0
    assert fitted.camera.lens.focal_px == pytest.approx(camera.lens.focal_px, rel=0.02)
