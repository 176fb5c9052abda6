"""Lit rings are found where they are, in the dark and in the light, and nothing else is taken for one."""

import itertools
import math

import cv2
import numpy as np
import pytest
from scipy import ndimage

from epuck_sim import epuck
from epuck_sim.overhead import rings as ring_finding
from epuck_sim.overhead.camera import Frame, Geometry
from epuck_sim.overhead.flashes import LightMeter, RingCounter
from epuck_sim.overhead.rings import DISC_LIGHT, Background, RectifiedView, RingFinder, fit_ring, is_lit, ring_light
from tests.overhead import cameras
from tests.overhead.cameras import APART_CM, CLEAN, camera_of, honeycomb_cell, picture_of, rings_in, scattered, shot
from tests.overhead.films import Score, compare, make_geometry

SMALL = {"width_px": 240, "height_px": 240}
NOISY = {"noise_levels": 10}


def score(rings, centres) -> Score:
    """Compare the rings found with those that are lit, and check that they come from left to right."""
    assert [ring.x_px for ring in rings] == sorted(ring.x_px for ring in rings)
    reported, lit = np.array([ring[:2] for ring in rings]).reshape(-1, 2), np.reshape(centres, (-1, 2))
    return compare(reported, lit, np.empty((0, 2)))


def found(centres, *, room=False, shares=1.0, quality=0, **settings):
    """Return the rings found in a picture, after the check that they are the true ones."""
    picture = picture_of(centres, room=room, shares=shares, quality=quality, **settings)
    rings = rings_in(picture, **settings)
    scored = score(rings, centres)
    assert (scored.found, scored.missed, scored.false) == (len(centres), 0, 0)
    assert scored.worst_cm < 0.2
    return rings


@pytest.mark.parametrize(("size", "k1"), [((240, 240), -0.1), ((480, 480), 0.0), ((320, 240), 0.1)])
def test_places_a_ring_anywhere(size, k1):
    settings = {"width_px": size[0], "height_px": size[1], "distortion": k1}
    camera = camera_of(**settings)
    for centre in [(3.7, 3.7), (56.3, 3.7), (30.0, 30.0), (17.21, 48.93), (56.3, 29.4)]:
        (ring,) = found([centre], **CLEAN, **settings)
        assert math.hypot(ring.x_cm - centre[0], ring.y_cm - centre[1]) < 0.05
        assert ring.radius_cm == pytest.approx(epuck.RING_RADIUS_CM, abs=0.15)
        at = np.array([(*centre, epuck.RING_HEIGHT_CM), (centre[0] + ring.radius_cm, centre[1], epuck.RING_HEIGHT_CM)])
        middle, side = camera.project(at)
        assert (ring.x_px, ring.y_px) == pytest.approx(middle, abs=0.5)
        assert ring.radius_px == pytest.approx(math.hypot(*(side - middle)), rel=0.06)  # distorted: no circle


def test_finds_rings_lit_for_a_part_of_the_exposure_but_no_sliver_and_no_reflections_in_walls():
    found([(20.0, 20.0), (20.0, 20.0 + APART_CM), (45.0, 30.0)], shares=[1.0, 0.2, 0.5])
    assert rings_in(picture_of([(20.0, 20.0)], gain=0.01)) == []
    found([(8.0, 30.0), (30.0, 52.0)], gloss=0.08, field_of_view_deg=45.0)


@pytest.mark.parametrize("look", [
    {"led_points": True, "gain": 2.0}, {"bloom": 0.2}, {"blur_px": 1.5}, {"gain": 0.2}, {"gain": 3.0},
    {"tilt_deg": 25.0, "turn_deg": 130.0, "width_px": 640},
], ids=str)  # fmt: skip
def test_survives_another_exposure_and_sees_askew(look):
    found([*honeycomb_cell(), (30.0, 30.0), (50.0, 12.0)], **look)


@pytest.mark.parametrize("pictures", [6, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("place", [scattered, cameras.touching])
def test_counts_random_swarms(place, pictures):
    total = Score()
    for seed in range(pictures):
        generator = np.random.default_rng(seed)
        centres = place(10, generator)
        lit = centres[generator.random(10) < generator.choice([0.2, 0.5, 0.8, 1.0])]
        total += score(rings_in(picture_of(lit, quality=70, **NOISY), **NOISY), lit)
    assert total.found > 4 * pictures
    assert total.recall >= 0.99
    assert total.precision >= 0.99


@pytest.mark.parametrize("look", [
    SMALL, {"quality": 70, **NOISY}, {"room": True, **SMALL}, {"room": True, "width_px": 640, "height_px": 360},
], ids=str)  # fmt: skip
def test_finds_chains_honeycombs_and_scattered_rings_in_the_dark_and_in_a_lit_room(look):
    around = honeycomb_cell(0.3)  # the robot in the middle is dark, or lit
    chain = [(4 + APART_CM * i, 20.0) for i in range(8)]
    some = scattered(6, np.random.default_rng(0))
    for centres in (chain, around, [*around, (30.0, 30.0)], honeycomb_cell(0.0)[:5], some):
        found(centres, **look)


def test_nothing_a_lamp_a_disc_with_or_without_a_hole_a_stripe_and_half_a_ring_are_none():
    dark = {"lit": False, **SMALL}
    for room, noise in itertools.product((False, True), (0.0, 10.0)):
        picture = picture_of(scattered(8, np.random.default_rng(0)), room=room, noise_levels=noise, **dark)
        if room:
            cv2.circle(picture, (120, 120), 13, (255, 255, 255), 3)  # what is grey is no ring
        assert rings_in(picture, noise_levels=noise, **SMALL) == []
    picture = np.zeros((480, 480, 3), np.uint8)
    cv2.circle(picture, (100, 100), 30, (255, 90, 90), -1)
    cv2.circle(picture, (400, 100), 8, (255, 90, 90), -1)
    cv2.circle(picture, (240, 100), 50, (255, 90, 90), 7)
    cv2.circle(picture, (100, 400), 46, (255, 90, 90), -1)
    cv2.circle(picture, (100, 400), 22, (0, 0, 0), -1)
    cv2.rectangle(picture, (50, 300), (450, 310), (255, 90, 90), -1)
    cv2.ellipse(picture, (240, 400), (25, 25), 0, 0, 200, (255, 90, 90), 7)
    assert rings_in(picture, distortion=0.0) == []
    cv2.ellipse(picture, (240, 400), (25, 25), 0, 0, 360, (255, 90, 90), 7)
    assert len(rings_in(picture, distortion=0.0)) == 1


def test_rings_that_are_burnt_out_to_discs_are_found_where_the_scale_is_known() -> None:
    camera = camera_of()
    places = np.array([(15.0, 15.0), (30.0, 40.0), (30.0 + 8.5, 40.0), (50.0, 20.0)])
    picture = np.zeros((480, 480, 3), np.uint8)
    for x_px, y_px in camera.project(np.column_stack([places, np.full(4, 4.0)])):
        cv2.circle(picture, (round(x_px), round(y_px)), round(5.0 * 480 / 65), (255, 255, 255), -1)
    light, _ = ring_light(Frame(0.0, picture))
    rings = RingFinder(camera, sees_discs=True).find(light)
    found = np.array(sorted((ring.x_cm, ring.y_cm) for ring in rings))
    assert found == pytest.approx(np.array(sorted(map(tuple, places))), abs=0.5)
    assert {ring.light for ring in rings} == {DISC_LIGHT}
    assert RingFinder(camera).find(light) == []


def test_whether_the_room_is_lit_and_light_is_bright_or_coloured_and_not_counted_outside_of_the_floor():
    wide = {"width_px": 320, "height_px": 180}  # most of it is a dark table
    swarm = picture_of(cameras.touching(30, np.random.default_rng(0)), **wide)
    dark, grey = np.full((64, 64, 3), 39, np.uint8), np.full((64, 64, 3), 40, np.uint8)
    room, turned = picture_of([], room=True, **wide), picture_of([], room=True, tilt_deg=20.0, turn_deg=40.0)
    seen = [is_lit(Frame(0.0, picture).colours) for picture in (room, turned, grey, swarm, dark)]
    assert seen == [True, True, True, False, False]
    picture = np.array([[(200, 90, 120), (90, 200, 120), (90, 90, 90)]], np.uint8)
    learnt = Background(np.array([[4, 4, 3]], np.uint8))
    for (levels, room_is_lit), expected, is_expected_lit in [
        (ring_light(Frame(0.0, picture)), [110, 110, 0], True),
        (ring_light(Frame(0.0, picture - 80)), [57, 57, 10], False),
        (learnt.light_beyond(Frame(0.0, picture - 80)), [53, 53, 7], False),
        (learnt.light_beyond(Frame(0.5, picture - 80)), [48, 48, 2], False),  # what stays lit becomes background
    ]:
        assert (levels.tolist(), room_is_lit) == ([expected], is_expected_lit)
    outside = np.zeros((240, 240), np.uint8)
    outside[:4, :100] = outside[100:200, -4:] = 200
    assert LightMeter(make_geometry()).lit_px(outside) == 0
    assert LightMeter(make_geometry()._replace(knows_floor=False)).lit_px(outside) > 700


def test_large_pictures_are_searched_with_fewer_pixels() -> None:
    places = np.array([(12.0, 15.0), (30.0, 44.0), (50.0, 20.0)])
    camera, picture = shot(*((x, y, 0.3) for x, y in places), arena=cameras.EMPTY, width_px=1200, height_px=1000)
    counter = RingCounter(Geometry(camera, (60.0, 60.0), "somewhere", knows_floor=True))
    counter.process(Frame(0.0, np.zeros_like(picture)))
    rings = np.array(counter.process(Frame(0.1, picture)))
    at_px = camera.project(np.column_stack([places, np.full(3, epuck.RING_HEIGHT_CM)]))
    assert rings[:, :2] == pytest.approx(places, abs=0.02)
    assert rings[:, 3:5] == pytest.approx(at_px, abs=0.3)
    assert counter.counted().areas_px[1] < np.count_nonzero(picture.max(axis=2) > 12) / 3


def lamps(level: float, flicker: float, bands: float, turned: bool, spots: int) -> np.ndarray:
    """Return the light of a room in bands, and of square spots of 10 px."""
    along = np.arange(240) / 240 * bands * 2 * np.pi
    levels = np.repeat(level * (1 + flicker * np.sin(along))[:, None], 240, axis=1)
    for row, column in [(40, 60), (150, 62), (200, 180)][:spots]:
        levels[row : row + 10, column : column + 10] += 100
    return (levels.T if turned else levels).astype(np.uint8)


@pytest.mark.parametrize(("turned", "knows_floor"), [(True, False), (False, True)])
@pytest.mark.parametrize(("flicker", "bands"), [(0, 0), (0.4, 0.5), (0.8, 7)])
def test_lamps_that_flicker_change_nothing(flicker: float, bands: float, turned: bool, knows_floor: bool) -> None:
    meter = LightMeter(make_geometry()._replace(knows_floor=knows_floor))
    for spots in range(4):
        steady = meter.lit_px(lamps(0, 0, 0, turned, spots))
        assert steady == pytest.approx(spots * 11**2, rel=0.3)
        flickering = cv2.subtract(lamps(20, flicker, bands, turned, spots), lamps(20 * (1 - flicker), 0, 0, False, 0))
        assert meter.lit_px(flickering) == pytest.approx(steady, rel=0.1)


@pytest.mark.parametrize("settings", [
    {"distortion": -0.1, **SMALL}, {"tilt_deg": 15.0, "turn_deg": 30.0, "distortion": 0.05},
    {"lens": "fisheye", "height_cm": 40.0, **SMALL},
], ids=str)  # fmt: skip
def test_the_rectified_view_shows_what_the_pixels_there_show(settings):
    camera = camera_of(**settings)
    light = np.random.default_rng(0).integers(0, 256, (camera.height_px, camera.width_px)).astype(np.uint8)
    light = cv2.GaussianBlur(light, (0, 0), 1.5)
    view = RectifiedView(camera)
    sampled = view.sample(light)
    rows, columns = (cells[::17, ::17].ravel() for cells in np.indices(sampled.shape))
    points = view.origin_cm + np.column_stack([columns, rows]) / view.cells_per_cm
    pixels = camera.project(np.column_stack([points, np.full(len(rows), epuck.RING_HEIGHT_CM)]))
    is_in = ((pixels >= 0) & (pixels <= (camera.width_px - 1, camera.height_px - 1))).all(axis=1)
    assert np.count_nonzero(is_in) > 100
    slow = ndimage.map_coordinates(light.astype(float), pixels[is_in, ::-1].T, order=1)
    np.testing.assert_allclose(sampled[rows, columns][is_in], slow, atol=3)  # maps have 32 steps a pixel


def test_the_view_of_a_camera_that_sees_the_horizon_is_bounded_and_dark_beyond_the_fold_of_its_lens():
    camera = camera_of(tilt_deg=60.0, width_px=320, height_px=240, field_of_view_deg=61.0, distortion=-0.2)
    view = RectifiedView(camera)
    shown = view.sample(np.full((240, 320), 255, np.uint8))
    rows, columns = shown.shape
    assert max(rows, columns) <= (2 * ring_finding.MAX_REACH_HEIGHTS * camera.position_cm[2] + 1) * view.cells_per_cm
    assert rows * columns <= 1.1 * ring_finding.MAX_CELLS_PER_PIXEL * camera.width_px * camera.height_px
    cells = np.column_stack([np.tile(np.arange(columns), rows), np.repeat(np.arange(rows), columns)])
    points = np.column_stack([view.origin_cm + cells / view.cells_per_cm, np.full(len(cells), epuck.RING_HEIGHT_CM)])
    pixels = camera.project(points)
    is_in = ((pixels > 1) & (pixels < (318, 238))).all(axis=1)
    off_cm = np.abs(camera.back_project(pixels, epuck.RING_HEIGHT_CM) - points[:, :2]).max(axis=1)
    assert np.count_nonzero(is_in & (off_cm > 5)) > 100
    assert shown.ravel()[is_in & (off_cm > 5)].max() == 0
    assert shown.ravel()[is_in & (off_cm < 0.1)].mean() > 250


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
