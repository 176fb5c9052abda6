"""Polygons: corners of boxes, convexity, and distances to points."""

import math

import numpy as np

from epuck_sim.arrays import FloatArray


def box_corners(x_cm: float, y_cm: float, width_cm: float, height_cm: float, heading_rad: float) -> FloatArray:
    """Return (4, 2) the corners of a box around (x_cm, y_cm), turned by heading_rad."""
    half = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width_cm / 2, height_cm / 2)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    corners: FloatArray = half @ np.array([(cos, sin), (-sin, cos)]) + (x_cm, y_cm)
    return corners


def is_convex(corners: FloatArray) -> bool:
    """Whether (v, 2) corners, taken counter-clockwise, bound a convex polygon with an inside."""
    along = np.roll(corners, -1, axis=0) - corners
    after = np.roll(along, -1, axis=0)
    turns = along[:, 0] * after[:, 1] - along[:, 1] * after[:, 0]
    # a star also turns left at each corner, but more than once round
    angles = np.arctan2(turns, (along * after).sum(axis=1))
    return bool((turns > 0).all() and angles.sum() < 3 * math.pi)


def polygon_distance_cm(corners: FloatArray, x_cm: float, y_cm: float) -> float:
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
