"""What the camera sees in the light: floor, walls, obstacles, and upright bodies with a mark that points ahead."""

import math

import cv2
import numpy as np
import pytest

from epuck_sim import epuck
from epuck_sim.arena import make_arena
from epuck_sim.overhead.camera import WALL_HEIGHT_CM
from epuck_sim.overhead.render import (
    BODY_SIDE,
    BODY_TOP,
    FLOOR,
    HEADING_MARK,
    OBSTACLE,
    TABLE,
    WALL_FACE,
    WALL_TOP,
    ExposureSample,
)
from tests.overhead.render.cameras import CLEAN, make_set, pixel_at, standing


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


def test_robots_beyond_the_picture_are_cut_off() -> None:
    scene = make_set(**CLEAN, field_of_view_deg=15)
    for room_is_lit in (False, True):
        scene.renderer.render(standing((3.7, 3.7, 0), (30, 30, 0), (15.5, 30, 0)), room_is_lit=room_is_lit)
