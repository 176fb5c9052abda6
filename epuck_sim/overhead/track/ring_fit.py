"""Fits a slightly flattened circle to a ring of light, and measures how well it fits."""

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray

BINS = 72
"""Number of directions in which a ring is examined: nine for each of its LEDs."""

LED_BINS = BINS // 8
"""Number of directions from one LED to the next, over which light is joined: a short exposure shows eight points."""

STEP_CM = 0.125
"""Distance of samples along a direction."""

REACH_CM = 6.0
"""Distance from the centre up to which a direction is sampled."""

INSIDE = 0.5
"""Fraction of the radius beyond which a ring's light is searched."""

OUTSIDE_CM = 1.0
"""Distance outside of the radius up to which a ring's light is searched."""

EDGE = 0.5
"""Level of the edge of a ring, between that of its inside (0) and its median brightness (1)."""

HALF_CM = 0.4
"""Distance from the inner edge of a ring to its crest, as a first estimate."""

ON_CM = 0.25
"""Largest distance from a circle of light that counts as on it."""

BEYOND_CM = (0.5, 1.2)
"""Distances outside of a circle between which the light of neighbours is measured."""

MIN_BETWEEN_LEDS = 0.35
"""Minimum brightness of a ring between two LEDs, between that of its inside (0) and its median brightness (1)."""

OUTLIER_CM = 0.25
"""Distance from the circle beyond which edges are left out of the fit."""

STEADY_CM = 0.02
"""Movement of the centre below which the fit ends."""

MAX_ROUNDS = 5
"""Largest number of rounds of the fit."""

MIN_CM, MAX_CM = 1.0, 4.2
"""Bounds of the radius while it is fitted."""

RIDGE = 1e-6
"""Weight that keeps the least squares solvable where few directions have an edge."""

_ANGLES = np.arange(BINS) * (2 * np.pi / BINS)
_RADII = np.arange(round(REACH_CM / STEP_CM)) * STEP_CM
_ROUND = np.column_stack([np.ones(BINS), np.cos(_ANGLES), np.sin(_ANGLES)])
_DESIGN = np.column_stack([_ROUND, np.cos(2 * _ANGLES), np.sin(2 * _ANGLES)])


class Fit(NamedTuple):
    """A circle fitted to a ring of light."""

    column: float
    """Column of its centre in the view."""
    row: float
    """Row of its centre in the view."""
    radius_cm: float
    flattening: tuple[float, float]
    """Amplitude of the radius along twice the angle, cosine and sine, relative to the radius: 0 for a circle."""
    misfit_cm: float
    """Root mean square distance of the inner edge from the circle, without edges more than `OUTLIER_CM` off."""
    covered: BoolArray
    """(BINS,) whether there is light on the circle in each direction."""
    light: float
    """Median level on the circle, above that of its inside."""
    inside: float
    """Mean level within half the radius, relative to the median level on the circle."""
    beyond: float
    """Mean level outside of the circle, relative to that on the circle; both above the inside."""


def fit_ring(view: npt.NDArray[np.uint8], cells_per_cm: int, column: float, row: float, least: float) -> Fit | None:
    """Fit a circle to a ring whose centre is within about 1 cm of a cell.

    The inner edge of the light is at r(theta) = R + dx cos(theta) + dy sin(theta), and two terms of twice the angle,
    for a centre that is off by (dx, dy). Least squares over `BINS` directions give them; this is repeated from the new
    centre. The inner edge is used, because other rings that touch the ring shine outside of it.

    Args:
        view: (rows, columns) light on the plane of the rings (see `rectified_view`).
        cells_per_cm: Resolution of the view.
        column: Column of the cell.
        row: Row of the cell.
        least: Minimum median level of a ring above its inside.

    Returns:
        The circle; None if half of the ring is missing or it is too faint.
    """
    radius = epuck.RING_RADIUS_CM
    for _ in range(MAX_ROUNDS):
        profile = _polar(view, cells_per_cm, column, row)
        joined = _join_leds(profile)
        ring = (INSIDE * radius <= _RADII) & (radius + OUTSIDE_CM >= _RADII)
        inside = float(profile[:, max(radius / 2, STEP_CM) >= _RADII].mean())
        bright = float(np.median(joined[:, ring].max(axis=1)))
        if bright - inside < least:
            return None
        edge, has = _edge(joined[:, ring], inside + EDGE * (bright - inside))
        if np.count_nonzero(has) <= BINS / 2:
            return None
        shape, off = _circle(edge + _RADII[ring][0], has)
        column, row = column + shape[1] * cells_per_cm, row + shape[2] * cells_per_cm
        radius = float(shape[0]) + HALF_CM
        if not MIN_CM < radius < MAX_CM:
            return None
        if np.hypot(shape[1], shape[2]) < STEADY_CM:
            break
    outline = _outline(profile, _DESIGN @ shape + HALF_CM, inside + EDGE / 2 * (bright - inside))
    radius = float(outline[0])
    if not MIN_CM < radius < MAX_CM:
        return None
    on = joined[:, np.abs(_RADII - radius) <= ON_CM].max(axis=1)
    bright = float(np.median(on))
    if bright - inside < least:
        return None
    near = off <= OUTLIER_CM
    beyond = (radius + BEYOND_CM[0] <= _RADII) & (radius + BEYOND_CM[1] >= _RADII)
    crest = float(profile[:, np.abs(_RADII - radius) <= ON_CM].mean()) - inside
    return Fit(
        column,
        row,
        radius,
        (float(outline[3] / radius), float(outline[4] / radius)),
        float(np.sqrt(np.mean(off[near] ** 2))) if near.any() else math.inf,
        (on - inside >= MIN_BETWEEN_LEDS * (bright - inside)) & ~(off > OUTLIER_CM),
        bright - inside,
        inside / bright,
        (float(profile[:, beyond].mean()) - inside) / max(crest, 1e-9),
    )


def _polar(view: npt.NDArray[np.uint8], cells_per_cm: int, column: float, row: float) -> Float32Array:
    """Return (BINS, radii) the light along each direction from a cell."""
    flags = cv2.INTER_LINEAR | cv2.WARP_POLAR_LINEAR | cv2.WARP_FILL_OUTLIERS
    size = len(_RADII), BINS
    return np.asarray(cv2.warpPolar(view, size, (column, row), REACH_CM * cells_per_cm, flags), np.float32)


def _join_leds(profile: Float32Array) -> Float32Array:
    """Return (BINS, radii) light whose gaps along the circle are filled from one LED to the next."""
    around = np.concatenate([profile[-LED_BINS:], profile, profile[:LED_BINS]])
    joined = cv2.morphologyEx(around, cv2.MORPH_CLOSE, np.ones((LED_BINS, 1), np.uint8))
    return np.asarray(joined[LED_BINS:-LED_BINS], np.float32)


def _edge(profile: Float32Array, level: float) -> tuple[FloatArray, BoolArray]:
    """Return (BINS,) cm: where (BINS, n) samples first reach a level, from the first sample; and whether they do."""
    above = profile >= level
    first = above.argmax(axis=1)
    rows = np.arange(BINS)
    after, before = profile[rows, first], profile[rows, np.maximum(first - 1, 0)]
    back = np.where(after > before, (after - level) / np.maximum(after - before, 1), 0.0)
    return STEP_CM * (first - back), np.asarray(above.any(axis=1))


def _circle(edge: FloatArray, has: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Fit a circle, and then a flattened one, to the edge of a ring.

    Args:
        edge: (BINS,) cm: distance of the edge in each direction.
        has: (BINS,) whether there is an edge.

    Returns:
        (5,) cm: radius, centre, and amplitudes along twice the angle; (BINS,) cm: distance of the edge from it, NaN
        where there is none.
    """
    near = has
    for terms in (_ROUND, _DESIGN):
        design = terms[near]
        shape = np.linalg.solve(design.T @ design + RIDGE * np.eye(terms.shape[1]), design.T @ edge[near])
        off = np.abs(edge - terms @ shape)
        near = has & (off <= max(OUTLIER_CM, float(np.median(off[has]))))
    return shape, np.where(has, off, np.nan)


def _outline(profile: Float32Array, expected: FloatArray, level: float) -> FloatArray:
    """Fit the middle of the light, which joining gaps would flatten less: the light itself counts, at the LEDs most.

    Args:
        profile: (BINS, radii) light.
        expected: (BINS,) cm: about where it is brightest.
        level: Level below which light does not count.

    Returns:
        (5,) cm: radius, centre, and amplitudes along twice the angle.
    """
    away = _RADII - expected[:, None]
    weights = np.where(np.abs(away) <= OUTSIDE_CM, np.maximum(profile - level, 0.0), 0.0)
    total = weights.sum(axis=1)
    middles = expected + (weights * away).sum(axis=1) / np.maximum(total, RIDGE)
    design = _DESIGN * total[:, None]
    outline: FloatArray = np.linalg.solve(_DESIGN.T @ design + RIDGE * np.eye(5), design.T @ middles)
    return outline
