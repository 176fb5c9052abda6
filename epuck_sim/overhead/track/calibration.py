"""Where a camera hangs, told from what it sees: the floor's four corners, or without them the size of the rings."""

import math
from collections.abc import Callable, Iterable

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera_model import LOOKING_DOWN, Lens
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.ring_detection import LEAST_IN_DARK, is_lit, ring_light

SHORTEST = 0.1
"""The floor's sides are at least this share of the picture's shorter side: smaller ones place no ring well."""

ITERATIONS = 60
NUDGE = 1e-7
"""Of the search for the camera that sees the corners, at most; and how far ahead it looks for slopes."""

ENOUGH = 300
"""Rings to measure: the rest of a film is not looked at."""

LEAST_PX = 5.0
"""Radius of the smallest ring that is measured: of a smaller one no hollow is left."""

SECTORS = 36
COVERED = 0.95
ROUND = 0.12
HOLLOW = 0.5
"""A blob is a ring where it shines in this share of the directions, the middles of its thickness in them differ by at
most this share of the radius (standard deviation), and nothing shines within this share of it."""


def lens_from_corners(
    corners_px: npt.ArrayLike,
    width_px: int,
    height_px: int,
    arena_width_cm: float,
    arena_height_cm: float,
    above_cm: float,
) -> Lens:
    """Return the camera that sees the floor's corners where they are: it may look down askew.

    corners_px: (4, 2) columns and rows in any order; the one nearest to the picture's lower left corner is the arena's
    origin. above_cm: of the lens above the floor, as corners seen from straight above tell no height. Of the cameras so
    high, and without distortion, it is the one with the least squares.
    Raises FilmError for corners that are no convex quadrilateral, too small, or not in the picture.
    """
    corners = _in_order(corners_px, width_px, height_px)
    floor = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) * (arena_width_cm, arena_height_cm, 0.0)

    def lens_of(pose: FloatArray) -> Lens:
        """Return the camera of (6,) turn, rad, place, shares of the height, and logarithm of the focal length."""
        rotation = np.asarray(cv2.Rodrigues(pose[:3])[0], float) @ LOOKING_DOWN
        position = floor.mean(axis=0) + above_cm * np.array([*pose[3:5], 1.0])
        return Lens(width_px, height_px, math.exp(pose[5]), 0.0, rotation, position)

    scale = math.sqrt(_area(corners) / (arena_width_cm * arena_height_cm))
    turn = math.atan2(*(corners[1] - corners[0])[::-1])
    start = np.array([0.0, 0.0, turn, 0.0, 0.0, math.log(scale * above_cm)])
    return lens_of(_least_squares(lambda pose: (lens_of(pose).pixels(floor) - corners).ravel(), start))


def lens_from_rings(
    radii_px: npt.ArrayLike,
    width_px: int,
    height_px: int,
    arena_width_cm: float,
    arena_height_cm: float,
    above_cm: float,
) -> Lens:
    """Return a camera straight above the arena's middle, which the picture's middle shows, that sees rings so large.

    radii_px: of one ring or more, as `measure_radius` returns it; their median counts. above_cm: of the
    lens above the floor. Raises FilmError where a radius is no positive number.
    """
    radii = np.atleast_1d(np.asarray(radii_px, float))
    if not radii.size or not (np.isfinite(radii) & (radii > 0)).all():
        raise FilmError(f"the rings' radii are {radii.tolist()} px; allowed: one or more, above 0")
    focal_px = float(np.median(radii)) / epuck.RING_RADIUS_CM * (above_cm - epuck.RING_HEIGHT_CM)
    position = np.array([arena_width_cm / 2, arena_height_cm / 2, above_cm])
    return Lens(width_px, height_px, focal_px, 0.0, LOOKING_DOWN, position)


def measure_radius(pictures: Iterable[Picture]) -> float | None:
    """Return px: the median radius of the rings that touch no other, in pictures of the dark; None without any.

    It looks at no more pictures than it takes to measure `ENOUGH`.
    """
    radii: list[float] = []
    for picture in pictures:
        if not is_lit(picture):
            radii += _radii(ring_light(picture, False))
        if len(radii) >= ENOUGH:
            break
    return float(np.median(radii)) if radii else None


def _in_order(corners_px: npt.ArrayLike, width_px: int, height_px: int) -> FloatArray:
    """Return (4, 2) corners counter-clockwise as one sees them, from the one at the lower left; check them."""
    corners = np.asarray(corners_px, float)
    if corners.shape != (4, 2) or not np.isfinite(corners).all():
        raise FilmError(f"{_given(corners_px)}: allowed: four corners of the floor, column and row of each")
    if not ((corners >= 0) & (corners <= (width_px - 1, height_px - 1))).all():
        raise FilmError(
            f"{_given(corners_px)}: a corner is outside of the picture; allowed: columns from 0 to {width_px - 1}, "
            f"rows from 0 to {height_px - 1}, which count from the upper left corner"
        )
    away = corners - corners.mean(axis=0)
    corners = corners[np.argsort(np.arctan2(-away[:, 1], away[:, 0]), kind="stable")]
    along = np.roll(corners, -1, axis=0) - corners
    after = np.roll(along, -1, axis=0)
    if not (along[:, 1] * after[:, 0] - along[:, 0] * after[:, 1] > 0).all():
        raise FilmError(
            f"{_given(corners_px)}: these are not the corners of a convex quadrilateral; give the floor's four corners "
            "as the picture shows them, in any order"
        )
    shortest, least = float(np.hypot(*along.T).min()), SHORTEST * min(width_px, height_px)
    if shortest < least:
        raise FilmError(
            f"{_given(corners_px)}: the shortest side is {shortest:.3g} px; allowed: at least {least:.3g} px, as rings "
            "cannot be placed in a smaller picture of the floor"
        )
    lower_left = np.hypot(corners[:, 0], corners[:, 1] - (height_px - 1))
    return np.roll(corners, -int(lower_left.argmin()), axis=0)


def _given(corners_px: npt.ArrayLike) -> str:
    """Return corners as the user gave them, for an error."""
    return "--corners " + ",".join(f"{number:g}" for number in np.ravel(corners_px))


def _area(corners: FloatArray) -> float:
    """Return the area of (4, 2) corners in order."""
    x, y = corners.T
    return abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))) / 2


def _least_squares(misses: Callable[[FloatArray], FloatArray], start: FloatArray) -> FloatArray:
    """Return the arguments, near (n,) `start`, at which the squares of `misses` have the least sum (Levenberg 1944)."""
    point, damping = start, 1e-3
    off = misses(point)
    for _ in range(ITERATIONS):
        slopes = np.column_stack([(misses(point + step) - off) / NUDGE for step in NUDGE * np.eye(len(point))])
        square = slopes.T @ slopes
        further = point - np.linalg.solve(square + damping * np.diag(square.diagonal()), slopes.T @ off)
        further_off = misses(further)
        if further_off @ further_off < off @ off:
            point, off, damping = further, further_off, damping / 10
        else:
            damping *= 10
        if damping > 1e12:
            break
    return point


def _radii(light: npt.NDArray[np.uint8]) -> list[float]:
    """Return px: the radii of the blobs that are whole rings."""
    brightest = cv2.minMaxLoc(light)[1]
    if brightest < 2 * LEAST_IN_DARK:
        return []
    _, labels, boxes, _ = cv2.connectedComponentsWithStats((light > brightest / 2).astype(np.uint8))
    radii = []
    for label, (left, top, width, height, _) in enumerate(boxes[1:], 1):
        if min(width, height) >= 2 * LEAST_PX and max(width, height) <= 1.2 * min(width, height):
            rows, columns = np.nonzero(labels[top : top + height, left : left + width] == label)
            radius = _radius(columns - (width - 1) / 2, rows - (height - 1) / 2)
            if radius is not None:
                radii.append(radius)
    return radii


def _radius(x: FloatArray, y: FloatArray) -> float | None:
    """Return px: the radius of the ring around about (0, 0) that consists of pixels (n,) x, y; None where it is none.

    In each of `SECTORS` directions the ring's middle is halfway between its nearest and its farthest pixel.
    """
    distance = np.hypot(x, y)
    sector = ((np.arctan2(y, x) + math.pi) / (2 * math.pi) * SECTORS).astype(int) % SECTORS
    nearest, farthest = np.full(SECTORS, np.inf), np.zeros(SECTORS)
    np.minimum.at(nearest, sector, distance)
    np.maximum.at(farthest, sector, distance)
    lit = farthest > 0
    middle = (nearest[lit] + farthest[lit]) / 2
    radius = float(middle.mean())
    is_ring = lit.mean() >= COVERED and middle.std() <= ROUND * radius and nearest[lit].min() >= HOLLOW * radius
    return radius if is_ring and radius >= LEAST_PX else None
