"""The arena: a walled rectangle with one corner at the origin, and the obstacles in it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Arena:
    """A rectangle from (0, 0) to (width_cm, height_cm) with walls all round."""

    width_cm: float
    height_cm: float
    circles: Points
    """(k, 3) cm: centre x, centre y, radius of round obstacles."""
    polygons: tuple[Points, ...]
    """Convex obstacles, each (v, 2) cm: corners counter-clockwise."""
    edges: Points
    """(m, 4) cm: the polygons' edges, from x, y to x, y."""


def make_arena(
    width_cm: float, height_cm: float, circles: Sequence[Sequence[float]], polygons: Sequence[Points]
) -> Arena:
    """Return the arena with round obstacles (x, y, radius) and convex polygons."""
    edges = [np.hstack([corners, np.roll(corners, -1, axis=0)]) for corners in polygons]
    return Arena(
        width_cm,
        height_cm,
        np.array(circles, float).reshape(-1, 3),
        tuple(polygons),
        np.vstack([np.empty((0, 4)), *edges]),
    )


def box_corners(x_cm: float, y_cm: float, width_cm: float, height_cm: float, heading_rad: float) -> Points:
    """Return (4, 2) the corners of a box around (x_cm, y_cm), turned by heading_rad."""
    half = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width_cm / 2, height_cm / 2)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    corners: Points = half @ np.array([(cos, sin), (-sin, cos)]) + (x_cm, y_cm)
    return corners


def is_convex(corners: Points) -> bool:
    """Whether (v, 2) corners, taken counter-clockwise, bound a convex polygon with an inside."""
    along = np.roll(corners, -1, axis=0) - corners
    after = np.roll(along, -1, axis=0)
    turns = along[:, 0] * after[:, 1] - along[:, 1] * after[:, 0]
    # a star also turns left at each corner, but more than once round
    angles = np.arctan2(turns, (along * after).sum(axis=1))
    return bool((turns > 0).all() and angles.sum() < 3 * math.pi)


def clearance_cm(arena: Arena, x_cm: float, y_cm: float) -> float:
    """Return how far (x_cm, y_cm) is from the nearest wall or obstacle; negative beyond a wall or inside one."""
    walls = min(x_cm, y_cm, arena.width_cm - x_cm, arena.height_cm - y_cm)
    circles = np.hypot(arena.circles[:, 0] - x_cm, arena.circles[:, 1] - y_cm) - arena.circles[:, 2]
    polygons = [polygon_distance_cm(corners, x_cm, y_cm) for corners in arena.polygons]
    return float(min(walls, *circles, *polygons)) if len(circles) or polygons else walls


def polygon_distance_cm(corners: Points, x_cm: float, y_cm: float) -> float:
    """Return the distance from a point to a convex polygon, (v, 2) counter-clockwise; negative inside."""
    along = np.roll(corners, -1, axis=0) - corners
    to_point = (x_cm, y_cm) - corners
    lengths = np.hypot(along[:, 0], along[:, 1])
    outward = (along[:, 1] * to_point[:, 0] - along[:, 0] * to_point[:, 1]) / lengths
    if (outward <= 0).all():
        return float(outward.max())
    share = np.clip((to_point * along).sum(axis=1) / lengths**2, 0, 1)
    nearest = to_point - share[:, None] * along
    return float(np.hypot(nearest[:, 0], nearest[:, 1]).min())
