"""Fits a circle to a ring of light, and tells what speaks for it."""

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray

BINS = 72
"""Directions in which a ring is looked at: nine for each of its LEDs."""

STEP_CM = 0.125
REACH_CM = 5.0
"""Each direction is sampled so densely and so far from the centre."""

INSIDE = 0.5
OUTSIDE_CM = 1.0
"""The ring's light begins beyond this share of its radius and ends so far outside of it, wherever the fit starts."""

EDGE_FAINT = 0.4
EDGE_FULL = 0.75
"""Shares of a ring's median brightness that are its edge, of a faint one and of one as bright as a picture can hold:
what lies between the LEDs of a faint ring must count, but not the haze of an over-exposed one and its neighbours."""

HALF_CM = 0.55
"""From the inner edge of an over-exposed ring to its crest. In a lit room it is 0.1 cm more, of a faint ring 0.3 less:
radii are wrong by so much, centres are not."""

ON_CM = 0.25
"""Light so near to a circle shines on it."""

DARKEST = 0.35
"""Between two LEDs a ring has at least this share of its median brightness; a haze has less."""

BEND_CM = 0.25
"""Edges farther from the circle than this bend the fit no more."""

STEADY_CM = 0.02
ROUNDS = 5
"""A fit ends when the centre moves by less than this, or after so many."""

_ANGLES = np.arange(BINS) * (2 * np.pi / BINS)
_RADII = np.arange(round(REACH_CM / STEP_CM)) * STEP_CM
_DESIGN = np.column_stack([np.ones(BINS), np.cos(_ANGLES), np.sin(_ANGLES)])


class Fit(NamedTuple):
    """A circle through a ring of light; its centre in columns and rows of the plane."""

    column: float
    row: float
    radius_cm: float
    misfit_cm: float
    """Root mean square distance of the inner edge from a circle, without what is `BEND_CM` off."""
    covered: BoolArray
    """(BINS,) whether there is light on the circle in each direction."""
    hollow: float
    """Mean light within half the radius, over the median on the circle."""


def fit_ring(plane: npt.NDArray[np.uint8], cells_per_cm: int, column: float, row: float, least: float) -> Fit | None:
    """Return the circle near a ring whose centre is within about 1 cm of a cell; None where half of it is missing.

    plane: light on the plane of the rings (see `ring_plane`); least: median level of a ring. The inner edge of the
    light is at r(theta) = R + dx cos(theta) + dy sin(theta) for a centre that is off by (dx, dy): least squares over
    `BINS` directions, repeated from the new centre. The inner edge, as what touches a ring shines outside of it.
    """
    radius = epuck.RING_RADIUS_CM
    for _ in range(ROUNDS):
        profile = _polar(plane, cells_per_cm, column, row)
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
    hollow = float(profile[:, radius / 2 > _RADII].mean()) / bright
    near = off <= BEND_CM
    misfit = float(np.sqrt(np.mean(off[near] ** 2))) if near.any() else math.inf
    return Fit(column, row, radius, misfit, (on >= DARKEST * bright) & ~(off > BEND_CM), hollow)


def _polar(plane: npt.NDArray[np.uint8], cells_per_cm: int, column: float, row: float) -> Float32Array:
    """Return (BINS, radii) light in each direction from a cell."""
    flags = cv2.INTER_LINEAR | cv2.WARP_POLAR_LINEAR | cv2.WARP_FILL_OUTLIERS
    size = len(_RADII), BINS
    return np.asarray(cv2.warpPolar(plane, size, (column, row), REACH_CM * cells_per_cm, flags), np.float32)


def _edge(profile: Float32Array, level: float) -> tuple[FloatArray, BoolArray]:
    """Return (BINS,) cm from the first of (BINS, n) samples to where the level is reached, and whether it is."""
    above = profile >= level
    first = above.argmax(axis=1)
    rows = np.arange(BINS)
    after, before = profile[rows, first], profile[rows, np.maximum(first - 1, 0)]
    back = np.where(after > before, (after - level) / np.maximum(after - before, 1), 0.0)
    return STEP_CM * (first - back), np.asarray(above.any(axis=1))


def _circle(edge: FloatArray, has: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return (3,) cm R, dx, dy of the circle through (BINS,) cm of an edge, and how far off that is, NaN without it."""
    near = has
    for _ in range(2):
        design = _DESIGN[near]
        circle = np.linalg.solve(design.T @ design, design.T @ edge[near])
        off = np.abs(edge - _DESIGN @ circle)
        near = has & (off <= max(BEND_CM, float(np.median(off[has]))))
    return circle, np.where(has, off, np.nan)
