"""What the overhead camera sees in the light: floor, walls, obstacles and bodies, all of them grey; our estimates."""

import math

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray, IntArray
from epuck_sim.overhead.camera_model import WALL_HEIGHT_CM
from epuck_sim.util.jit import jit

WALL_THICKNESS_CM = 1.0
"""Of the arena's walls."""

TABLE = 30.0
FLOOR = 145.0
WALL_FACE = 200.0
WALL_TOP = 240.0
OBSTACLE = 85.0
"""Levels of the arena; obstacles are drawn flat on its floor."""

BODY_SIDE = 40.0
BODY_TOP = 75.0
HEADING_MARK = 225.0
"""Levels of a robot."""

MARK_TIP_CM = 3.2
MARK_END_CM = 0.4
MARK_SLOPE = 0.45
"""The mark on a robot is a wedge: its tip and its end lie so far ahead of the centre; half its width grows so fast."""


def render_room(floor_cm: Float32Array, eye_cm: FloatArray, arena: Arena) -> Float32Array:
    """Return (rows, columns) levels of the arena without robots.

    floor_cm: (rows, columns, 2) the point of the floor that each pixel shows; eye_cm: (3,) where the lens is.
    """
    rise = WALL_HEIGHT_CM / eye_cm[2]
    at_top = (1 - rise) * floor_cm + rise * eye_cm[:2]  # where a line of sight is at the height of the walls
    room = np.full(floor_cm.shape[:2], TABLE, np.float32)
    room[_is_within(at_top, arena, WALL_THICKNESS_CM)] = WALL_TOP
    room[_is_within(at_top, arena, 0.0)] = WALL_FACE
    room[_is_within(floor_cm, arena, 0.0)] = FLOOR
    for x, y, radius in arena.circles:
        room[np.hypot(floor_cm[..., 0] - x, floor_cm[..., 1] - y) <= radius] = OBSTACLE
    for corners in arena.polygons:
        room[_is_inside(floor_cm, corners)] = OBSTACLE
    return room


def _is_within(points: npt.NDArray[np.floating], arena: Arena, margin_cm: float) -> BoolArray:
    """Whether (..., 2) points are in the arena or no farther than this beyond its walls."""
    within: BoolArray = (points >= -margin_cm) & (points <= (arena.width_cm + margin_cm, arena.height_cm + margin_cm))
    return within[..., 0] & within[..., 1]


def _is_inside(points: Float32Array, corners: FloatArray) -> BoolArray:
    """Whether (..., 2) points are in a convex polygon with (v, 2) corners counter-clockwise."""
    inside = np.ones(points.shape[:2], np.bool_)
    for (x, y), (next_x, next_y) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (next_x - x) * (points[..., 1] - y) >= (next_y - y) * (points[..., 0] - x)
    return inside


def far_first(poses: FloatArray, eye_cm: FloatArray) -> FloatArray:
    """Return (n, 3) poses, the farthest from below the lens first: the others may hide it, and are never hidden."""
    order = np.argsort(-np.hypot(poses[:, 0] - eye_cm[0], poses[:, 1] - eye_cm[1]), kind="stable")
    return poses[order]


@jit
def draw_bodies(
    image: Float32Array, floor_cm: Float32Array, eye_cm: FloatArray, poses: FloatArray, patches: IntArray
) -> None:
    """Draw robots over (rows, columns) `image`, one after the other: cylinders with a mark that points ahead.

    floor_cm, eye_cm: as `render_room` takes them; poses: (n, 3) cm, cm, rad; patches: (n, 4) px, one around each.
    """
    rise = epuck.HEIGHT_CM / eye_cm[2]
    for body in range(len(poses)):
        x, y = poses[body, 0], poses[body, 1]
        cos, sin = math.cos(poses[body, 2]), math.sin(poses[body, 2])
        for row in range(patches[body, 0], patches[body, 1]):
            for column in range(patches[body, 2], patches[body, 3]):
                foot_x, foot_y = floor_cm[row, column, 0] - x, floor_cm[row, column, 1] - y
                along_x = rise * (eye_cm[0] - floor_cm[row, column, 0])
                along_y = rise * (eye_cm[1] - floor_cm[row, column, 1])
                top_x, top_y = foot_x + along_x, foot_y + along_y
                if top_x * top_x + top_y * top_y <= epuck.RADIUS_CM**2:
                    ahead, aside = cos * top_x + sin * top_y, abs(cos * top_y - sin * top_x)
                    is_mark = ahead >= MARK_END_CM and aside <= MARK_SLOPE * (MARK_TIP_CM - ahead)
                    image[row, column] = HEADING_MARK if is_mark else BODY_TOP
                elif _comes_near(foot_x, foot_y, along_x, along_y):
                    image[row, column] = BODY_SIDE


@jit
def _comes_near(x: float, y: float, along_x: float, along_y: float) -> bool:
    """Whether the way from (x, y) along (along_x, along_y) passes within a body's radius of the origin."""
    square = along_x * along_x + along_y * along_y
    share = 0.0 if square == 0.0 else min(max(-(x * along_x + y * along_y) / square, 0.0), 1.0)
    return (x + share * along_x) ** 2 + (y + share * along_y) ** 2 <= epuck.RADIUS_CM**2
