"""Which pixels show a robot: the overhead camera draws robots into small patches of its picture, not all over it."""

import math

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.camera_model import Lens

_AROUND = np.array([(math.cos(angle), math.sin(angle)) for angle in np.arange(8) * math.pi / 4])
"""Corners of an octagon around the origin; the circle inside of it is smaller by cos(pi / 8)."""


def find_patches(lens: Lens, centres_cm: FloatArray, radius_cm: float, heights_cm: tuple[float, ...]) -> IntArray:
    """Return (n, 4) px: first row, row after the last, first column, column after the last of what shows each circle.

    centres_cm: (n, 2) of circles that lie at all of the heights. What is out of the picture has an empty patch.
    """
    if not len(centres_cm):  # OpenCV would refuse it
        return np.empty((0, 4), np.int64)
    octagons = (centres_cm[:, None] + radius_cm / math.cos(math.pi / 8) * _AROUND).reshape(-1, 2)
    points = np.vstack([np.column_stack([octagons, np.full(len(octagons), height)]) for height in heights_cm])
    seen = lens.pixels(points).reshape(len(heights_cm), len(centres_cm), len(_AROUND), 2)
    low = np.floor(seen.min(axis=(0, 2)))
    high = np.ceil(seen.max(axis=(0, 2))) + 1
    bounds = np.clip(np.stack([low, high], axis=-1), 0, [[lens.width_px], [lens.height_px]])
    patches: IntArray = bounds[:, ::-1].reshape(-1, 4).astype(np.int64)
    return patches
