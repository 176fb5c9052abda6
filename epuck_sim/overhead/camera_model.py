"""The overhead camera's geometry: which pixel shows a point of the arena, and the reverse, by OpenCV's camera model.

The arena's frame: x to the right, y up in the picture, z above the floor, origin in the lower left corner of the floor.
Pixels: (column, row), measured from the middle of the upper left pixel, as in OpenCV.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.scenario.overhead import OverheadSection

REFERENCE_HEIGHT_CM = 110.0
"""Height of the camera above the floor in the thesis's experiments (4.3.1)."""

REFERENCE_SIDE_CM = 60.0
"""Side of the arena in the thesis's experiments (4.3.1)."""

WALL_HEIGHT_CM = 6.0
"""Height of the arena's walls; our estimate: they hide a robot of 4.7 cm from its surroundings."""

MARGIN = 1.04
"""Factor by which the default field of view is larger than the floor with its walls."""

UNDISTORT_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
"""Termination criterion (iterations, tolerance) for undistortPoints; OpenCV's default of five iterations is off by
whole pixels in the corners of a wide, strongly distorted picture."""

LOOKING_DOWN = np.diag([1.0, -1.0, -1.0])
"""Rotation from the arena's frame into that of a camera looking straight down (x right, y down, z ahead)."""


class CameraModel(NamedTuple):
    """A pinhole camera with radial distortion, somewhere above the arena."""

    width_px: int
    height_px: int
    focal_px: float
    k1: float
    """Coefficient of the radial distortion; 0 for none."""
    rotation: FloatArray
    """(3, 3) rotation from the arena's frame into the camera's."""
    position_cm: FloatArray
    """(3,) position of the pinhole in the arena's frame."""

    @property
    def _matrix(self) -> FloatArray:
        """OpenCV's (3, 3) camera matrix: pixels are square, and the optical axis meets the middle of the picture."""
        middle_column, middle_row = (self.width_px - 1) / 2, (self.height_px - 1) / 2
        return np.array([[self.focal_px, 0, middle_column], [0, self.focal_px, middle_row], [0, 0, 1]])

    @property
    def _distortion(self) -> FloatArray:
        """OpenCV's (4,) distortion coefficients: k1, then k2, p1 and p2, which are 0."""
        return np.array([self.k1, 0.0, 0.0, 0.0])

    def project(self, points_cm: FloatArray) -> FloatArray:
        """Return the pixels that show points in front of the camera.

        Args:
            points_cm: (n, 3) cm: points in the arena's frame; n > 0.

        Returns:
            (n, 2) px: column and row of each.
        """
        rotation, _ = cv2.Rodrigues(self.rotation)
        shift = -self.rotation @ self.position_cm
        pixels, _ = cv2.projectPoints(
            np.ascontiguousarray(points_cm, float).reshape(-1, 1, 3), rotation, shift, self._matrix, self._distortion
        )
        return np.asarray(pixels, float).reshape(-1, 2)

    def back_project(self, pixels: FloatArray, z_cm: float) -> FloatArray:
        """Return the points of a horizontal plane that pixels show.

        Args:
            pixels: (n, 2) px: column and row of each; n > 0.
            z_cm: Height of the plane above the floor.

        Returns:
            (n, 2) cm: x and y of each. A pixel above the horizon shows no such point and gets the one behind the camera
            on the same line.
        """
        straight = cv2.undistortPoints(
            np.ascontiguousarray(pixels, float).reshape(-1, 1, 2),
            self._matrix,
            self._distortion,
            criteria=UNDISTORT_CRITERIA,
        ).reshape(-1, 2)
        rays = np.column_stack([straight, np.ones(len(straight))]) @ self.rotation
        distance = (z_cm - self.position_cm[2]) / rays[:, 2]
        points: FloatArray = self.position_cm[:2] + distance[:, None] * rays[:, :2]
        return points

    def plane_map(self, z_cm: float) -> Float32Array:
        """Return (height_px, width_px, 2) cm: the point `z_cm` above the floor that each pixel shows."""
        columns, rows = np.meshgrid(np.arange(self.width_px, dtype=float), np.arange(self.height_px, dtype=float))
        pixels = np.column_stack([columns.ravel(), rows.ravel()])
        return self.back_project(pixels, z_cm).reshape(self.height_px, self.width_px, 2).astype(np.float32)


def overhead_camera(section: OverheadSection, width_cm: float, height_cm: float) -> CameraModel:
    """Return the camera of a scenario, which looks straight down at the middle of the arena.

    Args:
        section: The section `overhead` of the scenario.
        width_cm: Width of the arena.
        height_cm: Height of the arena, along y.

    Raises:
        EpuckSimError: The camera would hang between the walls, or its distortion would fold the picture.
    """
    above_cm = section.height_cm or REFERENCE_HEIGHT_CM / REFERENCE_SIDE_CM * max(width_cm, height_cm)
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
            f"overhead.distortion is {k1:g}, which would fold the corners of a picture with this field of view; "
            f"allowed: above {lowest:.3g}"
        )
    return CameraModel(section.width_px, section.height_px, focal_px, k1, LOOKING_DOWN, position)


def _focal_px(section: OverheadSection, width_cm: float, height_cm: float, above_cm: float) -> float:
    """Return the focal length in pixels: from the field of view if it is given, else so that floor and walls fit."""
    if section.field_of_view_deg is not None:
        return section.width_px / 2 / math.tan(math.radians(section.field_of_view_deg) / 2)
    sides = ((section.width_px, width_cm), (section.height_px, height_cm))
    return min(pixels * (above_cm - WALL_HEIGHT_CM) / (side_cm * MARGIN) for pixels, side_cm in sides)
