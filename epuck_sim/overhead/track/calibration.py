"""Determines a camera's pose from its pictures: from the floor's four corners, or else from the size of the rings."""

import math
from collections.abc import Iterable

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray
from epuck_sim.errors import FilmError
from epuck_sim.geometry import is_convex, polygon_area
from epuck_sim.overhead.camera_model import LOOKING_DOWN, CameraModel
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.ring_detection import MIN_LEVEL_DARK, is_lit, ring_light

MIN_SIDE = 0.1
"""Minimum length of the floor's sides, as a fraction of the picture's shorter side; rings are not located on less."""

TOLERANCE = 1e-15
"""Relative change of the squares, the pose or the gradient at which the least-squares fit of the pose ends."""

MAX_RINGS = 300
"""Number of rings to measure; once it is reached, the rest of a film is not read."""

MIN_RADIUS_PX = 5.0
"""Radius of the smallest ring that is measured; the hollow of smaller ones is lost."""

SECTORS = 36
"""Number of directions from a blob's middle in which its light is examined."""

MIN_COVERED = 0.95
"""Minimum fraction of the directions in which a ring has light."""

MAX_UNROUND = 0.12
"""Largest standard deviation, over the directions, of the middle of a ring's light, as a fraction of the radius."""

MIN_HOLLOW = 0.5
"""Fraction of the radius within which a ring has no light."""


def camera_from_corners(
    corners_px: npt.ArrayLike,
    width_px: int,
    height_px: int,
    arena_width_cm: float,
    arena_height_cm: float,
    above_cm: float,
) -> CameraModel:
    """Return the camera, without distortion, that best sees the floor's corners where they are; it may be tilted.

    Args:
        corners_px: (4, 2) px: columns and rows in any order; the corner nearest to the picture's lower left corner is
            the arena's origin.
        width_px: Width of the picture.
        height_px: Height of the picture.
        arena_width_cm: Width of the floor.
        arena_height_cm: Height of the floor, along y.
        above_cm: Height of the camera above the floor, which corners seen from straight above do not determine.

    Raises:
        FilmError: The corners are not a convex quadrilateral, too close together, or outside of the picture.
    """
    # loading it takes half a second, and most films do without it
    from scipy.optimize import least_squares  # noqa: PLC0415

    corners = _checked_corners(corners_px, width_px, height_px)
    floor = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) * (arena_width_cm, arena_height_cm, 0.0)

    def camera_at(pose: FloatArray) -> CameraModel:
        """Return a camera from (6,): rotation vector, offset relative to the height, logarithm of the focal length."""
        rotation = np.asarray(cv2.Rodrigues(pose[:3])[0], float) @ LOOKING_DOWN
        position = floor.mean(axis=0) + above_cm * np.array([*pose[3:5], 1.0])
        return CameraModel(width_px, height_px, math.exp(pose[5]), 0.0, rotation, position)

    def misses(pose: FloatArray) -> FloatArray:
        return (camera_at(pose).project(floor) - corners).ravel()

    scale = math.sqrt(abs(polygon_area(corners)) / (arena_width_cm * arena_height_cm))
    turn = math.atan2(*(corners[1] - corners[0])[::-1])
    start = np.array([0.0, 0.0, turn, 0.0, 0.0, math.log(scale * above_cm)])
    fit = least_squares(misses, start, method="lm", ftol=TOLERANCE, xtol=TOLERANCE, gtol=TOLERANCE)
    return camera_at(fit.x)


def camera_from_rings(
    radii_px: npt.ArrayLike,
    width_px: int,
    height_px: int,
    arena_width_cm: float,
    arena_height_cm: float,
    above_cm: float,
) -> CameraModel:
    """Return the camera straight above the arena's middle in whose pictures rings have these radii.

    Args:
        radii_px: Radius of one ring or more, as `measure_radius` returns it; their median is used.
        width_px: Width of the picture.
        height_px: Height of the picture.
        arena_width_cm: Width of the floor.
        arena_height_cm: Height of the floor, along y.
        above_cm: Height of the camera above the floor.

    Raises:
        FilmError: A radius is not a positive number.
    """
    radii = np.atleast_1d(np.asarray(radii_px, float))
    if not radii.size or not (np.isfinite(radii) & (radii > 0)).all():
        raise FilmError(f"the rings' radii are {radii.tolist()} px; allowed: one or more, above 0")
    focal_px = float(np.median(radii)) / epuck.RING_RADIUS_CM * (above_cm - epuck.RING_HEIGHT_CM)
    position = np.array([arena_width_cm / 2, arena_height_cm / 2, above_cm])
    return CameraModel(width_px, height_px, focal_px, 0.0, LOOKING_DOWN, position)


def measure_radius(pictures: Iterable[Picture]) -> float | None:
    """Return the median radius, in px, of rings that touch no other; None if there are none.

    Args:
        pictures: Pictures of the dark room; lit ones are skipped. Reading ends after `MAX_RINGS` rings.
    """
    radii: list[float] = []
    for picture in pictures:
        if not is_lit(picture):
            radii += _ring_radii(ring_light(picture, False))
        if len(radii) >= MAX_RINGS:
            break
    return float(np.median(radii)) if radii else None


def _checked_corners(corners_px: npt.ArrayLike, width_px: int, height_px: int) -> FloatArray:
    """Return (4, 2) corners counter-clockwise as seen, from the lower left one on; raise FilmError for bad ones."""
    corners = np.asarray(corners_px, float)
    if corners.shape != (4, 2) or not np.isfinite(corners).all():
        raise FilmError(f"{_given(corners_px)}: allowed: four corners of the floor, a column and a row for each")
    if not ((corners >= 0) & (corners <= (width_px - 1, height_px - 1))).all():
        raise FilmError(
            f"{_given(corners_px)}: a corner is outside of the picture; allowed: columns from 0 to {width_px - 1}, "
            f"rows from 0 to {height_px - 1}, which count from the upper left corner"
        )
    away = corners - corners.mean(axis=0)
    corners = corners[np.argsort(np.arctan2(-away[:, 1], away[:, 0]), kind="stable")]
    if not is_convex(corners * (1, -1)):  # rows count downwards
        raise FilmError(
            f"{_given(corners_px)}: these are not the corners of a convex quadrilateral; give the floor's four corners "
            "as the picture shows them, in any order"
        )
    shortest = float(np.hypot(*(np.roll(corners, -1, axis=0) - corners).T).min())
    least = MIN_SIDE * min(width_px, height_px)
    if shortest < least:
        raise FilmError(
            f"{_given(corners_px)}: the shortest side is {shortest:.3g} px; allowed: at least {least:.3g} px, because "
            "rings cannot be located on a smaller floor"
        )
    lower_left = np.hypot(corners[:, 0], corners[:, 1] - (height_px - 1))
    return np.roll(corners, -int(lower_left.argmin()), axis=0)


def _given(corners_px: npt.ArrayLike) -> str:
    """Return corners as the user gave them, for an error message."""
    return "--corners " + ",".join(f"{number:g}" for number in np.ravel(corners_px))


def _ring_radii(light: npt.NDArray[np.uint8]) -> list[float]:
    """Return the radii, in px, of the blobs that are whole rings."""
    brightest = cv2.minMaxLoc(light)[1]
    if brightest < 2 * MIN_LEVEL_DARK:
        return []
    _, labels, boxes, _ = cv2.connectedComponentsWithStats((light > brightest / 2).astype(np.uint8))
    radii = []
    for label, (left, top, width, height, _) in enumerate(boxes[1:], 1):
        if min(width, height) >= 2 * MIN_RADIUS_PX and max(width, height) <= 1.2 * min(width, height):
            rows, columns = np.nonzero(labels[top : top + height, left : left + width] == label)
            radius = _ring_radius(columns - (width - 1) / 2, rows - (height - 1) / 2)
            if radius is not None:
                radii.append(radius)
    return radii


def _ring_radius(x: FloatArray, y: FloatArray) -> float | None:
    """Return the radius, in px, of the ring that (n,) pixels around about (0, 0) form; None if they do not form one.

    In each of `SECTORS` directions the middle of the ring's light is halfway between its nearest and farthest pixel.
    """
    distance = np.hypot(x, y)
    sector = ((np.arctan2(y, x) + math.pi) / (2 * math.pi) * SECTORS).astype(int) % SECTORS
    nearest, farthest = np.full(SECTORS, np.inf), np.zeros(SECTORS)
    np.minimum.at(nearest, sector, distance)
    np.maximum.at(farthest, sector, distance)
    lit = farthest > 0
    middle = (nearest[lit] + farthest[lit]) / 2
    radius = float(middle.mean())
    is_ring = (
        lit.mean() >= MIN_COVERED and middle.std() <= MAX_UNROUND * radius and nearest[lit].min() >= MIN_HOLLOW * radius
    )
    return radius if is_ring and radius >= MIN_RADIUS_PX else None
