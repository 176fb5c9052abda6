"""Finds the lit rings in a picture of the overhead camera (thesis 4.3.1).

The red light is seen from straight above, without perspective and distortion. A matched filter on a coarse grid says
where there may be a ring; each place is looked at in turn, from the brightest, and counts where a circle of the right
size is lit nearly all round, hollow, and beside the rings found before: robots may touch, but not overlap.
"""

from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.overhead.camera_model import Lens
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.rectified_view import COARSE_PER_CM, Light, ring_plane
from epuck_sim.overhead.track.ring_fit import Fit, fit_ring

LIT_LEVEL = 40
"""Of the median green pixel of 256 levels: a webcam's noise in the dark is far below, and its rings are red."""

SAMPLES = 80
"""Pixels along the shorter side that tell whether the room is lit."""

LEAST_IN_DARK = 40
LEAST_IN_LIGHT = 12
"""Levels by which a ring is brighter than what it encloses, at least. In a lit room its core is nearly white, so that
little of it is red; over a whole ring, noise of 10 levels gives less than 1."""

CORE_CM = 1.0
"""In a lit room the crest of a ring is white, with red on either side: gaps in the red up to so wide are filled."""

SHARE = 0.3
"""A ring has at least this share of the brightest one's light: one lit for less of the exposure may be missed, and
what shines on walls and floor is less."""

APART_CM = 0.88 * 2 * epuck.RADIUS_CM
"""Between two rings' centres, at least: robots touch at 2 radii, and a scale may be wrong by a tenth."""

CROSS_CM = 0.45
"""Standard deviation of the matched filter across the ring, which is about 1 cm thick when over-exposed."""

INNER_CM = 2.3
"""Within so much of the centre a ring is dark."""

RADII = (0.75, 1.15)
"""A ring's radius over `epuck.RING_RADIUS_CM`, at least and at most: perspective and scale are estimates, and in a lit
room a ring looks smaller, as its outer side is pale."""

LARGER = 1.12
"""A ring's radius over the mean of those found before, at most: faint ones look a little larger, and what six lit
rings enclose is larger by a sixth."""

MISFIT_CM = 0.2
"""Root mean square distance of the light's inner edge from the circle, at most: 0.04 cm in usual pictures."""

COVERED = 0.85
"""Share of the directions in which a ring is lit, at least. Around an unlit robot that six lit ones touch it is less
than two thirds."""

HOLLOW = 0.5
"""The light within half a ring's radius, over that on it, at most."""


class Ring(NamedTuple):
    """A lit ring, in the arena's frame and in the picture."""

    x_cm: float
    y_cm: float
    """Of its centre, in the arena's frame."""
    radius_cm: float
    x_px: float
    y_px: float
    radius_px: float


def is_lit(picture: Picture) -> bool:
    """Return whether the room's lights are on: by the middle of the picture, as the table around may be black."""
    rows, columns, _ = picture.shape
    step = max(min(rows, columns) // SAMPLES, 1)
    middle = picture[rows // 4 : rows - rows // 4 : step, columns // 4 : columns - columns // 4 : step, 1]
    return float(np.median(middle)) >= LIT_LEVEL


def ring_light(picture: Picture, lit: bool) -> Light:
    """Return (height_px, width_px) how bright the rings' light is: red, or in a lit room what is redder than grey."""
    red = cv2.extractChannel(picture, 0)
    if lit:
        red = cv2.subtract(red, cv2.max(cv2.extractChannel(picture, 1), cv2.extractChannel(picture, 2)))
    return np.asarray(red, np.uint8)


class RingFinder:
    """Finds rings in the pictures of one camera."""

    def __init__(self, lens: Lens) -> None:
        self._lens = lens
        self._plane = ring_plane(lens)
        self._filter = _matched_filter()

    def find(self, picture: Picture) -> list[Ring]:
        """Return the lit rings in (height_px, width_px, 3) of the lens's size, from left to right in the picture.

        Raises ValueError for a picture of another size.
        """
        lens = self._lens
        if picture.shape != (lens.height_px, lens.width_px, 3):
            raise ValueError(f"a picture is {picture.shape}, but the lens's is {(lens.height_px, lens.width_px, 3)}")
        lit = is_lit(picture)
        least = float(LEAST_IN_LIGHT if lit else LEAST_IN_DARK)
        light = ring_light(picture, lit)
        if cv2.minMaxLoc(light)[1] < least:
            return []
        plane = self._plane.seen(light)
        if lit:
            plane = self._plane.closed(plane, CORE_CM)
        response = np.asarray(cv2.filter2D(self._plane.coarse(plane), cv2.CV_32F, self._filter), np.float32)
        least = max(least, SHARE * float(response.max()))
        cells = self._plane.cells_per_cm
        coarse = cells // COARSE_PER_CM
        places = _peaks(response, least) * coarse + (coarse - 1) / 2
        return self._rings(_separate(plane, cells, places, least))

    def _rings(self, fits: list[Fit]) -> list[Ring]:
        """Return fits in the arena and in the picture, from left to right."""
        if not fits:
            return []
        centres = np.array([(*self._plane.position_cm(fit.column, fit.row), epuck.RING_HEIGHT_CM) for fit in fits])
        around = np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
        radii = np.array([fit.radius_cm for fit in fits])
        pixels = self._lens.pixels((centres[:, None] + radii[:, None, None] * around).reshape(-1, 3)).reshape(-1, 5, 2)
        radii_px = np.linalg.norm(pixels[:, 1:] - pixels[:, :1], axis=2).mean(axis=1)
        table = np.column_stack([centres[:, :2], radii, pixels[:, 0], radii_px])
        return [Ring(*row) for row in table[np.lexsort((table[:, 4], table[:, 3]))].tolist()]


def _matched_filter() -> Float32Array:
    """Return the filter on the coarse grid: mean light on the circle minus that inside."""
    half = round((epuck.RING_RADIUS_CM + 2 * CROSS_CM) * COARSE_PER_CM)
    offsets = np.arange(-half, half + 1) / COARSE_PER_CM
    radius = np.hypot(offsets[:, None], offsets)
    ring = np.exp(-(((radius - epuck.RING_RADIUS_CM) / CROSS_CM) ** 2) / 2)
    inner = (radius <= INNER_CM).astype(float)
    return np.asarray(ring / ring.sum() - inner / inner.sum(), np.float32)


def _peaks(response: Float32Array, least: float) -> FloatArray:
    """Return (n, 2) columns and rows of the highest responses within 1 cm, from the highest."""
    size = 2 * COARSE_PER_CM + 1
    highest = np.asarray(cv2.dilate(response, np.ones((size, size), np.uint8)))
    rows, columns = np.nonzero((response >= highest) & (response >= least))
    order = np.argsort(-response[rows, columns], kind="stable")
    return np.column_stack([columns[order], rows[order]]).astype(float)


def _separate(plane: Light, cells_per_cm: int, places: FloatArray, least: float) -> list[Fit]:
    """Return the rings at (n, 2) places of the plane, which are looked at in this order."""
    fits: list[Fit] = []
    for column, row in places:
        if _is_free(column, row, fits, cells_per_cm):
            fit = fit_ring(plane, cells_per_cm, column, row, least)
            if fit is not None and _is_ring(fit) and _is_new(fit, fits, cells_per_cm):
                fits.append(fit)
    return fits


def _is_ring(fit: Fit) -> bool:
    """Return whether a fit is round, hollow and whole."""
    return bool(
        RADII[0] <= fit.radius_cm / epuck.RING_RADIUS_CM <= RADII[1]
        and fit.misfit_cm <= MISFIT_CM
        and fit.hollow <= HOLLOW
        and fit.covered.mean() >= COVERED
    )


def _is_new(fit: Fit, found: list[Fit], cells_per_cm: int) -> bool:
    """Return whether a fit is a ring beside those found, and not what they enclose."""
    if not found:
        return True
    is_as_large = fit.radius_cm <= LARGER * np.mean([other.radius_cm for other in found])
    return bool(is_as_large) and _is_free(fit.column, fit.row, found, cells_per_cm)


def _is_free(column: float, row: float, found: list[Fit], cells_per_cm: int) -> bool:
    """Return whether a robot may stand there beside those found."""
    apart = APART_CM * cells_per_cm
    return all((column - other.column) ** 2 + (row - other.row) ** 2 >= apart * apart for other in found)
