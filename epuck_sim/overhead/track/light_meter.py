"""Measures how much of the floor is lit, which needs neither the shape nor the size of rings."""

import cv2
import numpy as np

from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.geometry import Geometry
from epuck_sim.overhead.track.ring_detection import MIN_LEVEL_LIT, is_lit, ring_light

LIT_LEVEL = MIN_LEVEL_LIT
"""Level of a pixel from which it is lit, once the noise is averaged over its neighbours."""

SMOOTH_PX = 3
"""Side of the square over which noise is averaged."""

SAMPLED_PX = 4
"""Distance of the pixels from which the usual light of the floor is known: lamps that flicker raise all of them."""


class LightMeter:
    """Measures the lit area in pictures of one camera."""

    def __init__(self, geometry: Geometry) -> None:
        camera = geometry.camera
        self._floor: Picture | None = None
        if geometry.knows_floor:
            self._floor = np.zeros((camera.height_px, camera.width_px), np.uint8)
            cv2.fillPoly(self._floor, [np.round(geometry.floor_outline_px()).astype(np.int32)], (1,))

    def lit_px(self, picture: Picture, background: Picture | None) -> int:
        """Return how many pixels of the floor are lit; of the whole picture, if the floor is not known.

        Args:
            picture: (height_px, width_px, 3) levels.
            background: The same without rings, in the dark.
        """
        lit = is_lit(picture)
        without = picture if lit or background is None else np.asarray(cv2.subtract(picture, background), np.uint8)
        light = cv2.blur(ring_light(without, lit), (SMOOTH_PX, SMOOTH_PX))
        sample = light[::SAMPLED_PX, ::SAMPLED_PX]
        if self._floor is not None:
            sample = sample[self._floor[::SAMPLED_PX, ::SAMPLED_PX] > 0]
            light = cv2.multiply(light, self._floor)
        usual = float(np.median(sample)) if sample.size else 0.0
        return int(cv2.countNonZero(cv2.threshold(light, usual + LIT_LEVEL - 1, 1, cv2.THRESH_BINARY)[1]))
