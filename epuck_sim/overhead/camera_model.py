"""Where the overhead camera sees a point of the arena, and what point a pixel shows: OpenCV's camera model.

The arena's frame: x to the right, y up in the picture, z above the floor, origin in the lower left corner of the floor.
Pixels: (column, row) from the middle of the upper left one, as in OpenCV.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.scenario.overhead import OverheadSection

HEIGHT_CM = 110.0
SIDE_CM = 60.0
"""The lens hung so high above an arena of such a side (thesis 4.3.1)."""

WALL_HEIGHT_CM = 6.0
"""Of the arena's walls; our estimate: they hide a robot of 4.7 cm from its surroundings."""

MARGIN = 1.04
"""By default the picture is larger than what it must show by this factor."""

STEPS = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
"""At most and how small, to undo the distortion: OpenCV's five steps are whole pixels short in the corners of a picture
that is wide and strongly distorted."""

LOOKING_DOWN = np.diag([1.0, -1.0, -1.0])
"""Rotation into the camera's frame (x right, y down, z away from the lens) of one that looks straight down."""


class Lens(NamedTuple):
    """A pinhole with radial distortion, somewhere above the arena."""

    width_px: int
    height_px: int
    focal_px: float
    k1: float
    """Of the distortion, 0 for none."""
    rotation: FloatArray
    """(3, 3) from the arena's frame into the camera's."""
    position_cm: FloatArray
    """(3,) of the pinhole in the arena's frame."""

    @property
    def _matrix(self) -> FloatArray:
        """(3, 3) of OpenCV: pixels are square, and the optical axis meets the middle of the picture."""
        middle_column, middle_row = (self.width_px - 1) / 2, (self.height_px - 1) / 2
        return np.array([[self.focal_px, 0, middle_column], [0, self.focal_px, middle_row], [0, 0, 1]])

    @property
    def _coefficients(self) -> FloatArray:
        """(4,) of OpenCV: k1, and none of k2, p1, p2."""
        return np.array([self.k1, 0.0, 0.0, 0.0])

    def pixels(self, points_cm: FloatArray) -> FloatArray:
        """Return (n, 2) px: where (n, 3) cm points of the arena are seen, if they are in front of the camera; n > 0."""
        rotation, _ = cv2.Rodrigues(self.rotation)
        shift = -self.rotation @ self.position_cm
        seen, _ = cv2.projectPoints(
            np.ascontiguousarray(points_cm, float).reshape(-1, 1, 3), rotation, shift, self._matrix, self._coefficients
        )
        return np.asarray(seen, float).reshape(-1, 2)

    def on_plane(self, pixels: FloatArray, z_cm: float) -> FloatArray:
        """Return (n, 2) cm: the points `z_cm` above the floor that (n, 2) px show; n > 0.

        A pixel above the horizon shows none: it gets the point behind the camera on the same line.
        """
        straight = cv2.undistortPoints(
            np.ascontiguousarray(pixels, float).reshape(-1, 1, 2), self._matrix, self._coefficients, criteria=STEPS
        ).reshape(-1, 2)
        rays = np.column_stack([straight, np.ones(len(straight))]) @ self.rotation
        far = (z_cm - self.position_cm[2]) / rays[:, 2]
        shown: FloatArray = self.position_cm[:2] + far[:, None] * rays[:, :2]
        return shown

    def plane_map(self, z_cm: float) -> Float32Array:
        """Return (height_px, width_px, 2) cm: the point `z_cm` above the floor that each pixel shows."""
        columns, rows = np.meshgrid(np.arange(self.width_px, dtype=float), np.arange(self.height_px, dtype=float))
        pixels = np.column_stack([columns.ravel(), rows.ravel()])
        return self.on_plane(pixels, z_cm).reshape(self.height_px, self.width_px, 2).astype(np.float32)


def overhead_lens(section: OverheadSection, width_cm: float, height_cm: float) -> Lens:
    """Return the camera of a scenario, which looks straight down at the middle of an arena of this size.

    Raises EpuckSimError where it would hang between the walls, or its distortion would fold the picture.
    """
    above_cm = section.height_cm or HEIGHT_CM / SIDE_CM * max(width_cm, height_cm)
    if above_cm <= 2 * WALL_HEIGHT_CM:
        raise EpuckSimError(
            f"overhead.height_cm is {above_cm:g}; allowed: more than {2 * WALL_HEIGHT_CM:g}, twice the walls' height"
        )
    position = np.array([width_cm / 2, height_cm / 2, above_cm])
    focal_px = _focal_px(section, width_cm, height_cm, above_cm)
    k1 = section.distortion
    corner = math.hypot(section.width_px, section.height_px) / 2 / focal_px
    lowest = -1 / (3 * (1.5 * corner) ** 2)  # r + k1 r^3 turns back where it is 2/3 of r
    if k1 <= lowest:
        raise EpuckSimError(
            f"overhead.distortion is {k1:g}, which would fold the corners of a picture of such a field of view; "
            f"allowed: above {lowest:.3g}"
        )
    return Lens(section.width_px, section.height_px, focal_px, k1, LOOKING_DOWN, position)


def _focal_px(section: OverheadSection, width_cm: float, height_cm: float, above_cm: float) -> float:
    """Return the focal length in pixels: of the field of view, or such that floor and walls are in the picture."""
    if section.field_of_view_deg is not None:
        return section.width_px / 2 / math.tan(math.radians(section.field_of_view_deg) / 2)
    sides = ((section.width_px, width_cm), (section.height_px, height_cm))
    return min(pixels * (above_cm - WALL_HEIGHT_CM) / (side_cm * MARGIN) for pixels, side_cm in sides)
