"""A plain way to find rings, as a yardstick: OpenCV's HoughCircles on the bright pixels."""

import cv2
import numpy as np

BRIGHT = 60
"""Level of a pixel's brightest colour from which it is bright."""

EDGE, VOTES = 100, 20
"""Upper threshold of Canny's edges, and number of votes of a circle: with fewer, good films show false ones."""


def hough_rings(picture: np.ndarray, radius_px: float) -> np.ndarray:
    """Return (n, 2) px: columns and rows of the middles of circles of about this radius in a picture."""
    bright = np.where(picture.max(axis=2) >= BRIGHT, 255, 0).astype(np.uint8)
    if not bright.any():
        return np.empty((0, 2))
    found = cv2.HoughCircles(
        cv2.GaussianBlur(bright, (5, 5), 1.0),
        cv2.HOUGH_GRADIENT,
        dp=1.5,
        minDist=1.8 * radius_px,
        param1=EDGE,
        param2=VOTES,
        minRadius=round(0.8 * radius_px),
        maxRadius=round(1.35 * radius_px),
    )
    return np.empty((0, 2)) if found is None else found.reshape(-1, 3)[:, :2].astype(float)
