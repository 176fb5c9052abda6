"""Finds the lit rings in a picture of the overhead camera (thesis 4.3.1).

The light is rectified to a view from straight above. A matched filter on a coarse grid finds candidates. From the
brightest on, each candidate is a ring if a circle of the right size is lit nearly all round, is hollow, and does not
overlap the rings found before: robots may touch, but not overlap.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.light import Light, RingLight, ring_light_of
from epuck_sim.overhead.track.rectified_view import rectified_view
from epuck_sim.overhead.track.ring_fit import Fit, fit_ring

MIN_LEVEL_DARK = 8
"""Minimum levels by which a ring in the dark is brighter than its inside, at its eight points."""

POINTS_SHARE = 0.25
"""Minimum mean light along a ring, relative to that at its eight points: in a short exposure it is dark between."""

MIN_LEVEL_LIT = 12
"""Minimum levels by which a ring in a lit room is more coloured than its inside. Its core is nearly white there;
averaged over a whole ring, noise of 10 levels gives less than 1."""

CORE_CM = 1.0
"""Width of gaps in the colour that are filled in a lit room, where a ring is white with colour on either side."""

MIN_RELATIVE_LIGHT = 0.25
"""Minimum light of a ring, relative to the brightest one. A ring lit for less of the exposure may be missed;
reflections on walls and floor are weaker."""

MIN_DISTANCE_CM = 0.88 * 2 * epuck.RADIUS_CM
"""Minimum distance of two rings' centres: robots touch at 2 radii, and the scale may be wrong by a tenth."""

MIN_RADIUS = 0.75
"""Minimum radius of a ring, relative to `epuck.RING_RADIUS_CM`: perspective and scale are estimates, and in a lit room
a ring looks smaller, because its outer side is pale."""

MAX_RADIUS = 1.2
"""Maximum radius of a ring, relative to `epuck.RING_RADIUS_CM`."""

MAX_RELATIVE_RADIUS = 1.12
"""Maximum radius of a ring, relative to the mean of those found before. Faint rings look slightly larger; what six lit
rings enclose is larger by a sixth."""

MAX_FLATTENING = 0.25
"""Maximum flattening of a ring, relative to its radius: the lens and the tilt are estimates, too."""

MAX_MISFIT_CM = 0.2
"""Maximum root mean square distance of the light's inner edge from the circle; 0.04 cm in usual pictures."""

MIN_COVERED = 0.85
"""Minimum fraction of the directions in which a ring is lit."""

MAX_INSIDE = 0.9
"""Maximum light within half a ring's radius, relative to the light on the ring; a webcam burns rings out."""

MAX_BEYOND = 0.85
"""Maximum light outside of a ring, relative to that on it. Around an unlit robot, be it in a lit room or
between six lit ones, light grows outwards."""

MAX_BEYOND_LIT = 1.5
"""The same in a lit room, where the haze of a ring is coloured and its core is pale; grey things have no colour."""


class Ring(NamedTuple):
    """Centre and radius of a lit ring: in cm in the arena's frame, and in px (column, row)."""

    x_cm: float
    y_cm: float
    radius_cm: float
    x_px: float
    y_px: float
    radius_px: float
    light: float = 0.0
    """Levels by which the ring is brighter than its inside."""


class RingFinder:
    """Finds rings in the pictures of one camera."""

    def __init__(self, camera: CameraModel, usual_light: float = 0.0) -> None:
        """Prepare what all pictures share.

        Args:
            camera: The camera.
            usual_light: Levels by which rings in the dark are brighter than their inside, if it is known.
        """
        self.camera = camera
        self._least_dark = max(MIN_LEVEL_DARK, MIN_RELATIVE_LIGHT * usual_light)
        self.view = rectified_view(camera)

    def find(self, picture: Picture, background: Picture | None = None) -> list[Ring]:
        """Return the lit rings in a picture, from left to right.

        Args:
            picture: (height_px, width_px, 3) levels.
            background: The same without rings, in the dark.

        Raises:
            ValueError: The picture's size is not the camera's.
        """
        return self.find_in(ring_light_of(picture, background))

    def find_in(self, ring_light: RingLight) -> list[Ring]:
        """Return the lit rings in the light of a picture; see `find`."""
        return self._rings(self.fits(ring_light))

    def fits(self, ring_light: RingLight) -> list[Fit]:
        """Return circles fitted to the rings in the light of a picture, in its rectified view, brightest first."""
        camera, (light, lit) = self.camera, ring_light
        if light.shape != (camera.height_px, camera.width_px):
            raise ValueError(f"a picture of {light.shape}; allowed: {(camera.height_px, camera.width_px)}")
        least = float(MIN_LEVEL_LIT) if lit else self._least_dark
        if cv2.minMaxLoc(light)[1] < least:
            return []
        view = self.view.sample(light)
        if lit:
            view = self.view.close_gaps(view, CORE_CM)
        response = self.view.match(view)
        bright = float(response.max())
        mean_least = max(least if lit else POINTS_SHARE * least, MIN_RELATIVE_LIGHT * bright)
        candidates = self.view.candidates(response, mean_least)
        most_beyond = MAX_BEYOND_LIT if lit else MAX_BEYOND
        return _select_rings(view, self.view.cells_per_cm, candidates, max(least, mean_least), most_beyond)

    def _rings(self, fits: list[Fit]) -> list[Ring]:
        """Return fits as rings, with their places in the arena and in the picture, from left to right."""
        if not fits:
            return []
        centres = np.array([(*self.view.position_cm(fit.column, fit.row), epuck.RING_HEIGHT_CM) for fit in fits])
        around = np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
        radii = np.array([fit.radius_cm for fit in fits])
        pixels = self.camera.project((centres[:, None] + radii[:, None, None] * around).reshape(-1, 3)).reshape(
            -1, 5, 2
        )
        radii_px = np.linalg.norm(pixels[:, 1:] - pixels[:, :1], axis=2).mean(axis=1)
        table = np.column_stack([centres[:, :2], radii, pixels[:, 0], radii_px, [fit.light for fit in fits]])
        return [Ring(*row) for row in table[np.lexsort((table[:, 4], table[:, 3]))].tolist()]


def _select_rings(
    view: Light, cells_per_cm: int, candidates: FloatArray, least: float, most_beyond: float
) -> list[Fit]:
    """Return the rings among (n, 2) candidates, cells of the view that are examined in this order."""
    fits: list[Fit] = []
    for column, row in candidates:
        if _is_free(column, row, fits, cells_per_cm):
            fit = fit_ring(view, cells_per_cm, column, row, least)
            if fit is not None and _is_ring(fit, most_beyond) and _is_new(fit, fits, cells_per_cm):
                fits.append(fit)
    return fits


def _is_ring(fit: Fit, most_beyond: float) -> bool:
    """Return whether a fit is round, hollow and whole."""
    return bool(
        MIN_RADIUS <= fit.radius_cm / epuck.RING_RADIUS_CM <= MAX_RADIUS
        and fit.misfit_cm <= MAX_MISFIT_CM
        and math.hypot(*fit.flattening) <= MAX_FLATTENING
        and fit.inside <= MAX_INSIDE
        and fit.beyond <= most_beyond
        and fit.covered.mean() >= MIN_COVERED
    )


def _is_new(fit: Fit, found: list[Fit], cells_per_cm: int) -> bool:
    """Return whether a fit is a ring beside those found, and not the space that they enclose."""
    if not found:
        return True
    is_as_large = fit.radius_cm <= MAX_RELATIVE_RADIUS * np.mean([other.radius_cm for other in found])
    return bool(is_as_large) and _is_free(fit.column, fit.row, found, cells_per_cm)


def _is_free(column: float, row: float, found: list[Fit], cells_per_cm: int) -> bool:
    """Return whether a robot may stand at a cell without overlapping those found."""
    distance = MIN_DISTANCE_CM * cells_per_cm
    return all((column - other.column) ** 2 + (row - other.row) ** 2 >= distance * distance for other in found)
