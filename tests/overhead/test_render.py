"""Rendered pictures: rings are where the camera model projects them, and as bright as configured."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim import epuck
from epuck_sim.arena import make_arena, make_floor
from epuck_sim.errors import ScenarioError
from epuck_sim.overhead.camera import LOOKING_DOWN, WALL_HEIGHT_CM, CameraModel, overhead_camera, simple_lens
from epuck_sim.overhead.render import (
    BODY_SIDE,
    BODY_TOP,
    COLOUR_LEVELS,
    CORE_CM,
    DEPTH,
    FADE_CM,
    FLOOR,
    HEADING_MARK,
    LED_ANGLES,
    NOMINAL_EXPOSURE_MS,
    OBSTACLE,
    TABLE,
    WALL_FACE,
    WALL_TOP,
    WIDTH_CM,
    ArenaView,
    ExposureSample,
    bounding_boxes,
    dimming,
    mirror_images,
    reach_cm,
)
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.overhead import OverheadSection
from tests.overhead.cameras import CLEAN, make_set, pixel_at, ring_centroid, standing

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


# --- the lit room ---


def test_lit_room_shows_each_thing_in_its_grey() -> None:
    scene = make_set(**CLEAN)
    picture = scene.renderer.render(standing((10, 20, 0), lit=False), room_is_lit=True)
    for (x, y, z), grey in {
        (30, 30, 0): FLOOR,
        (0.5, 0.5, 0): FLOOR,
        (45, 45, 0): OBSTACLE,
        (48, 45, 0): OBSTACLE,
        (15, 45, 0): OBSTACLE,
        (0, 30, 3): WALL_FACE,
        (60, 30, 3): WALL_FACE,
        (30, 0, 3): WALL_FACE,
        (30, 60, 3): WALL_FACE,
        (-0.5, 30, WALL_HEIGHT_CM): WALL_TOP,
        (30, 60.5, WALL_HEIGHT_CM): WALL_TOP,
    }.items():
        assert (picture[pixel_at(scene.camera, x, y, z)] == grey).all(), (x, y, z)
    assert (picture[0, 0] == TABLE).all()
    assert (picture[pixel_at(scene.camera, 10, 20 + 3, epuck.HEIGHT_CM)] == BODY_TOP).all()


@pytest.mark.parametrize("heading", [0.0, 1.0, 2.5, -1.5, -3.0, 7.0])
def test_mark_points_ahead(heading: float) -> None:
    scene = make_set(**CLEAN)
    x, y = 50.0, 10.0
    picture = scene.renderer.render(standing((x, y, heading), lit=False), room_is_lit=True)
    for ahead, grey in ((2.0, HEADING_MARK), (-2.0, BODY_TOP)):
        spot = (x + ahead * math.cos(heading), y + ahead * math.sin(heading), epuck.HEIGHT_CM)
        assert (picture[pixel_at(scene.camera, *spot)] == grey).all()


def test_bodies_stand_upright() -> None:
    scene = make_set(**CLEAN, distortion=0)
    picture = scene.renderer.render(standing((50, 30, 0), lit=False), room_is_lit=True)
    assert (
        picture[pixel_at(scene.camera, 50 - 3.65, 30, 1.0)] == BODY_SIDE
    ).all()  # the side towards the picture's middle
    outline = cv2.inRange(picture[..., 0], BODY_SIDE, BODY_TOP) | cv2.inRange(
        picture[..., 0], HEADING_MARK, HEADING_MARK
    )
    columns = np.flatnonzero(outline[pixel_at(scene.camera, 50, 30)[0]])
    ends = scene.camera.project(np.array([(50 - 3.7, 30, 0.0), (50 + 3.7, 30, epuck.HEIGHT_CM)]))[:, 0]
    assert abs(columns[0] - ends[0]) <= 1
    assert abs(columns[-1] - ends[1]) <= 1


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_inner_body_hides_the_outer_one(order: tuple[int, int]) -> None:
    scene = make_set(**CLEAN)
    poses = np.array([(40.0, 30.0, math.pi), (47.4, 30.0, math.pi)])[list(order)]
    picture = scene.renderer.render([ExposureSample(poses, np.zeros(2, bool))], room_is_lit=True)
    assert (picture[pixel_at(scene.camera, 40 + 3.6, 30, epuck.HEIGHT_CM)] == BODY_TOP).all()


def test_rings_shine_red_in_a_lit_room() -> None:
    scene = make_set(noise_levels=0)
    picture = scene.renderer.render(standing((20, 20, 0)), room_is_lit=True)
    red, green, blue = picture[pixel_at(scene.camera, 20, 23.5, epuck.RING_HEIGHT_CM)].astype(int)
    assert red == 255
    assert red - max(green, blue) > 20


def test_lit_room_is_as_bright_in_a_long_exposure() -> None:
    short, long = (
        make_set(**CLEAN, exposure_ms=ms).renderer.render(standing((20, 20, 0), lit=False), room_is_lit=True)
        for ms in (5, 60)
    )
    assert np.array_equal(short, long)


def test_wide_arena() -> None:
    arena = make_arena(120, 40, [], [])
    scene = make_set(arena, **CLEAN, width_px=640, height_px=240)
    picture = scene.renderer.render(standing((110, 8, 0), lit=False), room_is_lit=True)
    assert (picture[pixel_at(scene.camera, 119, 39)] == FLOOR).all()
    assert (picture[pixel_at(scene.camera, 60, 40, 3)] == WALL_FACE).all()
    assert (picture[pixel_at(scene.camera, 110, 5, epuck.HEIGHT_CM)] == BODY_TOP).all()


def test_a_floor_is_as_grey_as_it_is_bright() -> None:
    picture = np.array([[0, 255]], np.uint8)
    arena = make_arena(60, 60, [], [], floor=make_floor(1, [(0.2, (50, 50, 5)), (0.6, (59, 30, 4))], picture))
    seen = make_set(arena, **CLEAN)
    grey = seen.renderer.render(standing(lit=False), room_is_lit=True)
    for place, level in {(10, 30): 0, (40, 30): FLOOR, (50, 52): 0.2 * FLOOR, (58, 30): 0.6 * FLOOR}.items():
        assert (grey[pixel_at(seen.camera, *place)] == round(level)).all(), place
    assert (grey[pixel_at(seen.camera, 60, 30, 3)] == WALL_FACE).all()


def test_lamps_are_bright_dots_where_the_camera_sees_them_in_the_light() -> None:
    """The camera hangs 110 cm above (30, 30), so that a lamp at half of that seems twice as far from there."""
    arena = make_arena(60, 60, [], [], lamps=[(40, 30, 55, 1), (30, 35, 0.1, 2), (20, 20, 110, 1)])
    seen = make_set(arena, **CLEAN)
    grey = seen.renderer.render(standing((30, 35, 0), lit=False), room_is_lit=True)
    shown = np.zeros(grey.shape[:2], bool)
    for x, y, radius in ((50, 30, 1.5), (30, 35, 0.75)):
        floor_cm = seen.camera.plane_map(0.0)
        shown |= np.hypot(floor_cm[..., 0] - x, floor_cm[..., 1] - y) <= radius
    assert (grey.min(axis=-1) == 255).sum() == pytest.approx(shown.sum(), rel=0.1)
    assert (grey[pixel_at(seen.camera, 50, 30)] == 255).all()
    assert (grey[pixel_at(seen.camera, 30, 35)] == 255).all()
    assert (grey[pixel_at(seen.camera, 20, 20)] < 255).all()
    assert not seen.renderer.render(standing(lit=False), room_is_lit=False).any()


def test_robots_beyond_the_picture_are_cut_off() -> None:
    scene = make_set(**CLEAN, field_of_view_deg=15)
    for room_is_lit in (False, True):
        scene.renderer.render(standing((3.7, 3.7, 0), (30, 30, 0), (15.5, 30, 0)), room_is_lit=room_is_lit)


# --- films as imperfect as those of a laboratory ---------------------------------------------------


def shot(*poses, room_is_lit=False, **settings):
    """Return a camera without faults but those given, and its picture of robots that all shine."""
    scene = make_set(make_arena(60, 60, [], []), **CLEAN | {"width_px": 200, "height_px": 200} | settings)
    return scene.camera, scene.renderer.render(standing(*poses), room_is_lit=room_is_lit)


def level_at(camera, picture, x_cm, y_cm):
    """Return the levels around a point at the height of rings."""
    ((column, row),) = np.round(camera.project(np.array([(x_cm, y_cm, epuck.RING_HEIGHT_CM)]))).astype(int)
    return picture[row - 1 : row + 2, column - 1 : column + 2].max(axis=(0, 1)).astype(int)


def test_points_shine_at_the_leds_and_not_between() -> None:
    camera, picture = shot((30, 30, 0.2), led_points=True)
    angles = 0.2 + LED_ANGLES
    ring = epuck.RING_RADIUS_CM
    at, between = (
        [level_at(camera, picture, 30 + ring * math.cos(a), 30 + ring * math.sin(a))[0] for a in angles + shift]
        for shift in (0.0, math.tau / 16)
    )
    assert min(at) > 200
    assert max(between) < 40


def test_mirror_images_are_as_far_behind_the_wall_and_dimmer() -> None:
    poses = np.array([(5.0, 20.0, 0.3)])
    assert mirror_images(poses, make_arena(60, 60, [], []))[:, :2].tolist() == [[-5, 20], [115, 20], [5, -20], [5, 100]]
    settings = {"field_of_view_deg": 45.0, "gain": 0.2}
    camera, plain = shot((5, 20, 0.3), **settings)
    _, mirrored = shot((5, 20, 0.3), gloss=0.5, **settings)
    behind, own = (-5 - epuck.RING_RADIUS_CM, 20), (5 + epuck.RING_RADIUS_CM, 20)
    assert level_at(camera, plain, *behind)[0] == 0
    assert level_at(camera, mirrored, *own).tolist() == level_at(camera, plain, *own).tolist()
    assert level_at(camera, mirrored, *behind)[0] == pytest.approx(level_at(camera, plain, *own)[0] / 2, rel=0.4)


def test_gain_burns_rings_out_to_white() -> None:
    for gain, white in ((1.0, False), (6.0, True)):
        camera, picture = shot((30, 30, 0.0), gain=gain)
        assert (level_at(camera, picture, 30 + epuck.RING_RADIUS_CM, 30).min() == 255) == white


def test_ambient_light_shows_the_room_as_in_the_light_but_darker() -> None:
    _, dim = shot(ambient=0.25)
    _, lit = shot(room_is_lit=True)
    assert dim.astype(int) == pytest.approx(lit * 0.25, abs=1)
    assert shot()[1].max() == 0


@pytest.mark.parametrize("settings", [{"lens": "fisheye", "height_cm": 40.0}, {"tilt_deg": 20.0, "turn_deg": 30.0}])
def test_rings_are_where_the_camera_shows_them(settings) -> None:
    places = [(12, 12), (30, 30), (48, 40)]
    camera, picture = shot(*((x, y, 0.0) for x, y in places), **settings)
    for x, y in places:
        assert level_at(camera, picture, x + epuck.RING_RADIUS_CM, y)[0] > 200
        assert level_at(camera, picture, x, y)[0] < 20


def test_a_tilted_camera_is_aimed_at_the_middle_from_the_same_height() -> None:
    camera = overhead_camera(OverheadSection(tilt_deg=25.0, turn_deg=-40.0), 60, 60)
    assert camera.position_cm[2] == pytest.approx(110)
    assert camera.project(np.array([(30.0, 30.0, 0.0)])) == pytest.approx(np.array([(239.5, 239.5)]))
    assert math.degrees(math.acos(-camera.rotation[2, 2])) == pytest.approx(25)


# --- pictures of the arena for people ---

SCENARIO = load_scenario("obstacles", ["overhead.noise_levels=20", "overhead.blur_px=5"])
POSES = np.array([[15.0, 45.0, 0.0], [45.0, 15.0, 1.0]])


def test_bodies_are_dark_and_lit_rings_red_where_robots_are():
    scenario = load_scenario("thesis")
    view = ArenaView(scenario, 200, 200)
    empty = view.draw(np.empty((0, 3)), np.empty(0, bool)).astype(int)
    picture = view.draw(POSES, np.array([False, True])).astype(int)
    rows, columns = np.nonzero(np.abs(picture - empty).max(axis=-1) > 20)
    assert {(row < 100, column < 100) for row, column in zip(rows, columns, strict=True)} == {
        (True, True),
        (False, False),
    }
    redness = picture[..., 0] - picture[..., 1]
    assert redness[:100, :100].max() == 0
    assert redness[100:, 100:].max() > 100


def test_the_same_robots_make_the_same_picture_without_the_cameras_faults():
    view = ArenaView(SCENARIO, width_px=120, height_px=80)
    lit = np.array([True, False])
    first = view.draw(POSES, lit)
    assert first.shape == (80, 120, 3)
    np.testing.assert_array_equal(view.draw(POSES, lit), first)
    np.testing.assert_array_equal(ArenaView(load_scenario("obstacles"), 120, 80).draw(POSES, lit), first)


def test_sizes_that_no_film_could_have_are_refused():
    with pytest.raises(ScenarioError, match="width_px"):
        ArenaView(SCENARIO, width_px=101)


def test_a_kilobot_is_drawn_as_wide_as_it_is_and_its_led_where_it_is():
    def drawn(robot) -> tuple[int, int]:
        """Return the number of pixels that show a robot, and of those that are red if it is lit."""
        scenario = load_scenario({"robot": robot, "robots": [{"signal": {"kind": "radio"}}]})
        view = ArenaView(scenario, 400, 400)
        pose = np.array([[30.0, 30.0, 0.3]])  # below the camera, which sees no side
        empty = view.draw(pose[:0], np.zeros(0, bool)).astype(int)
        dark, lit = (view.draw(pose, np.array([on])).astype(int) for on in (False, True))
        red = lit[..., 0] - lit[..., 1] > 100
        return int((np.abs(dark - empty).max(axis=-1) > 20).sum()), int(red.sum())

    (epuck, ring), (kilobot, led) = drawn("epuck"), drawn("kilobot")
    assert kilobot / epuck == pytest.approx((1.65 / 3.7) ** 2, rel=0.1)
    assert 0 < led < 0.3 * ring


# --- bounding boxes ---


@given(st.floats(4, 56), st.floats(4, 56), st.sampled_from([-0.1, 0.0, 0.1]), st.floats(0, 0.1))
def test_bounding_boxes_contain_every_pixel_of_a_body(x: float, y: float, k1: float, tilt: float) -> None:
    rotation, _ = cv2.Rodrigues(np.array([tilt, 0.5 * tilt, 0]))
    camera = CameraModel(
        160, 160, simple_lens(160, 160, 180.0, k1), rotation @ LOOKING_DOWN, np.array([30.0, 30.0, 110.0])
    )
    inside = np.zeros((160, 160), bool)
    for height in (0.0, epuck.HEIGHT_CM):
        shown = camera.plane_map(height)
        inside |= np.hypot(shown[..., 0] - x, shown[..., 1] - y) <= epuck.RADIUS_CM
    first, after, left, right = bounding_boxes(
        camera, np.array([[x, y]]), np.array([epuck.RADIUS_CM]), np.array([[0.0, epuck.HEIGHT_CM]])
    )[0]
    assert inside[first:after, left:right].sum() == inside.sum()
    assert (after - first) * (right - left) <= 2.5 * inside.sum()
