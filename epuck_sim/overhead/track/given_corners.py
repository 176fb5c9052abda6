"""Corners of the floor that a user gives."""

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import FilmError
from epuck_sim.geometry import is_convex

MIN_SIDE = 0.1
"""Minimum length of the floor's sides, as a fraction of the picture's shorter side; rings are not located on less."""

MAX_OUTSIDE = 1.0
"""Largest distance of a corner from the picture, as a fraction of the picture's sides."""


def check_corners(corners_px: npt.ArrayLike, width_px: int, height_px: int) -> FloatArray:
    """Return (4, 2) px corners counter-clockwise as seen, from the lower left one on.

    Args:
        corners_px: (4, 2) px: columns and rows in any order.
        width_px: Width of the picture.
        height_px: Height of the picture.

    Raises:
        FilmError: The corners are not a convex quadrilateral, too close together, or far outside of the picture.
    """
    corners = np.asarray(corners_px, float)
    if corners.shape != (4, 2) or not np.isfinite(corners).all():
        raise FilmError(f"{_given(corners_px)}: allowed: four corners of the floor, a column and a row for each")
    size = np.array([width_px, height_px])
    if not ((corners >= -MAX_OUTSIDE * size) & (corners <= (1 + MAX_OUTSIDE) * size)).all():
        raise FilmError(
            f"{_given(corners_px)}: a corner is far outside of the picture of {width_px} x {height_px} px; allowed: up "
            "to a picture's width or height beyond its edges; columns and rows count from the upper left corner"
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
