"""Draws the tags on top of robots in the lit room."""

from functools import cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.tags import tag_corners_cm, tag_count, tag_modules, tag_pattern

PAPER, INK = 225.0, 20.0
"""Grey levels of white and black on a tag; our estimates."""

MODULE_PX = 8
"""Pixels of a module in the pattern that is drawn; more than in pictures."""

FINER = 4
"""Pixels along the side of a pixel, over which a tag is averaged."""


def draw_tags(
    image: Float32Array, camera: CameraModel, poses: FloatArray, dictionary: str, side_cm: float, height_cm: float
) -> None:
    """Draw on each robot the tag with its number; robots with larger numbers than the dictionary has get none.

    Args:
        image: (rows, columns) levels, changed in place.
        camera: The camera that sees them.
        poses: (n, 3) cm, cm, rad: x, y, heading; NaN for robots that are not there.
        dictionary: Name of the dictionary.
        side_cm: Side of a tag with its black border.
        height_cm: Height of the robots.
    """
    paper_cm = side_cm * (1 + 1 / tag_modules(dictionary))
    for number, pose in enumerate(poses[: tag_count(dictionary)]):
        if not np.isnan(pose[0]):
            corners = camera.project(tag_corners_cm(pose, paper_cm, height_cm))
            _draw(image, _levels(dictionary, number), corners)


@cache
def _levels(dictionary: str, number: int) -> Float32Array:
    pattern: npt.NDArray[np.uint8] = tag_pattern(dictionary, number, MODULE_PX)
    return np.where(pattern > 0, PAPER, INK).astype(np.float32)


def _draw(image: Float32Array, levels: Float32Array, corners_px: FloatArray) -> None:
    """Draw a square pattern between four corners, averaged over each pixel."""
    low = np.maximum(np.floor(corners_px.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(corners_px.max(axis=0)).astype(int) + 2, image.shape[::-1])
    if (high <= low).any():
        return
    side = len(levels)
    pattern_px = np.array([(0, 0), (side, 0), (side, side), (0, side)], np.float32) - 0.5
    box_px = ((corners_px - low + 0.5) * FINER - 0.5).astype(np.float32)
    size = tuple(int(side_px) for side_px in (high - low) * FINER)
    way = cv2.getPerspectiveTransform(pattern_px, box_px)
    box = image[low[1] : high[1], low[0] : high[0]]
    ink, cover = (_shrunk(cv2.warpPerspective(each, way, size)) for each in (levels, np.ones_like(levels)))
    box[:] = (1 - cover) * box + ink


def _shrunk(fine: npt.NDArray[Any]) -> Float32Array:
    return np.asarray(cv2.resize(fine, None, fx=1 / FINER, fy=1 / FINER, interpolation=cv2.INTER_AREA), np.float32)
