"""A camera is found from the corners of the floor and from rings, and the corners in a lit picture."""

import itertools
import math

import cv2
import numpy as np
import pytest

from epuck_sim import epuck
from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera import LOOKING_DOWN, CameraModel, fisheye_lens, overhead_camera, simple_lens
from epuck_sim.overhead.camera_fit import SeenRings, expected_rings, fit_camera
from epuck_sim.overhead.floor import find_corners
from epuck_sim.scenario.overhead import OverheadSection
from tests.overhead.drawn_rings import (
    matched,
    ring_picture,
    rings_in,
    room_picture,
    scattered,
    straight_camera,
    tilted_camera,
)

NO_RINGS = SeenRings(np.empty((0, 2)), np.empty(0), np.empty((0, 2)))
FLOOR = np.array([(0, 0, 0), (60, 0, 0), (60, 60, 0), (0, 60, 0)], float)
AT_RINGS = np.array([(x, y, epuck.RING_HEIGHT_CM) for x in (4.0, 30.0, 56.0) for y in (4.0, 30.0, 56.0)])


def by_corners(corners, size, floor_cm=(60.0, 60.0), above_cm=110.0):
    """Return the camera that follows from corners alone."""
    return fit_camera(size, floor_cm, above_cm, NO_RINGS, corners).camera


def worst_cm(found: CameraModel, true: CameraModel):
    """Return how far rings are misplaced by a camera that was found, at most."""
    back = found.back_project(true.project(AT_RINGS), epuck.RING_HEIGHT_CM)
    return np.hypot(*(back - AT_RINGS[:, :2]).T).max()


@pytest.mark.parametrize(("degrees", "k1"), [(None, -0.05), (None, -0.3), (45.0, -0.3), (None, 0.3), (120.0, 0.3)])
def test_pixels_show_the_points_that_are_seen_there(degrees, k1):
    camera = overhead_camera(OverheadSection(field_of_view_deg=degrees, distortion=k1), 60, 60)
    pixels = np.random.default_rng(0).uniform(0, 479, (50, 2))
    pixels[:4] = (0, 0), (479, 0), (0, 479), (479, 479)
    for z_cm in (0.0, epuck.RING_HEIGHT_CM):
        points = np.column_stack([camera.back_project(pixels, z_cm), np.full(50, z_cm)])
        np.testing.assert_allclose(camera.project(points), pixels, atol=1e-3)


# --- from corners ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "camera",
    [
        straight_camera(480, 480, k1=0.0),
        straight_camera(1920, 1080, k1=0.0),
        *(tilted_camera(tilt, turn) for tilt in (1.0, 15.0, 30.0) for turn in (-40.0, 0.0, 25.0)),
        overhead_camera(OverheadSection(field_of_view_deg=22.0, distortion=0.0), 60, 60),  # corners are beyond it
    ],
    ids=lambda _: "camera",
)
def test_finds_a_camera_by_four_corners(camera):
    found = by_corners(camera.project(FLOOR), camera[:2])
    assert found.lens.focal_px == pytest.approx(camera.lens.focal_px, rel=1e-4)
    np.testing.assert_allclose(found.position_cm, camera.position_cm, atol=0.05)
    np.testing.assert_allclose(found.rotation, camera.rotation, atol=1e-3)
    assert worst_cm(found, camera) < 0.01


def test_corners_that_are_a_pixel_off_and_a_usual_distortion_misplace_rings_by_little():
    for seed in range(20):
        generator = np.random.default_rng(seed)
        camera = tilted_camera(generator.uniform(0, 20), generator.uniform(-25, 25))
        corners = camera.project(FLOOR) + generator.uniform(-0.7, 0.7, (4, 2))
        assert worst_cm(by_corners(corners, (640, 480)), camera) < 0.35
    camera = straight_camera(k1=-0.05)
    assert worst_cm(by_corners(camera.project(FLOOR), (480, 480)), camera) < 0.2


def test_corners_come_in_any_order_and_the_origin_is_at_the_lower_left():
    camera = straight_camera(640, 480, k1=0.0)
    for mixed in itertools.permutations(camera.project(FLOOR)):
        assert worst_cm(by_corners(mixed, (640, 480)), camera) < 0.01


def test_an_arena_that_is_no_square():
    camera = straight_camera(640, 480, k1=0.0, side_cm=90.0)
    seen = camera.project(np.array([(15, 20, 0), (75, 20, 0), (75, 60, 0), (15, 60, 0)], float))
    found = by_corners(seen, (640, 480), (60.0, 40.0), 165.0)
    assert found.lens.focal_px == pytest.approx(camera.lens.focal_px, rel=1e-5)
    (there,) = found.back_project(camera.project(np.array([(20.0, 50.0, 4.0)])), 4.0)
    np.testing.assert_allclose(there, (5.0, 30.0), atol=0.01)


@pytest.mark.parametrize(("corners", "why"), [
    ([(10, 10), (400, 10), (150, 150), (10, 400)], "no.*convex quadrilateral"),
    ([(10, 10), (400, 10), (400, 400), (10, 10)], "convex quadrilateral"),
    ([(10, 10), (200, 200), (400, 400), (100, 300)], "convex quadrilateral"),
    ([(10, 10), (980, 10), (400, 400), (10, 400)], "980,10.*far outside of the picture of 480 x 480 px"),
    ([(-500, 10), (400, 10), (400, 400), (10, 400)], "-500,10.*far outside"),
    ([(10, 10), (40, 10), (40, 40), (10, 40)], "shortest side is 30 px.*at least 48"),
    ([(10, 10), (400, 10), (400, 400)], "four corners"),
    ([(10, 10), (400, 10), (400, 400), (10, math.nan)], "four corners"),
    ([1, 2, 3, 4], "four corners"),
])  # fmt: skip
def test_corners_that_cannot_be(corners, why):
    with pytest.raises(FilmError, match=rf"^--corners .*{why}"):
        by_corners(corners, (480, 480))


# --- corners in pictures --------------------------------------------------------------------------


def off_px(camera, corners):
    """Return how far corners found are from the true ones, at most."""
    assert corners is not None
    return max(np.hypot(*(camera.project(FLOOR) - corner).T).min() for corner in corners)


@pytest.mark.parametrize("camera", [
    straight_camera(240, 240, k1=-0.1),
    straight_camera(240, 240, k1=0.1),
    straight_camera(640, 360, k1=0.0),
    straight_camera(480, 480, k1=-0.05),
    *(tilted_camera(tilt, turn, -0.05) for tilt, turn in ((5.0, -30.0), (15.0, 15.0))),  # farther, walls hide the floor
], ids=lambda _: "camera")  # fmt: skip
def test_finds_the_floor(camera):
    room = room_picture(camera, noise=0.0)
    for noise in (0.0, 2.0, 10.0):
        noisy = room + noise * np.random.default_rng(0).standard_normal(room.shape)
        assert off_px(camera, find_corners(np.clip(noisy, 0, 255).astype(np.uint8))) < 0.5


def test_finds_it_behind_robots():
    at_walls = [(3.7, 3.7), (3.7, 30.0), (45.0, 56.3), (37.5, 56.3), (56.3, 3.7), (20.0, 3.7)]
    camera = straight_camera()
    for seed in range(2):
        free = [c for c in scattered(6, np.random.default_rng(seed)) if all(math.dist(c, at) > 7.4 for at in at_walls)]
        assert off_px(camera, find_corners(room_picture(camera, at_walls + free, seed=seed))) < 1.0


def test_rings_are_where_corners_found_in_the_light_say():
    camera = straight_camera()
    centres = scattered(10, np.random.default_rng(3))
    found = by_corners(find_corners(room_picture(camera)), (480, 480))
    rings = rings_in(found, ring_picture(camera, centres))
    assert matched(rings, centres, within_cm=0.3) == len(rings) == 10


def test_finds_no_floor_where_there_is_none():
    camera = straight_camera(240, 240)
    room = room_picture(camera)
    assert find_corners(room) is not None
    assert find_corners(ring_picture(camera, scattered(8, np.random.default_rng(0)))) is None  # dark
    assert find_corners(np.full((240, 240, 3), 140, np.uint8)) is None  # nothing but floor
    assert find_corners(np.ascontiguousarray(room[30:210, 30:210])) is None  # walls out of the picture
    stripes = np.where(np.arange(240)[:, None, None] // 8 % 2, 60, 220) * np.ones((240, 240, 3))
    assert find_corners(stripes.astype(np.uint8)) is None
    for corners in (cv2.ellipse2Poly((120, 120), (100, 100), 0, 0, 360, 5), [(20, 220), (220, 220), (120, 20)]):
        shape = np.full((240, 240, 3), 30, np.uint8)
        assert find_corners(cv2.fillPoly(shape, [np.array(corners)], (150, 150, 150))) is None


# --- from rings -----------------------------------------------------------------------------------


def seen_by(camera, centres=AT_RINGS[:, :2]):
    """Return rings as a camera shows them."""
    places = camera.project(np.column_stack([centres, np.full(len(centres), epuck.RING_HEIGHT_CM)]))
    return expected_rings(camera, places, epuck.RING_RADIUS_CM)


def by_rings(rings, above_cm=110.0, corners=None):
    return fit_camera((640, 480), (60, 60), above_cm, rings, corners)


def true_camera(lens, tilt_deg=0.0):
    tilt = math.radians(tilt_deg)
    rotation = cv2.Rodrigues(np.array([tilt, 0.5 * tilt, 0.0]))[0] @ LOOKING_DOWN
    position = np.array([30.0, 30.0, 0.0]) + rotation[2] * 110.0 / rotation[2, 2]
    return CameraModel(640, 480, lens, rotation, position)


@pytest.mark.parametrize("tilt_deg", [0.0, 8.0, 25.0])
@pytest.mark.parametrize("k1", [-0.2, 0.0])
def test_size_and_shape_of_rings_tell_tilt_and_distortion(k1, tilt_deg):
    camera = true_camera(simple_lens(640, 480, 700.0, k1), tilt_deg)
    fitted = by_rings(seen_by(camera))
    assert worst_cm(fitted.camera, camera) < 0.2
    assert fitted.tilt_deg == pytest.approx(math.degrees(math.acos(-camera.rotation[2, 2])), abs=0.5)
    assert fitted.error_cm < 6  # a bound that rounding moves, where tilt and distortion hardly differ
    assert not fitted.camera.lens.is_fisheye


def test_a_fisheye_is_told_from_a_usual_lens():
    camera = true_camera(fisheye_lens(640, 480, 330.0))._replace(position_cm=np.array([30.0, 30.0, 40.0]))
    fitted = by_rings(seen_by(camera), 40.0)
    assert fitted.camera.lens.is_fisheye
    assert worst_cm(fitted.camera, camera) < 0.1


def test_rings_tell_the_distortion_that_corners_alone_do_not():
    camera = true_camera(simple_lens(640, 480, 700.0, -0.25), 5.0)
    corners = camera.project(FLOOR)
    assert worst_cm(by_corners(corners, (640, 480)), camera) > 0.3
    assert worst_cm(by_rings(seen_by(camera), corners=corners).camera, camera) < 0.15


def test_a_ring_that_is_none_does_little_harm_and_a_few_tell_the_scale_alone():
    camera = true_camera(simple_lens(640, 480, 700.0, -0.2))
    seen = seen_by(camera)
    radius = seen.radius_px * np.where(np.arange(len(seen.radius_px)) == 4, 1.5, 1.0)
    assert worst_cm(by_rings(seen._replace(radius_px=radius)).camera, camera) < 0.3
    fitted = by_rings(seen_by(camera, np.array([(30.0, 30.0), (20.0, 30.0)])))
    assert fitted.camera.lens.coefficients[0] == fitted.tilt_deg == 0
    assert fitted.camera.lens.focal_px == pytest.approx(700, rel=0.02)
