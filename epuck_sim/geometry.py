"""Polygons: the corners of a box, area, convexity, which points are inside, and the distance to a point.

Corners are counter-clockwise, where x points right and y points up. In a picture, where rows count downwards, flip the
rows first: `corners * (1, -1)`.
"""

import math

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.elementary import sin_cos


def box_corners(x_cm: float, y_cm: float, width_cm: float, height_cm: float, heading_rad: float) -> FloatArray:
    """Return (4, 2) cm: the corners of a box around (x_cm, y_cm) turned by heading_rad, counter-clockwise."""
    ahead, aside = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]).T * [[width_cm / 2], [height_cm / 2]]
    sin, cos = sin_cos(heading_rad)
    return np.column_stack([ahead * cos - aside * sin + x_cm, ahead * sin + aside * cos + y_cm])


def polygon_area(corners: FloatArray) -> float:
    """Return the area of a polygon with (v, 2) corners by the shoelace formula: negative if they run clockwise.

    >>> polygon_area(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)]))
    8.0
    """
    x, y = corners.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2


def is_convex(corners: FloatArray) -> bool:
    """Return whether (v, 2) corners, taken counter-clockwise, bound a convex polygon with an inside."""
    sides = _sides(corners)
    next_sides = np.roll(sides, -1, axis=0)
    turns = sides[:, 0] * next_sides[:, 1] - sides[:, 1] * next_sides[:, 0]
    # a star also turns left at each corner, but its turns sum to more than one full circle
    angles = np.arctan2(turns, (sides * next_sides).sum(axis=1))
    return bool((turns > 0).all() and angles.sum() < 3 * math.pi)


def contains(corners: FloatArray, points: npt.NDArray[np.floating]) -> BoolArray:
    """Return (...) whether each of (..., 2) points is in a convex polygon of (v, 2) corners, or on its edge."""
    inside = np.ones(points.shape[:-1], np.bool_)
    for (x, y), (side_x, side_y) in zip(corners, _sides(corners), strict=True):
        inside &= side_x * (points[..., 1] - y) >= side_y * (points[..., 0] - x)
    return inside


def polygon_distance_cm(corners: FloatArray, x_cm: float, y_cm: float) -> float:
    """Return the distance from a point to the edge of a convex polygon with (v, 2) cm corners; negative inside."""
    sides = _sides(corners)
    to_point = (x_cm, y_cm) - corners
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    outward = (sides[:, 1] * to_point[:, 0] - sides[:, 0] * to_point[:, 1]) / lengths
    if (outward <= 0).all():
        return float(outward.max())
    share = np.clip((to_point * sides).sum(axis=1) / lengths**2, 0, 1)
    to_nearest = to_point - share[:, None] * sides
    return float(np.hypot(to_nearest[:, 0], to_nearest[:, 1]).min())


def _sides(corners: FloatArray) -> FloatArray:
    """Return (v, 2): the vectors from each corner to the next one."""
    return np.roll(corners, -1, axis=0) - corners
