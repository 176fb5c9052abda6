"""Films as imperfect as those of a laboratory: eight points, mirror images, light, a wide lens and a tilted camera."""

import math

import numpy as np
import pytest

from epuck_sim import epuck
from epuck_sim.arena import make_arena
from epuck_sim.overhead.camera import overhead_camera
from epuck_sim.overhead.render import LED_ANGLES, ExposureSample, Renderer, mirror_images
from epuck_sim.scenario.overhead import OverheadSection

CLEAN = {"width_px": 200, "height_px": 200, "noise_levels": 0.0, "blur_px": 0.0, "bloom": 0.0, "vignetting": 0.0}
ARENA = make_arena(60, 60, [], [])


def shot(*poses, room_is_lit=False, **settings):
    """Return the camera, and its picture of robots that all shine."""
    section = OverheadSection(**CLEAN | settings)
    camera = overhead_camera(section, 60, 60)
    sample = ExposureSample(np.array(poses, float).reshape(-1, 3), np.ones(len(poses), bool))
    return camera, Renderer(section, camera, ARENA, 0).render([sample], room_is_lit=room_is_lit)


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
    assert mirror_images(poses, ARENA)[:, :2].tolist() == [[-5, 20], [115, 20], [5, -20], [5, 100]]
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
