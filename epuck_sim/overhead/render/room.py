"""The lit room in the overhead camera's picture: floor, walls, obstacles, bodies; grey levels are our estimates."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arena import Arena, brightness_at
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray, IntArray
from epuck_sim.geometry import contains
from epuck_sim.overhead.camera_model import WALL_HEIGHT_CM
from epuck_sim.util.jit import jit

WALL_THICKNESS_CM = 1.0
"""Thickness of the arena's walls."""

TABLE = 30.0
"""Grey level of the table around the arena."""

FLOOR = 145.0
"""Grey level of the arena's floor where it is white."""

WALL_FACE = 200.0
"""Grey level of the inner side of the walls."""

WALL_TOP = 240.0
"""Grey level of the top of the walls."""

OBSTACLE = 85.0
"""Grey level of obstacles and movables, which are drawn flat on the floor."""

BODY_SIDE = 40.0
"""Grey level of a robot's side."""

BODY_TOP = 75.0
"""Grey level of a robot's top."""

HEADING_MARK = 225.0
"""Grey level of the wedge on a robot's top that points ahead."""

MARK_TIP_CM = 3.2
"""Distance of the heading mark's tip ahead of an e-puck's centre; other robots' marks are in proportion."""

MARK_END_CM = 0.4
"""Distance of the heading mark's broad end ahead of an e-puck's centre."""

MARK_SLOPE = 0.45
"""Half the heading mark's width per cm of distance from its tip."""


def render_room(floor_cm: Float32Array, eye_cm: FloatArray, arena: Arena) -> Float32Array:
    """Return the grey levels of the arena without robots and movables.

    Args:
        floor_cm: (rows, columns, 2) cm: the point of the floor that each pixel shows.
        eye_cm: (3,) cm: position of the camera.
        arena: The arena below it.

    Returns:
        (rows, columns) levels.
    """
    rise = WALL_HEIGHT_CM / eye_cm[2]
    at_top = (1 - rise) * floor_cm + rise * eye_cm[:2]  # where a line of sight is at the height of the walls
    room = np.full(floor_cm.shape[:2], TABLE, np.float32)
    room[_is_within(at_top, arena, WALL_THICKNESS_CM)] = WALL_TOP
    room[_is_within(at_top, arena, 0.0)] = WALL_FACE
    on_floor = _is_within(floor_cm, arena, 0.0)
    room[on_floor] = FLOOR * brightness_at(arena, *floor_cm[on_floor].T)
    for x, y, radius in arena.circles[: arena.first_movable]:
        draw_circle(room, floor_cm, (x, y), radius)
    for corners in arena.polygons:
        room[contains(corners, floor_cm)] = OBSTACLE
    return room


def draw_circle(
    image: Float32Array, floor_cm: Float32Array, place: Sequence[float] | FloatArray, radius: float
) -> None:
    """Draw a round obstacle or a movable at a place, cm, with a radius in cm; see `draw_bodies`."""
    image[np.hypot(floor_cm[..., 0] - place[0], floor_cm[..., 1] - place[1]) <= radius] = OBSTACLE


def _is_within(points: npt.NDArray[np.floating], arena: Arena, margin_cm: float) -> BoolArray:
    """Return whether each of (..., 2) points is in the arena or at most `margin_cm` beyond its walls."""
    within: BoolArray = (points >= -margin_cm) & (points <= (arena.width_cm + margin_cm, arena.height_cm + margin_cm))
    return within[..., 0] & within[..., 1]


def farthest_first(poses: FloatArray, eye_cm: FloatArray) -> FloatArray:
    """Return (n, 3) poses, farthest from the camera's axis first: no robot is hidden by one farther out."""
    order = np.argsort(-np.hypot(poses[:, 0] - eye_cm[0], poses[:, 1] - eye_cm[1]), kind="stable")
    return poses[order]


@jit
def draw_bodies(
    image: Float32Array,
    floor_cm: Float32Array,
    eye_cm: FloatArray,
    poses: FloatArray,
    boxes: IntArray,
    body_cm: tuple[float, float],
) -> None:
    """Draw robots one after the other: cylinders with a mark that points ahead.

    Args:
        image: (rows, columns) levels, changed in place.
        floor_cm: (rows, columns, 2) cm: the point of the floor that each pixel shows.
        eye_cm: (3,) cm: position of the camera.
        poses: (n, 3) cm, cm, rad: x, y, heading; those drawn later hide those drawn earlier.
        boxes: (n, 4) px, as `bounding_boxes` returns them.
        body_cm: Radius and height of each robot.
    """
    radius, height = body_cm
    scale = radius / epuck.RADIUS_CM
    rise = height / eye_cm[2]
    for body in range(len(poses)):
        x, y = poses[body, 0], poses[body, 1]
        cos, sin = math.cos(poses[body, 2]), math.sin(poses[body, 2])
        for row in range(boxes[body, 0], boxes[body, 1]):
            for column in range(boxes[body, 2], boxes[body, 3]):
                foot_x, foot_y = floor_cm[row, column, 0] - x, floor_cm[row, column, 1] - y
                along_x = rise * (eye_cm[0] - floor_cm[row, column, 0])
                along_y = rise * (eye_cm[1] - floor_cm[row, column, 1])
                top_x, top_y = foot_x + along_x, foot_y + along_y
                if top_x * top_x + top_y * top_y <= radius**2:
                    ahead, aside = cos * top_x + sin * top_y, abs(cos * top_y - sin * top_x)
                    is_mark = ahead >= scale * MARK_END_CM and aside <= MARK_SLOPE * (scale * MARK_TIP_CM - ahead)
                    image[row, column] = HEADING_MARK if is_mark else BODY_TOP
                elif _segment_meets_body(foot_x, foot_y, along_x, along_y, radius):
                    image[row, column] = BODY_SIDE


@jit
def _segment_meets_body(x: float, y: float, along_x: float, along_y: float, radius: float) -> bool:
    """Return whether the segment from (x, y) along (along_x, along_y) comes within a body's radius of the origin."""
    square = along_x * along_x + along_y * along_y
    share = 0.0 if square == 0.0 else min(max(-(x * along_x + y * along_y) / square, 0.0), 1.0)
    return (x + share * along_x) ** 2 + (y + share * along_y) ** 2 <= radius**2
