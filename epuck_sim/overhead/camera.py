"""A camera above the arena: which pixel shows a point, and the reverse, by OpenCV's camera model; and its pictures.

The arena's frame: x to the right, y up in the picture, z above the floor, origin in the lower left corner of the floor.
Pixels: (column, row), measured from the middle of the upper left pixel, as in OpenCV.
"""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.scenario.overhead import OverheadSection

Picture = npt.NDArray[np.uint8]
"""(height_px, width_px, 3) red, green, blue; row 0 is the upper edge."""
Light = npt.NDArray[np.uint8]
"""(rows, columns) one channel of a picture or of the rectified view."""


class Frame(NamedTuple):
    """One picture of a film."""

    time_s: float
    """Beginning of its exposure, on the film's own clock."""
    picture: Picture


ProgressWrapper = Callable[[Iterable[Any], float | None], Iterable[Any]]
"""Function that passes on tuples, whose first items are times in s, and shows how far their reader is.

Its second argument is the time of the last one; None if it is unknown."""

REFERENCE_HEIGHT_CM = 110.0  # height of the camera above the floor in the thesis's experiments (4.3.1)
REFERENCE_SIDE_CM = 60.0  # side of the arena in the thesis's experiments (4.3.1)
WALL_HEIGHT_CM = 6.0  # height of the arena's walls; our estimate: they hide a robot of 4.7 cm from its surroundings

LOOKING_DOWN = np.diag([1.0, -1.0, -1.0])  # rotation from the arena's frame into a camera's (x right, y down, z ahead)
MARGIN = 1.04  # factor by which the default field of view is larger than the floor with its walls
OUTLINE_POINTS = 16  # points on each side of the floor's outline, which distortion bows

UNDISTORT_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
"""Termination criterion (iterations, tolerance) for undistortPoints; OpenCV's default of five iterations is off by
whole pixels in the corners of a wide, strongly distorted picture."""


class Lens(NamedTuple):
    """Where a camera's picture shows a direction: OpenCV's camera matrix and distortion, of a usual or fisheye lens."""

    focal_px: float
    """Focal length across the picture."""
    focal_down_px: float
    """Focal length down the picture; the same where pixels are square."""
    middle_px: tuple[float, float]
    """Column and row that the optical axis meets."""
    coefficients: tuple[float, ...]
    """OpenCV's distortion coefficients: k1, k2, p1, p2, k3 of its usual model, or k1 to k4 of its fisheye model."""
    is_fisheye: bool = False

    @property
    def matrix(self) -> FloatArray:
        """OpenCV's (3, 3) camera matrix."""
        column, row = self.middle_px
        return np.array([[self.focal_px, 0, column], [0, self.focal_down_px, row], [0, 0, 1]])


def simple_lens(width_px: int, height_px: int, focal_px: float, k1: float = 0.0, is_fisheye: bool = False) -> Lens:
    """Return a lens with square pixels whose axis meets the middle of the picture; k1: its radial distortion.

    A fisheye lens with k1 = 0 is equidistant: pixels off the middle are proportional to angles off the axis.
    """
    return Lens(focal_px, focal_px, ((width_px - 1) / 2, (height_px - 1) / 2), (k1, 0.0, 0.0, 0.0), is_fisheye)


class CameraModel(NamedTuple):
    """A camera somewhere above the arena."""

    width_px: int
    height_px: int
    lens: Lens
    rotation: FloatArray
    """(3, 3) rotation from the arena's frame into the camera's."""
    position_cm: FloatArray
    """(3,) position of the pinhole in the arena's frame."""

    def project(self, points_cm: FloatArray) -> FloatArray:
        """Return (n, 2) px: column and row that show (n, 3) points in front of the camera, cm; n > 0."""
        show = cv2.fisheye.projectPoints if self.lens.is_fisheye else cv2.projectPoints
        # turned here: as a vector, as OpenCV wants it, a rotation by about half a turn loses a thousandth of a degree
        seen = (np.asarray(points_cm, float) - self.position_cm) @ self.rotation.T
        pixels, _ = show(seen[:, None], np.zeros(3), np.zeros(3), self.lens.matrix, np.array(self.lens.coefficients))
        return np.asarray(pixels, float).reshape(-1, 2)

    def back_project(self, pixels: FloatArray, z_cm: float) -> FloatArray:
        """Return (n, 2) cm: x and y of the points `z_cm` above the floor that (n, 2) px show; n > 0.

        A pixel above the horizon shows no such point and gets the one behind the camera on the same line.
        """
        seen = np.ascontiguousarray(pixels, float).reshape(-1, 1, 2)
        straighten = cv2.fisheye.undistortPoints if self.lens.is_fisheye else cv2.undistortPoints
        coefficients = np.array(self.lens.coefficients)
        straight = straighten(seen, self.lens.matrix, coefficients, criteria=UNDISTORT_CRITERIA).reshape(-1, 2)
        straight[~np.isfinite(straight).all(axis=1)] = np.nan  # beyond what a fisheye lens shows
        rays = np.column_stack([straight, np.ones(len(straight))]) @ self.rotation
        distance = (z_cm - self.position_cm[2]) / rays[:, 2]
        return np.asarray(self.position_cm[:2] + distance[:, None] * rays[:, :2])

    def plane_map(self, z_cm: float) -> Float32Array:
        """Return (height_px, width_px, 2) cm: the point `z_cm` above the floor that each pixel shows."""
        rows, columns = np.indices((self.height_px, self.width_px), float)
        pixels = np.column_stack([columns.ravel(), rows.ravel()])
        return self.back_project(pixels, z_cm).reshape(self.height_px, self.width_px, 2).astype(np.float32)


class Geometry(NamedTuple):
    """The camera that took a film, where the floor is in its pictures, and how well both are known."""

    camera: CameraModel
    floor_cm: tuple[float, float]
    """Width and height, along y, of the floor."""
    calibration: str
    """What the camera was determined from."""
    knows_floor: bool
    """Whether the floor's place in the picture is known, so that rings outside of it are left out."""
    error_cm: float = 0.0
    """Standard error of positions at the floor's corners, or relative to each other; 0 if nothing tells."""
    tilt_deg: float = 0.0
    """Angle between the camera's axis and straight down."""
    background: Light | None = None
    """Constant light of the dark scene without rings."""
    ring_light: float = 0.0
    """Levels by which rings in the dark are usually brighter than their inside; 0 if it is not known."""
    ring_size: float = 1.0
    """Radius of the rings by the floor's corners, relative to the known one."""

    def floor_outline_px(self) -> FloatArray:
        """Return (n, 2) px: the outline of the floor, in order."""
        share = np.arange(OUTLINE_POINTS)[:, None] / OUTLINE_POINTS
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * self.floor_cm
        ends = np.roll(corners, -1, 0)
        outline = np.vstack([start + share * (end - start) for start, end in zip(corners, ends, strict=True)])
        return self.camera.project(np.column_stack([outline, np.zeros(len(outline))]))


def overhead_camera(section: OverheadSection, width_cm: float, height_cm: float) -> CameraModel:
    """Return the camera of a scenario, which looks at the middle of an arena of this width and height, along y.

    Raises:
        EpuckSimError: The camera would hang between the walls, or its distortion would fold the picture.
    """
    above_cm = section.height_cm or REFERENCE_HEIGHT_CM / REFERENCE_SIDE_CM * max(width_cm, height_cm)
    if above_cm <= 2 * WALL_HEIGHT_CM:
        raise EpuckSimError(
            f"overhead.height_cm is {above_cm:g}; allowed: more than {2 * WALL_HEIGHT_CM:g}, twice the walls' height"
        )
    rotation = _rotation(math.radians(section.tilt_deg), math.radians(section.turn_deg))
    middle = np.array([width_cm / 2, height_cm / 2, 0.0])
    lens = _lens(section, width_cm, height_cm, above_cm)
    position = middle - above_cm / rotation[2, 2] * -rotation[2]
    return CameraModel(section.width_px, section.height_px, lens, rotation, position)


def _rotation(tilt: float, turn: float) -> FloatArray:
    if not tilt and not turn:
        return LOOKING_DOWN  # without zeros that are negative
    lean = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    spin = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    return np.asarray(lean @ LOOKING_DOWN @ spin)


def _lens(section: OverheadSection, width_cm: float, height_cm: float, above_cm: float) -> Lens:
    """Return the lens whose field of view is the one given, or else just holds floor and walls from straight above."""
    size = section.width_px, section.height_px
    if section.field_of_view_deg is not None:
        focals_px = [section.width_px / 2 / math.tan(math.radians(section.field_of_view_deg) / 2)]
    else:
        sides = zip(size, (width_cm, height_cm), strict=True)
        focals_px = [pixels * (above_cm - WALL_HEIGHT_CM) / (side_cm * MARGIN) for pixels, side_cm in sides]
    if section.lens == "fisheye":
        focals_px = [side / 2 / math.atan(side / 2 / focal) for side, focal in zip(size, focals_px, strict=False)]
        return simple_lens(*size, min(focals_px), is_fisheye=True)
    focal_px = min(focals_px)
    corner = math.hypot(*size) / 2 / focal_px
    lowest = -1 / (3 * (1.5 * corner) ** 2)  # r + k1 r^3 turns back where it is 2/3 of r
    if section.distortion <= lowest:
        raise EpuckSimError(
            f"overhead.distortion is {section.distortion:g}, which would fold the corners of a picture with this field "
            f"of view; allowed: above {lowest:.3g}"
        )
    return simple_lens(*size, focal_px, section.distortion)
