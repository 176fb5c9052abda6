"""Fits a circle to a ring of light, and measures how well it fits."""

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray

BINS = 72
"""Number of directions in which a ring is examined: nine for each of its LEDs."""

STEP_CM = 0.125
"""Distance of samples along a direction."""

REACH_CM = 5.0
"""Distance from the centre up to which a direction is sampled."""

INSIDE = 0.5
"""Fraction of the radius beyond which a ring's light is searched."""

OUTSIDE_CM = 1.0
"""Distance outside of the radius up to which a ring's light is searched."""

EDGE_FAINT = 0.4
"""Level of the edge of a faint ring, relative to its median brightness: the light between its LEDs must count."""

EDGE_FULL = 0.75
"""Level of the edge of a saturated ring, relative to its median brightness: haze and neighbours must not count."""

HALF_CM = 0.55
"""Distance from the inner edge of an overexposed ring to its crest. It is 0.1 cm more in a lit room, 0.3 cm less for a
faint ring; radii are wrong by that much, centres are not."""

ON_CM = 0.25
"""Largest distance from a circle of light that counts as on it."""

MIN_BETWEEN_LEDS = 0.35
"""Minimum brightness of a ring between two LEDs, relative to its median brightness; a haze is darker."""

OUTLIER_CM = 0.25
"""Distance from the circle beyond which edges are left out of the fit."""

STEADY_CM = 0.02
"""Movement of the centre below which the fit ends."""

MAX_ROUNDS = 5
"""Largest number of rounds of the fit."""

_ANGLES = np.arange(BINS) * (2 * np.pi / BINS)
_RADII = np.arange(round(REACH_CM / STEP_CM)) * STEP_CM
_DESIGN = np.column_stack([np.ones(BINS), np.cos(_ANGLES), np.sin(_ANGLES)])


class Fit(NamedTuple):
    """A circle fitted to a ring of light."""

    column: float
    """Column of its centre in the rectified view."""
    row: float
    """Row of its centre in the rectified view."""
    radius_cm: float
    misfit_cm: float
    """Root mean square distance of the inner edge from a circle, without edges more than `OUTLIER_CM` off."""
    covered: BoolArray
    """(BINS,) whether there is light on the circle in each direction."""
    inside_light: float
    """Mean light within half the radius, relative to the median on the circle."""


def fit_ring(view: npt.NDArray[np.uint8], cells_per_cm: int, column: float, row: float, least: float) -> Fit | None:
    """Fit a circle to a ring whose centre is within about 1 cm of a cell.

    The inner edge of the light is at r(theta) = R + dx cos(theta) + dy sin(theta) for a centre that is off by (dx, dy).
    Least squares over `BINS` directions give R, dx and dy; this is repeated from the new centre. The inner edge is
    used, because other rings that touch the ring shine outside of it.

    Args:
        view: (rows, columns) light on the plane of the rings (see `rectified_view`).
        cells_per_cm: Resolution of the view.
        column: Column of the cell.
        row: Row of the cell.
        least: Minimum median level of a ring.

    Returns:
        The circle; None if half of the ring is missing or it is too faint.
    """
    radius = epuck.RING_RADIUS_CM
    for _ in range(MAX_ROUNDS):
        profile = _polar(view, cells_per_cm, column, row)
        ring = (INSIDE * radius <= _RADII) & (radius + OUTSIDE_CM >= _RADII)
        bright = float(np.median(profile[:, ring].max(axis=1)))
        if bright < least:
            return None
        edge, has = _edge(profile[:, ring], bright * (EDGE_FAINT + (EDGE_FULL - EDGE_FAINT) * bright / 255))
        if np.count_nonzero(has) <= BINS / 2:
            return None
        (inner, dx, dy), off = _circle(edge + _RADII[ring][0], has)
        radius = float(inner) + HALF_CM
        column, row = column + dx * cells_per_cm, row + dy * cells_per_cm
        if not 0 < radius < REACH_CM - OUTSIDE_CM:
            return None
        if np.hypot(dx, dy) < STEADY_CM:
            break
    on = profile[:, np.abs(_RADII - radius) <= ON_CM].max(axis=1)
    bright = float(np.median(on))
    if bright < least:
        return None
    inside_light = float(profile[:, radius / 2 > _RADII].mean()) / bright
    near = off <= OUTLIER_CM
    misfit = float(np.sqrt(np.mean(off[near] ** 2))) if near.any() else math.inf
    return Fit(column, row, radius, misfit, (on >= MIN_BETWEEN_LEDS * bright) & ~(off > OUTLIER_CM), inside_light)


def _polar(view: npt.NDArray[np.uint8], cells_per_cm: int, column: float, row: float) -> Float32Array:
    """Return (BINS, radii) the light along each direction from a cell."""
    flags = cv2.INTER_LINEAR | cv2.WARP_POLAR_LINEAR | cv2.WARP_FILL_OUTLIERS
    size = len(_RADII), BINS
    return np.asarray(cv2.warpPolar(view, size, (column, row), REACH_CM * cells_per_cm, flags), np.float32)


def _edge(profile: Float32Array, level: float) -> tuple[FloatArray, BoolArray]:
    """Return (BINS,) cm: where (BINS, n) samples first reach a level, from the first sample; and whether they do."""
    above = profile >= level
    first = above.argmax(axis=1)
    rows = np.arange(BINS)
    after, before = profile[rows, first], profile[rows, np.maximum(first - 1, 0)]
    back = np.where(after > before, (after - level) / np.maximum(after - before, 1), 0.0)
    return STEP_CM * (first - back), np.asarray(above.any(axis=1))


def _circle(edge: FloatArray, has: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Fit a circle to the edge of a ring.

    Args:
        edge: (BINS,) cm: distance of the edge in each direction.
        has: (BINS,) whether there is an edge.

    Returns:
        (3,) cm: R, dx and dy of the circle; (BINS,) cm: distance of the edge from it, NaN where there is none.
    """
    near = has
    for _ in range(2):
        design = _DESIGN[near]
        circle = np.linalg.solve(design.T @ design, design.T @ edge[near])
        off = np.abs(edge - _DESIGN @ circle)
        near = has & (off <= max(OUTLIER_CM, float(np.median(off[has]))))
    return circle, np.where(has, off, np.nan)
