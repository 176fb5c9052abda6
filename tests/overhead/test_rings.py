"""Lit rings are found where they are, in the dark and in the light, and nothing else is taken for one."""

import math

import cv2
import numpy as np
import pytest
from scipy import ndimage

from epuck_sim import epuck
from epuck_sim.overhead.camera import Frame, Geometry
from epuck_sim.overhead.light import Background, LightMeter, is_lit, ring_light
from epuck_sim.overhead.rings import MAX_CELLS_PER_PIXEL, MAX_REACH_HEIGHTS, fit_ring, rectified_view
from tests.overhead.drawn_rings import (
    APART_CM,
    CLEAN,
    USUAL,
    honeycomb_cell,
    matched,
    ring_picture,
    rings_in,
    room_picture,
    scattered,
    straight_camera,
    tilted_camera,
    touching,
)
from tests.overhead.films import make_camera, make_geometry

SIZES = [(240, 240), (480, 480)]
NOISY = USUAL._replace(noise=10.0, jpeg=True)


def found(camera, centres, look=USUAL, **more):
    """Return the rings found in a picture, after the check that they are the true ones."""
    rings = rings_in(camera, ring_picture(camera, centres, look, **more))
    assert matched(rings, centres) == len(rings) == len(centres)
    assert [ring.x_px for ring in rings] == sorted(ring.x_px for ring in rings)
    return rings


# --- one ring -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("size", "k1"), [((240, 240), -0.1), ((480, 480), 0.0), ((320, 240), 0.1)])
def test_places_a_ring_anywhere(size, k1):
    camera = straight_camera(*size, k1=k1)
    for centre in [(3.7, 3.7), (56.3, 3.7), (3.7, 56.3), (30.0, 30.0), (17.21, 48.93), (56.3, 29.4)]:
        (ring,) = found(camera, [centre], CLEAN)
        assert math.hypot(ring.x_cm - centre[0], ring.y_cm - centre[1]) < 0.05
        assert ring.radius_cm == pytest.approx(epuck.RING_RADIUS_CM, abs=0.15)
        at = np.array([(*centre, epuck.RING_HEIGHT_CM), (centre[0] + ring.radius_cm, centre[1], epuck.RING_HEIGHT_CM)])
        middle, side = camera.project(at)
        assert (ring.x_px, ring.y_px) == pytest.approx(middle, abs=0.5)
        assert ring.radius_px == pytest.approx(math.hypot(*(side - middle)), rel=0.06)  # distorted: no circle


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_finds_one_that_was_lit_for_a_part_of_the_exposure_but_no_sliver(share):
    camera = straight_camera()
    found(camera, [(20.0, 20.0), (20.0, 20.0 + APART_CM), (45.0, 30.0)], share=[1.0, share, share])
    assert rings_in(camera, ring_picture(camera, [(20.0, 20.0)], share=[0.01])) == []


@pytest.mark.parametrize("look", [
    USUAL._replace(modulation=0.8),
    USUAL._replace(modulation=0.0),
    USUAL._replace(bloom=0.2),
    USUAL._replace(blur_px=1.5),
    USUAL._replace(peak=0.5),
    USUAL._replace(peak=6.0),
])  # fmt: skip
def test_survives_another_exposure(look):
    found(straight_camera(), [*honeycomb_cell(), (30.0, 30.0), (50.0, 12.0)], look)
    found(straight_camera(), honeycomb_cell(), look)


def test_sees_it_askew():
    found(tilted_camera(25.0, 130.0, k1=-0.05), [(8.0, 50.0), (8.0 + APART_CM, 50.0), (50.0, 9.0)])


# --- no ring --------------------------------------------------------------------------------------


@pytest.mark.parametrize("room", [0.0, 130.0])
def test_finds_nothing_where_nothing_shines(room):
    camera = straight_camera(240, 240)
    for seed, noise in enumerate((0.0, 2.0, 10.0)):
        assert rings_in(camera, ring_picture(camera, [], USUAL._replace(noise=noise), seed, room=room)) == []


def test_a_lamp_a_disc_a_stripe_and_half_a_ring_are_none():
    camera = straight_camera(k1=0.0)
    picture = np.zeros((480, 480, 3), np.uint8)
    cv2.circle(picture, (100, 100), 30, (255, 90, 90), -1)
    cv2.circle(picture, (400, 100), 8, (255, 90, 90), -1)
    cv2.circle(picture, (240, 100), 50, (255, 90, 90), 7)
    cv2.rectangle(picture, (50, 300), (450, 310), (255, 90, 90), -1)
    cv2.ellipse(picture, (240, 400), (25, 25), 0, 0, 200, (255, 90, 90), 7)
    assert rings_in(camera, picture) == []
    cv2.ellipse(picture, (240, 400), (25, 25), 0, 0, 360, (255, 90, 90), 7)
    assert len(rings_in(camera, picture)) == 1


# --- rings that touch -----------------------------------------------------------------------------


@pytest.mark.parametrize("size", SIZES)
def test_two_robots_in_contact_are_two(size):
    camera = straight_camera(*size)
    for angle in np.radians(np.arange(0, 180, 36)):
        for look in (USUAL, NOISY):
            rings = found(camera, [(40, 22), (40 + APART_CM * math.cos(angle), 22 + APART_CM * math.sin(angle))], look)
            apart = math.hypot(rings[0].x_cm - rings[1].x_cm, rings[0].y_cm - rings[1].y_cm)
            assert apart == pytest.approx(APART_CM, abs=0.15)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("look", [USUAL, NOISY])
def test_chains_and_honeycombs(size, look):
    camera = straight_camera(*size)
    found(camera, [(4 + APART_CM * i, 20.0) for i in range(8)], look)
    for turn in (0.0, 0.3):
        around = honeycomb_cell(turn=turn)
        found(camera, around, look)  # the robot in the middle is dark
        found(camera, [*around, (30.0, 30.0)], look)
        found(camera, around[:5], look)


@pytest.mark.parametrize("pictures", [6, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("place", [scattered, touching])
@pytest.mark.parametrize("look", [USUAL, NOISY])
def test_counts_random_swarms(place, look, pictures):
    true = good = claimed = 0
    camera = straight_camera()
    for seed in range(pictures):
        generator = np.random.default_rng(seed)
        centres = place(10, generator)
        lit = centres[generator.random(10) < generator.choice([0.2, 0.5, 0.8, 1.0])]
        rings = rings_in(camera, ring_picture(camera, lit, look, seed))
        good += matched(rings, lit)
        true, claimed = true + len(lit), claimed + len(rings)
    assert true > 5 * pictures
    assert good / true >= 0.99
    assert good / claimed >= 0.99


# --- a lit room -----------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(240, 240), (480, 480), (640, 360)])
def test_finds_rings_in_a_lit_room(size):
    camera = straight_camera(*size)
    for seed in range(3):
        found(camera, scattered(6, np.random.default_rng(seed)), room=140.0)
    found(camera, honeycomb_cell(), room=140.0)
    found(camera, [*honeycomb_cell(), (30.0, 30.0)], room=140.0)


def test_grey_things_are_no_rings():
    camera = straight_camera(240, 240)
    picture = room_picture(camera, scattered(8, np.random.default_rng(0)))
    cv2.circle(picture, (120, 120), 13, (255, 255, 255), 3)
    assert rings_in(camera, picture) == []


def test_whether_the_room_is_lit():
    wide = straight_camera(320, 180)
    assert is_lit(room_picture(wide))  # most of it is a dark table
    assert is_lit(room_picture(tilted_camera(20.0, 40.0)))
    assert not is_lit(ring_picture(wide, touching(30, np.random.default_rng(0)), NOISY))
    assert not is_lit(np.zeros((64, 64, 3), np.uint8))


def test_light_is_bright_or_coloured():
    picture = np.array([[(200, 90, 120), (90, 200, 120), (90, 90, 90)]], np.uint8)
    np.testing.assert_array_equal(ring_light(picture).levels, [[110, 110, 0]])  # the room is lit
    np.testing.assert_array_equal(ring_light(picture - 80).levels, [[57, 57, 10]])
    learnt = Background(np.array([[4, 4, 3]], np.uint8))
    np.testing.assert_array_equal(learnt.light_beyond(Frame(0.0, picture - 80)).levels, [[53, 53, 7]])


# --- how it is done -------------------------------------------------------------------------------


@pytest.mark.parametrize("camera", [straight_camera(240, 240, k1=-0.1), tilted_camera(15.0, 30.0, k1=0.05)])
def test_the_rectified_view_shows_what_the_pixels_there_show(camera):
    light = np.random.default_rng(0).integers(0, 256, (camera.height_px, camera.width_px)).astype(np.uint8)
    light = cv2.GaussianBlur(light, (0, 0), 1.5)
    view = rectified_view(camera)
    sampled = view.sample(light)
    rows, columns = (cells[::17, ::17].ravel() for cells in np.indices(sampled.shape))
    points = view.origin_cm + np.column_stack([columns, rows]) / view.cells_per_cm
    pixels = camera.project(np.column_stack([points, np.full(len(rows), epuck.RING_HEIGHT_CM)]))
    is_in = ((pixels >= 0) & (pixels <= (camera.width_px - 1, camera.height_px - 1))).all(axis=1)
    assert np.count_nonzero(is_in) > 100
    slow = ndimage.map_coordinates(light.astype(float), pixels[is_in, ::-1].T, order=1)
    np.testing.assert_allclose(sampled[rows, columns][is_in], slow, atol=2)  # maps have 32 steps a pixel


def test_the_view_of_a_camera_that_sees_the_horizon_is_bounded():
    camera = tilted_camera(70.0, 0.0)
    view = rectified_view(camera)
    rows, columns = view.fractions.shape
    assert max(rows, columns) <= (2 * MAX_REACH_HEIGHTS * camera.position_cm[2] + 1) * view.cells_per_cm
    assert rows * columns <= 1.1 * MAX_CELLS_PER_PIXEL * camera.width_px * camera.height_px


def test_a_fit_finds_the_centre_from_a_centimetre_off():
    cells = 6
    y, x = np.mgrid[0:120, 0:120] / cells
    light = 255 * np.clip(3 * np.exp(-(((np.hypot(x - 9.3, y - 10.4) - 3.5) / 0.3) ** 2) / 2), 0, 1)
    for dx, dy in ((0, 0), (0.7, 0.7), (-1.0, 0), (0, 0.9)):
        fit = fit_ring(light.astype(np.uint8), cells, (9.3 + dx) * cells, (10.4 + dy) * cells, 40)
        assert fit is not None
        assert (fit.column / cells, fit.row / cells) == pytest.approx((9.3, 10.4), abs=0.02)
        assert fit.covered == 1
        assert fit.misfit_cm < 0.02
    assert fit_ring(light.astype(np.uint8), cells, 60 * cells, 60 * cells, 40) is None


# --- the lit area of the floor ------------------------------------------------------------------

ROWS = COLUMNS = 240
DARK = np.zeros((ROWS, COLUMNS, 3), np.uint8)
SPOTS = [(40, 60), (150, 62), (200, 180)]
SPOT_PX = 10


def room(level: float, flicker: float, bands: float, turned: bool, spots: int) -> np.ndarray:
    """Return a picture of a room with light in bands, and square spots of light."""
    along = np.arange(ROWS) / ROWS * bands * 2 * np.pi
    levels = np.repeat(level * (1 + flicker * np.sin(along))[:, None], COLUMNS, axis=1)
    for row, column in SPOTS[:spots]:
        levels[row : row + SPOT_PX, column : column + SPOT_PX] += 100
    levels = levels.T if turned else levels
    return np.repeat(levels[:, :, None], 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize("knows_floor", [True, False])
@pytest.mark.parametrize("turned", [True, False])
@pytest.mark.parametrize(("flicker", "bands"), [(0, 0), (0.4, 0), (0.4, 0.5), (0.4, 2.5), (0.8, 7)])
def test_lamps_that_flicker_change_nothing(flicker: float, bands: float, turned: bool, knows_floor: bool) -> None:
    meter = LightMeter(Geometry(make_camera(), (60.0, 60.0), "somewhere", knows_floor))
    background = ring_light(room(20 * (1 - flicker), 0, 0, False, 0)).levels
    for spots in range(4):
        steady = meter.lit_px(ring_light(room(0, 0, 0, turned, spots)).levels)
        assert steady == pytest.approx(spots * (SPOT_PX + 1) ** 2, rel=0.3)
        flickering = cv2.subtract(ring_light(room(20, flicker, bands, turned, spots)).levels, background)
        assert meter.lit_px(flickering) == pytest.approx(steady, rel=0.1)


def test_light_outside_of_the_floor_does_not_count() -> None:
    geometry = make_geometry()
    outside = DARK.copy()
    outside[:4, :100] = outside[100:200, -4:] = 200
    assert LightMeter(geometry).lit_px(ring_light(outside).levels) == 0
    assert LightMeter(geometry._replace(knows_floor=False)).lit_px(ring_light(outside).levels) > 700
