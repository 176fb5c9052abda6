"""Determines a camera from its pictures: from the floor's corners, and from the size and the shape of rings.

A lens that bends straight lines and a camera that hangs askew show rings larger or smaller, and flattened, from place
to place. So rings tell the distortion and the tilt; corners tell the place of the floor.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray
from epuck_sim.geometry import polygon_area
from epuck_sim.overhead.camera_model import LOOKING_DOWN, CameraModel, Lens, fisheye_lens, simple_lens
from epuck_sim.overhead.track.given_corners import check_corners
from epuck_sim.overhead.track.ring_sizes import SeenRings

TOLERANCE = 1e-12
"""Relative change of the squares, the pose or the gradient at which the least-squares fit of the camera ends."""

ENOUGH_RINGS = 8
"""Number of rings from which they tell distortion and tilt."""

CORNER_PX = 0.5
"""Standard deviation of a corner that is given."""

SHAPE_ERRORS = (0.5, 0.1, 0.02)
"""Standard deviation of a ring's size and flattening, relative to its radius, in one fit after the other: large errors
count for little, and at first all are large."""

SIZE_PRIOR = 0.05
"""Standard deviation of the radius of real rings around `epuck.RING_RADIUS_CM`, relative to it."""

K1_PRIOR = 0.15
"""Standard deviation of the radial distortion of usual lenses; keeps it small where rings do not tell."""

TILT_PRIOR = 0.3
"""Standard deviation, in radians, of the tilt of a camera of which no corners are given."""

FISHEYE_GAIN = 0.6
"""Sum of the squares of a fisheye lens, relative to that of a usual one, below which a lens is a fisheye."""

_CIRCLE = np.arange(24) * math.tau / 24


class FittedCamera(NamedTuple):
    """A camera, and how well its pictures determine it."""

    camera: CameraModel
    error_cm: float
    """Standard error of positions at the floor's corners, as far as the fit knows; without corners, relative to each
    other. 0 if nothing tells."""
    tilt_deg: float
    """Angle between the optical axis and straight down."""


def fit_camera(
    size_px: tuple[int, int],
    floor_cm: tuple[float, float],
    above_cm: float,
    rings: SeenRings,
    corners_px: npt.ArrayLike | None = None,
    lens: Lens | None = None,
) -> FittedCamera:
    """Fit the camera that sees the floor's corners, if they are given, and rings where and as large as they are seen.

    Args:
        size_px: Width and height of the picture.
        floor_cm: Width and height, along y, of the floor.
        above_cm: Height of the camera above the floor, which corners seen from straight above do not determine.
        rings: Rings in the film; may be none if corners are given.
        corners_px: (4, 2) px: columns and rows in any order; the corner nearest to the picture's lower left corner is
            the arena's origin. Without them, the camera is aimed at the arena's middle, and not turned.
        lens: The lens, if it was calibrated.

    Raises:
        FilmError: The corners are not a convex quadrilateral, too close together, or far outside of the picture.
    """
    corners = None if corners_px is None else check_corners(corners_px, *size_px)
    problem = _Problem(size_px, floor_cm, above_cm, rings, corners, lens)
    fits = [problem.solve(is_fisheye) for is_fisheye in ((False, True) if problem.has_free_lens else (False,))]
    best = fits[-1] if fits[-1].cost < FISHEYE_GAIN * fits[0].cost else fits[0]
    tilt_deg = math.degrees(math.acos(min(1.0, -best.camera.rotation[2, 2])))
    return FittedCamera(best.camera, problem.error_cm(best), tilt_deg)


class _Solution(NamedTuple):
    camera: CameraModel
    cost: float
    values: FloatArray
    covariance: FloatArray
    is_fisheye: bool


class _Problem:
    """Least squares over (8,) values; what the film does not tell is held.

    0 to 2: rotation vector, of which the third, the turn, is held without corners, and all without enough rings. 3, 4:
    offset relative to the height, held without corners. 5: logarithm of the focal length, or of the relative height if
    the lens is known. 6: k1, held without enough rings. 7: logarithm of the rings' relative size, held without corners.
    """

    def __init__(
        self,
        size_px: tuple[int, int],
        floor_cm: tuple[float, float],
        above_cm: float,
        rings: SeenRings,
        corners: FloatArray | None,
        lens: Lens | None,
    ) -> None:
        self._size_px, self._above_cm, self._lens = size_px, above_cm, lens
        self._rings, self._corners = rings, corners
        self._floor = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) * (*floor_cm, 0.0)
        self.has_free_lens = lens is None and rings.number >= ENOUGH_RINGS
        start = np.zeros(8)
        if corners is not None:
            scale = math.sqrt(abs(polygon_area(corners)) / (floor_cm[0] * floor_cm[1]))
            start[2] = math.atan2(*(corners[1] - corners[0])[::-1])
            start[5] = math.log(scale * above_cm)
        else:
            scale = float(np.median(rings.radius_px)) / epuck.RING_RADIUS_CM
            start[5] = math.log(scale * (above_cm - epuck.RING_HEIGHT_CM))
        if lens is not None:  # then the film tells the height instead of the focal length
            start[5] = math.log(lens.focal_px / above_cm) - (start[5] - math.log(above_cm))
        tells_tilt = corners is not None or rings.number >= ENOUGH_RINGS
        self._free = np.array([tells_tilt] * 2 + [corners is not None] * 3 + [True, False, False])
        self._free[7] = corners is not None and rings.number > 0
        self._start = start

    def _camera(self, values: FloatArray, is_fisheye: bool) -> CameraModel:
        rotation = np.asarray(cv2.Rodrigues(values[:3])[0], float) @ LOOKING_DOWN
        middle = self._floor.mean(axis=0)
        above_cm = self._above_cm * (1.0 if self._lens is None else math.exp(values[5]))
        if self._corners is not None:
            position = middle + above_cm * np.array([*values[3:5], 1.0])
        else:
            position = middle - rotation[2] * above_cm / -rotation[2, 2]
        focal_px = math.exp(values[5])
        lens = self._lens or (
            fisheye_lens(*self._size_px, focal_px) if is_fisheye else simple_lens(*self._size_px, focal_px, values[6])
        )
        return CameraModel(*self._size_px, lens, rotation, position)

    def solve(self, is_fisheye: bool) -> _Solution:
        # loading it takes half a second, and described films do without it
        from scipy.optimize import least_squares  # noqa: PLC0415

        free = self._free.copy()
        free[6] = self.has_free_lens and not is_fisheye

        def filled(free_values: FloatArray) -> FloatArray:
            values = self._start.copy()
            values[free] = free_values
            return values

        def misses(free_values: FloatArray, shape_error: float) -> FloatArray:
            values = filled(free_values)
            with np.errstate(all="ignore"):
                off = self._misses(self._camera(values, is_fisheye), values, shape_error)
            return np.nan_to_num(off, nan=1e3, posinf=1e3, neginf=-1e3)

        found = self._start[free]
        for shape_error in SHAPE_ERRORS:
            fit = least_squares(
                misses, found, x_scale="jac", ftol=TOLERANCE, xtol=TOLERANCE, gtol=TOLERANCE, args=(shape_error,)
            )
            found = fit.x
        values = filled(found)
        covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
        return _Solution(self._camera(values, is_fisheye), float(fit.cost), found, covariance, is_fisheye)

    def _misses(self, camera: CameraModel, values: FloatArray, shape_error: float) -> FloatArray:
        priors = [values[6] / K1_PRIOR, values[7] / SIZE_PRIOR]
        if self._corners is None:
            priors += list(values[:2] / TILT_PRIOR)
        parts = [np.array(priors)]
        if self._corners is not None:
            parts.append((camera.project(self._floor) - self._corners).ravel() / CORNER_PX)
        if self._rings.number:
            seen = expected_rings(camera, self._rings.places_px, epuck.RING_RADIUS_CM * math.exp(values[7]))
            off = np.column_stack([
                np.log(np.maximum(seen.radius_px, 1e-3) / self._rings.radius_px),
                seen.flattening - self._rings.flattening,
            ])  # fmt: skip
            off = (off / shape_error).ravel()
            parts.append(np.sign(off) * np.sqrt(2 * np.log1p(off**2 / 2)))  # a ring that is none counts for little
        return np.concatenate(parts)

    def error_cm(self, solution: _Solution) -> float:
        """Return the standard error of the floor's corners on the floor, from draws of what was fitted."""
        if not self._rings.number:
            return 0.0
        generator = np.random.default_rng(0)
        draws = generator.multivariate_normal(solution.values, solution.covariance, 32, method="svd")
        free = self._free.copy()
        free[6] = self.has_free_lens and not solution.is_fisheye
        pixels = solution.camera.project(self._floor)
        off = []
        for draw in draws:
            values = self._start.copy()
            values[free] = draw
            moved = self._camera(values, solution.is_fisheye).back_project(pixels, 0.0) - self._floor[:, :2]
            off.append(moved)
        return float(np.sqrt(np.mean(np.sum(np.square(off), axis=2))))


def expected_rings(camera: CameraModel, places_px: FloatArray, radius_cm: float) -> SeenRings:
    """Return how a camera would see rings whose middles are at (n, 2) px."""
    centres = camera.back_project(places_px, epuck.RING_HEIGHT_CM)
    rim = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)], axis=-1) * radius_cm
    points = np.concatenate([np.zeros((1, 2)), rim]) + centres[:, None]
    height = np.full((*points.shape[:2], 1), epuck.RING_HEIGHT_CM)
    pixels = camera.project(np.concatenate([points, height], axis=2).reshape(-1, 3)).reshape(len(centres), -1, 2)
    away = pixels[:, 1:] - pixels[:, 1:].mean(axis=1, keepdims=True)
    squares = (away[:, :, :, None] * away[:, :, None, :]).mean(axis=1)  # of an ellipse: half of its axes' squares
    return SeenRings.from_moments(places_px, squares)
