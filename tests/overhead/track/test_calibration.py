import itertools
import math

import cv2
import numpy as np
import pytest

from epuck_sim import epuck
from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera_model import CameraModel, overhead_camera
from epuck_sim.overhead.track.calibration import MAX_RINGS, camera_from_corners, camera_from_rings, measure_radius
from epuck_sim.overhead.track.floor_corners import find_corners
from epuck_sim.scenario.overhead import OverheadSection
from tests.overhead.track.drawn_rings import (
    APART_CM,
    CLEAN,
    USUAL,
    finder_for,
    matched,
    ring_picture,
    room_picture,
    scattered,
    straight_camera,
    tilted_camera,
)

FLOOR = np.array([(0, 0, 0), (60, 0, 0), (60, 60, 0), (0, 60, 0)], float)
AT_RINGS = np.array([(x, y, epuck.RING_HEIGHT_CM) for x in (4.0, 30.0, 56.0) for y in (4.0, 30.0, 56.0)])


def worst_cm(found: CameraModel, true: CameraModel):
    """Return how far rings are misplaced by a camera that was found, at most."""
    back = found.back_project(true.project(AT_RINGS), epuck.RING_HEIGHT_CM)
    return np.hypot(*(back - AT_RINGS[:, :2]).T).max()


# --- the camera model -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("degrees", "k1"), [(None, -0.05), (None, -0.3), (45.0, -0.3), (None, 0.3), (120.0, 0.3)])
def test_pixels_show_the_points_that_are_seen_there(degrees, k1):
    camera = overhead_camera(OverheadSection(field_of_view_deg=degrees, distortion=k1), 60, 60)
    pixels = np.random.default_rng(0).uniform(0, 479, (50, 2))
    pixels[:4] = (0, 0), (479, 0), (0, 479), (479, 479)
    for z_cm in (0.0, epuck.RING_HEIGHT_CM):
        points = np.column_stack([camera.back_project(pixels, z_cm), np.full(50, z_cm)])
        np.testing.assert_allclose(camera.project(points), pixels, atol=1e-3)


# --- from corners ---------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(480, 480), (1920, 1080)])
def test_finds_a_camera_that_looks_straight_down(size):
    camera = straight_camera(*size, k1=0.0)
    found = camera_from_corners(camera.project(FLOOR), *size, 60, 60, 110.0)
    assert found.focal_px == pytest.approx(camera.focal_px, rel=1e-6)
    np.testing.assert_allclose(found.position_cm, camera.position_cm, atol=0.05)  # askew by nothing: hard to tell
    assert worst_cm(found, camera) < 0.01


@pytest.mark.parametrize("tilt", [1.0, 5.0, 15.0, 30.0])
@pytest.mark.parametrize("turn", [-40.0, 0.0, 25.0])
def test_finds_a_camera_that_looks_askew(tilt, turn):
    camera = tilted_camera(tilt, turn)
    found = camera_from_corners(camera.project(FLOOR), 640, 480, 60, 60, 110.0)
    assert found.focal_px == pytest.approx(camera.focal_px, rel=1e-4)
    np.testing.assert_allclose(found.position_cm, camera.position_cm, atol=0.05)
    np.testing.assert_allclose(found.rotation, camera.rotation, atol=1e-3)
    assert worst_cm(found, camera) < 0.01


def test_corners_that_are_a_pixel_off_misplace_rings_by_little():
    for seed in range(20):
        generator = np.random.default_rng(seed)
        camera = tilted_camera(generator.uniform(0, 20), generator.uniform(-25, 25))
        corners = camera.project(FLOOR) + generator.uniform(-0.7, 0.7, (4, 2))
        assert worst_cm(camera_from_corners(corners, 640, 480, 60, 60, 110.0), camera) < 0.35


def test_a_usual_distortion_misplaces_rings_by_little():
    camera = straight_camera(k1=-0.05)
    assert worst_cm(camera_from_corners(camera.project(FLOOR), 480, 480, 60, 60, 110.0), camera) < 0.2


def test_corners_come_in_any_order_and_the_origin_is_at_the_lower_left():
    camera = straight_camera(640, 480, k1=0.0)
    for mixed in itertools.permutations(camera.project(FLOOR)):
        assert worst_cm(camera_from_corners(mixed, 640, 480, 60, 60, 110.0), camera) < 0.01


def test_an_arena_that_is_no_square():
    camera = straight_camera(640, 480, k1=0.0, side_cm=90.0)
    seen = camera.project(np.array([(15, 20, 0), (75, 20, 0), (75, 60, 0), (15, 60, 0)], float))
    found = camera_from_corners(seen, 640, 480, 60.0, 40.0, 165.0)
    assert found.focal_px == pytest.approx(camera.focal_px, rel=1e-5)
    (there,) = found.back_project(camera.project(np.array([(20.0, 50.0, 4.0)])), 4.0)
    np.testing.assert_allclose(there, (5.0, 30.0), atol=0.01)


@pytest.mark.parametrize(("corners", "why"), [
    ([(10, 10), (400, 10), (150, 150), (10, 400)], "no.*convex quadrilateral"),
    ([(10, 10), (400, 10), (400, 400), (10, 10)], "convex quadrilateral"),
    ([(10, 10), (200, 200), (400, 400), (100, 300)], "convex quadrilateral"),
    ([(10, 10), (480, 10), (400, 400), (10, 400)], "480,10.*outside of the picture.*0 to 479"),
    ([(-1, 10), (400, 10), (400, 400), (10, 400)], "-1,10.*outside"),
    ([(10, 10), (40, 10), (40, 40), (10, 40)], "shortest side is 30 px.*at least 48"),
    ([(10, 10), (400, 10), (400, 400)], "four corners"),
    ([(10, 10), (400, 10), (400, 400), (10, math.nan)], "four corners"),
    ([1, 2, 3, 4], "four corners"),
])  # fmt: skip
def test_corners_that_cannot_be(corners, why):
    with pytest.raises(FilmError, match=rf"^--corners .*{why}"):
        camera_from_corners(corners, 480, 480, 60, 60, 110.0)


# --- corners in pictures --------------------------------------------------------------------------


def off_px(camera, corners):
    """Return how far corners found are from the true ones, at most."""
    assert corners is not None
    true = camera.project(FLOOR)
    return max(np.hypot(*(true - corner).T).min() for corner in corners)


@pytest.mark.parametrize(("size", "k1"), [
    ((240, 240), -0.1),
    ((240, 240), 0.1),
    ((640, 360), 0.0),
    ((480, 480), -0.05),
])  # fmt: skip
def test_finds_the_floor(size, k1):
    camera = straight_camera(*size, k1=k1)
    room = room_picture(camera, noise=0.0)
    for noise in (0.0, 2.0, 10.0):
        noisy = room + noise * np.random.default_rng(0).standard_normal(room.shape)
        assert off_px(camera, find_corners(np.clip(noisy, 0, 255).astype(np.uint8))) < 0.5


@pytest.mark.parametrize(("tilt", "turn"), [(5.0, -30.0), (15.0, 0.0), (15.0, 15.0)])  # farther, walls hide the floor
def test_finds_it_askew(tilt, turn):
    camera = tilted_camera(tilt, turn, -0.05)
    assert off_px(camera, find_corners(room_picture(camera))) < 0.5


def test_finds_it_behind_robots():
    at_walls = [(3.7, 3.7), (3.7, 30.0), (45.0, 56.3), (37.5, 56.3), (56.3, 3.7), (20.0, 3.7)]
    camera = straight_camera()
    for seed in range(2):
        free = [c for c in scattered(6, np.random.default_rng(seed)) if all(math.dist(c, at) > 7.4 for at in at_walls)]
        assert off_px(camera, find_corners(room_picture(camera, at_walls + free, seed=seed))) < 1.0


def test_rings_are_where_corners_found_in_the_light_say():
    camera = straight_camera()
    corners = find_corners(room_picture(camera))
    centres = scattered(10, np.random.default_rng(3))
    rings = finder_for(camera_from_corners(corners, 480, 480, 60, 60, 110.0)).find(ring_picture(camera, centres))
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
    disc = np.full((240, 240, 3), 30, np.uint8)
    cv2.circle(disc, (120, 120), 100, (150, 150, 150), -1)
    assert find_corners(disc) is None
    triangle = np.full((240, 240, 3), 30, np.uint8)
    cv2.fillPoly(triangle, [np.array([(20, 220), (220, 220), (120, 20)])], (150, 150, 150))
    assert find_corners(triangle) is None


# --- from rings -----------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(160, 160), (240, 240), (480, 480)])
@pytest.mark.parametrize("look", [CLEAN, USUAL, USUAL._replace(noise=10.0, jpeg=True)])
def test_measures_rings(size, look):
    camera = straight_camera(*size, k1=0.0)
    true = camera.focal_px * epuck.RING_RADIUS_CM / (camera.position_cm[2] - epuck.RING_HEIGHT_CM)
    pictures = [ring_picture(camera, scattered(4, np.random.default_rng(seed)), look, seed) for seed in range(2)]
    assert measure_radius(pictures) == pytest.approx(true, rel=0.02)


def test_measures_only_whole_rings_that_touch_nothing():
    camera = straight_camera()
    pair = ring_picture(camera, [(20, 20), (20 + APART_CM, 20)])
    disc = np.zeros((480, 480, 3), np.uint8)
    cv2.circle(disc, (240, 240), 26, (255, 60, 60), -1)
    arc = np.zeros((480, 480, 3), np.uint8)
    cv2.ellipse(arc, (240, 240), (26, 26), 0, 0, 320, (255, 60, 60), 7)
    lit = ring_picture(camera, [(20, 20)], room=140.0)
    assert measure_radius([pair, disc, arc, lit, np.zeros((480, 480, 3), np.uint8)]) is None
    assert measure_radius([]) is None
    assert measure_radius([pair, ring_picture(camera, [(30, 30)])]) == pytest.approx(26.4, rel=0.02)


def test_measures_until_it_is_enough():
    picture = ring_picture(straight_camera(240, 240), [(10, 10), (30, 30), (50, 10)])
    pictures = iter([picture] * MAX_RINGS)
    assert measure_radius(pictures) is not None
    assert len(list(pictures)) == MAX_RINGS - MAX_RINGS / 3


def test_a_camera_from_rings_sees_rings_so_large():
    camera = camera_from_rings([25.0, 26.0, 80.0], 640, 480, 60, 60, 110.0)
    assert camera.project(np.array([(30.0, 30.0, 4.0), (33.5, 30.0, 4.0)])) == pytest.approx(
        np.array([(319.5, 239.5), (345.5, 239.5)]), abs=1e-3
    )
    assert camera.position_cm.tolist() == [30.0, 30.0, 110.0]
    assert camera_from_rings(26.0, 640, 480, 90, 60, 200.0).position_cm.tolist() == [45.0, 30.0, 200.0]


@pytest.mark.parametrize("radii", [[], [0.0], [-3.0], [math.nan, 20.0]])
def test_radii_that_cannot_be(radii):
    with pytest.raises(FilmError, match=r"radii are .* px; allowed: one or more, above 0"):
        camera_from_rings(radii, 480, 480, 60, 60, 110.0)


def test_a_film_without_corners_is_counted_all_the_same():
    camera = straight_camera()
    centres = scattered(10, np.random.default_rng(5))
    picture = ring_picture(camera, centres)
    radius_px = measure_radius([picture])
    rings = finder_for(camera_from_rings(radius_px, 480, 480, 60, 60, 110.0)).find(picture)
    assert matched(rings, centres, within_cm=1.0) == len(rings) == 10
