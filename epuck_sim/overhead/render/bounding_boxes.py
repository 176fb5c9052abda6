"""Bounding boxes of robots in the picture: each robot is drawn within its box instead of over the whole picture."""

import math

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.camera_model import CameraModel

_OCTAGON = np.array([(math.cos(angle), math.sin(angle)) for angle in np.arange(8) * math.pi / 4])
"""(8, 2) corners of an octagon around the origin; its inscribed circle has radius cos(pi / 8)."""


def bounding_boxes(
    camera: CameraModel, centres_cm: FloatArray, radius_cm: float, heights_cm: tuple[float, ...]
) -> IntArray:
    """Return the pixels within which each of some upright cylinders is seen.

    Args:
        camera: The camera that sees them.
        centres_cm: (n, 2) cm: x and y of their axes.
        radius_cm: Radius of all of them.
        heights_cm: Heights above the floor that they cover; the lowest and the highest are enough.

    Returns:
        (n, 4) px: first row, row after the last, first column, column after the last; an empty box for what is outside
        of the picture.
    """
    if not len(centres_cm):  # OpenCV refuses empty arrays
        return np.empty((0, 4), np.int64)
    octagons = (centres_cm[:, None] + radius_cm / math.cos(math.pi / 8) * _OCTAGON).reshape(-1, 2)
    points = np.vstack([np.column_stack([octagons, np.full(len(octagons), height)]) for height in heights_cm])
    pixels = camera.project(points).reshape(len(heights_cm), len(centres_cm), len(_OCTAGON), 2)
    low = np.floor(pixels.min(axis=(0, 2)))
    high = np.ceil(pixels.max(axis=(0, 2))) + 1
    bounds = np.clip(np.stack([low, high], axis=-1), 0, [[camera.width_px], [camera.height_px]])
    boxes: IntArray = bounds[:, ::-1].reshape(-1, 4).astype(np.int64)
    return boxes
