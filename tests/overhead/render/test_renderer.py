"""Rendered pictures: rings are where the camera model projects them, and as bright as configured."""

import math

import cv2
import numpy as np
import pytest

from epuck_sim import epuck
from epuck_sim.arena import make_arena
from epuck_sim.overhead.camera import LOOKING_DOWN, CameraModel, simple_lens
from epuck_sim.overhead.render import (
    COLOUR_LEVELS,
    CORE_CM,
    DEPTH,
    FADE_CM,
    NOMINAL_EXPOSURE_MS,
    WIDTH_CM,
    Renderer,
    dimming,
    reach_cm,
)
from epuck_sim.scenario.overhead import OverheadSection
from tests.overhead.render.cameras import CLEAN, make_set, pixel_at, ring_centroid, standing

RED = max(COLOUR_LEVELS)
FAINT_MS = 4.0
"""At this exposure nothing is saturated."""

CORNERS = [(4.0, 4.0), (56.0, 4.0), (4.0, 56.0), (56.0, 56.0), (30.0, 30.0), (17.3, 41.9)]


@pytest.mark.parametrize("k1", [-0.1, 0.0, 0.1])
def test_ring_is_where_the_camera_model_projects_it(k1: float) -> None:
    scene = make_set(**CLEAN, distortion=k1)
    for x, y in CORNERS:
        picture = scene.renderer.render(standing((x, y, 0.3)), room_is_lit=False)
        assert np.hypot(*(ring_centroid(picture, scene.camera) - (x, y))) < 0.05, (x, y)


@pytest.mark.parametrize(
    ("size", "exposure_ms", "bloom"),
    [((240, 240), FAINT_MS, 0.2), ((480, 480), FAINT_MS, 0.2), ((640, 360), FAINT_MS, 0.2), ((480, 480), 1000.0, 0.0)],
)
def test_brightness_is_that_of_the_formula_at_each_pixel(
    size: tuple[int, int], exposure_ms: float, bloom: float
) -> None:
    settings = CLEAN | {"bloom": bloom, "exposure_ms": exposure_ms, "frames_per_s": 1}
    scene = make_set(**settings, width_px=size[0], height_px=size[1])
    x, y, heading = 21.0, 37.0, 0.8
    picture = scene.renderer.render(standing((x, y, heading)), room_is_lit=False)
    across = scene.camera.plane_map(epuck.RING_HEIGHT_CM).astype(float) - (x, y)
    off = np.abs(np.hypot(across[..., 0], across[..., 1]) - epuck.RING_RADIUS_CM)
    angle = np.arctan2(across[..., 1], across[..., 0]) - heading
    leds = 1 - DEPTH * (1 - np.cos(8 * angle)) / 2
    shine = leds * np.exp(-0.5 * (off / WIDTH_CM) ** 2) + bloom * np.exp(-off / FADE_CM)
    light = exposure_ms / NOMINAL_EXPOSURE_MS * shine
    for colour, levels in enumerate(COLOUR_LEVELS):
        expected = np.minimum(levels * light, 255)
        assert np.abs(picture[..., colour] - expected).max() < 1.1  # half a level is cut off, and half is rounded


def test_rings_are_overexposed_by_default() -> None:
    scene = make_set(noise_levels=0)
    picture = scene.renderer.render(standing((30, 30, 0), (5, 5, 1)), room_is_lit=False)
    angles = np.arange(0, 2 * math.pi, 0.1)
    for x, y in ((30, 30), (5, 5)):
        crest = [
            picture[pixel_at(scene.camera, x + 3.5 * math.cos(a), y + 3.5 * math.sin(a), epuck.RING_HEIGHT_CM)]
            for a in angles
        ]
        assert np.min(crest, axis=0)[0] == 255
        assert 50 < np.min(crest, axis=0)[1] < np.max(crest, axis=0)[1] < 255
        assert picture[pixel_at(scene.camera, x, y, epuck.RING_HEIGHT_CM)].max() < 30


def test_leds_turn_with_the_robot() -> None:
    scene = make_set(**CLEAN, exposure_ms=FAINT_MS)
    straight, turned, same = (
        scene.renderer.render(standing((30, 30, heading)), room_is_lit=False)
        for heading in (0, math.pi / 8, math.pi / 4)
    )
    ahead = pixel_at(scene.camera, 33.5, 30, epuck.RING_HEIGHT_CM)
    assert turned[ahead][0] == pytest.approx((1 - DEPTH) * straight[ahead][0], rel=0.15)
    assert np.array_equal(straight, same)


def test_light_grows_with_exposure_and_adds_up() -> None:
    shots = {
        ms: make_set(**CLEAN, exposure_ms=ms).renderer.render(standing((20, 20, 0)), room_is_lit=False).astype(float)
        for ms in (1.0, FAINT_MS)
    }
    assert np.abs(shots[FAINT_MS] - FAINT_MS * shots[1.0]).max() <= 0.5 * FAINT_MS + 0.5
    scene = make_set(**CLEAN, exposure_ms=FAINT_MS / 2)
    pair = [(20.0, 20.0, 0.0), (27.0, 20.0, 0.0)]
    both, *each = (scene.renderer.render(standing(*poses), room_is_lit=False) for poses in (pair, pair[:1], pair[1:]))
    assert np.abs(both.astype(float) - each[0] - each[1]).max() <= 1


def test_ring_on_for_half_of_the_exposure_is_half_as_bright() -> None:
    scene = make_set(**CLEAN, exposure_ms=FAINT_MS)
    off, on = standing((20, 20, 0), lit=False), standing((20, 20, 0))
    whole, half = (scene.renderer.render(i, room_is_lit=False).astype(float) for i in (on * 4, off * 2 + on * 2))
    assert whole.max() > 150
    assert np.abs(half - whole / 2).max() <= 1


def test_what_moves_is_blurred() -> None:
    scene = make_set(**CLEAN, exposure_ms=FAINT_MS)
    ways = [scene.renderer.render([*standing((20 + i, 20, 0))], room_is_lit=False).astype(float) for i in range(4)]
    moving = scene.renderer.render([standing((20 + i, 20, 0))[0] for i in range(4)], room_is_lit=False)
    assert np.abs(moving - np.mean(ways, axis=0)).max() <= 1


def test_bloom_raises_the_haze_and_not_what_is_far() -> None:
    shots = [
        make_set(**CLEAN | {"bloom": bloom}).renderer.render(standing((30, 30, 0)), room_is_lit=False)
        for bloom in (0, 0.1, 0.5)
    ]
    near = pixel_at(make_set(**CLEAN).camera, 30 + 5.5, 30, epuck.RING_HEIGHT_CM)
    far = pixel_at(make_set(**CLEAN).camera, 50, 30, epuck.RING_HEIGHT_CM)
    assert shots[0][near][0] == 0
    assert shots[1][near][0] == pytest.approx(0.1 * RED * math.exp(-2), abs=1.5)
    assert shots[2][near][0] == pytest.approx(0.5 * RED * math.exp(-2), abs=5)
    assert not any(shot[far].any() for shot in shots)


def test_haze_ends_where_it_rounds_to_nothing() -> None:
    assert RED * 0.1 * math.exp(-reach_cm(1.0, 0.1) / FADE_CM) == pytest.approx(0.5)
    assert reach_cm(1.0, 0.0) == reach_cm(1e-9, 1.0) == CORE_CM


def test_vignetting_darkens_the_corners() -> None:
    kept = dimming(640, 480, 0.3)
    assert kept[[0, 0, -1, -1], [0, -1, 0, -1]] == pytest.approx(0.7, abs=1e-6)
    assert kept[239:241, 319:321] == pytest.approx(1, abs=1e-5)
    assert kept[240, 0] == pytest.approx(1 - 0.3 * 640**2 / 800**2, abs=1e-5)
    assert (dimming(64, 64, 0) == 1).all()
    even, dim = (
        make_set(**CLEAN | {"vignetting": v}, exposure_ms=FAINT_MS).renderer.render(
            standing((5, 5, 0)), room_is_lit=False
        )
        for v in (0, 0.5)
    )
    assert 0.5 < dim.sum() / even.sum() < 0.75


def test_blur_spreads_a_ring_and_keeps_its_light() -> None:
    sharp, soft = (
        make_set(**CLEAN | {"blur_px": b}, exposure_ms=FAINT_MS).renderer.render(
            standing((30, 30, 0)), room_is_lit=False
        )
        for b in (0, 3)
    )
    assert soft.max() < 0.8 * sharp.max()
    assert soft[..., 0].sum(dtype=float) == pytest.approx(sharp[..., 0].sum(dtype=float), rel=0.03)


def test_dark_without_a_ring_is_noise_alone() -> None:
    scene = make_set(noise_levels=4)
    off = standing((20, 20, 0), lit=False)
    picture = scene.renderer.render(off, room_is_lit=False)
    above = picture[picture > 0]
    assert len(above) / picture.size == pytest.approx(0.5 - 0.05, abs=0.01)  # what rounds to 0 is 1 in 10
    assert math.sqrt((above.astype(float) ** 2).mean()) == pytest.approx(4.2, abs=0.1)
    assert not make_set(noise_levels=0).renderer.render(off, room_is_lit=False).any()
    assert not make_set(noise_levels=0).renderer.render(standing(), room_is_lit=False).any()


@pytest.mark.parametrize("levels", [1.0, 2.0, 10.0])
def test_noise_has_the_spread_that_is_asked_for(levels: float) -> None:
    noisy, still = make_set(noise_levels=levels, vignetting=0), make_set(noise_levels=0, vignetting=0)
    shots = [noisy.renderer.render(standing(), room_is_lit=True).astype(float) for _ in range(2)]
    rest = shots[0] - still.renderer.render(standing(), room_is_lit=True)
    floor = (slice(150, 330), slice(150, 330))
    expected = math.hypot(levels, math.sqrt(1 / 12))  # noise is in whole levels
    assert rest[floor].std() == pytest.approx(expected, rel=0.03)
    assert abs(rest[floor].mean()) < 0.05 * levels
    assert (shots[1] - shots[0])[floor].std() == pytest.approx(expected * math.sqrt(2), rel=0.03)


def test_same_seed_same_pictures() -> None:
    def render(seed: int) -> list[bytes]:
        renderer = make_set(seed=seed).renderer
        rooms = (True, False, False)
        return [renderer.render(standing((20, 20, 1)), room_is_lit=lit).tobytes() for lit in rooms]

    assert render(3) == render(3)
    assert render(3) != render(4)


def test_tilted_camera_renders_rings_where_its_model_projects_them() -> None:
    rotation, _ = cv2.Rodrigues(np.array([0.1, -0.05, 0.2]))
    camera = CameraModel(
        480, 480, simple_lens(480, 480, 700.0, -0.05), rotation @ LOOKING_DOWN, np.array([25.0, 33.0, 110.0])
    )
    renderer = Renderer(OverheadSection(**CLEAN), camera, make_arena(60, 60, [], []), 0)
    picture = renderer.render(standing((35, 28, 0)), room_is_lit=False)
    assert np.hypot(*(ring_centroid(picture, camera) - (35, 28))) < 0.06
