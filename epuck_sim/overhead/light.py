"""The light of rings in a picture: apart from the room's light, and how much of the floor it covers."""

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim.overhead.camera import Geometry
from epuck_sim.overhead.frame import Frame, Picture

Light = npt.NDArray[np.uint8]
"""(rows, columns) one channel of a picture or of the rectified view."""

LIT_LEVEL = 40
"""Median level of a picture's darkest colour from which the room is lit; noise in the dark is far below, and the haze
of rings is coloured."""

LIT_SAMPLES = 80  # pixels along the shorter side that are examined for whether the room is lit
LEAST_LIGHT = 12  # level from which a pixel shows light; noise in the dark hardly reaches it
RISE_PER_S = 10.0  # levels by which the background follows light that stays; a flash of half a second adds 5 of 255
SMOOTH_PX = 3  # side of the square over which noise is averaged
SAMPLED_PX = 4  # distance of the pixels of a row, or of a column, from which its usual light is measured
MEAN = np.full((1, 3), 1 / 3)  # weights of red, green and blue in the light of rings in the dark


class RingLight(NamedTuple):
    """What a picture has of the light of rings."""

    levels: Light
    """(height_px, width_px) levels, without the background."""
    room_is_lit: bool


def is_lit(picture: Picture) -> bool:
    """Return whether the room's lights are on, judged by the picture's middle; the table around may be black."""
    rows, columns, _ = picture.shape
    step = max(min(rows, columns) // LIT_SAMPLES, 1)
    middle = picture[rows // 4 : rows - rows // 4 : step, columns // 4 : columns - columns // 4 : step]
    return float(np.median(middle.min(axis=2))) >= LIT_LEVEL


def ring_light(picture: Picture, background: Picture | None = None) -> RingLight:
    """Return the light of rings in a picture: the mean of the colours, or in a lit room their difference.

    A ring that burns out in one colour still has its shape in the others. In a lit room, grey things are no rings.

    Args:
        picture: (height_px, width_px, 3) levels.
        background: The same without rings, in the dark.
    """
    if is_lit(picture):
        red, green, blue = cv2.split(picture)
        most, least = (combine(combine(red, green), blue) for combine in (cv2.max, cv2.min))
        return RingLight(np.asarray(cv2.subtract(most, least), np.uint8), True)
    if background is not None:
        picture = np.asarray(cv2.subtract(picture, background), np.uint8)
    return RingLight(np.asarray(cv2.transform(picture, MEAN), np.uint8), False)


class Background:
    """Learns the background of the dark frames of a film: the least light of each pixel, which rises slowly.

    What goes off leaves the background at once, what goes on joins it within half a minute.
    """

    picture: Picture | None
    """The background so far."""

    def __init__(self, picture: Picture | None = None) -> None:
        """Begin with what is known of it."""
        self.picture = picture
        self._rise = self._last_s = 0.0

    def update(self, frame: Frame) -> Picture | None:
        """Learn from the next frame, and return the background to subtract from it; None in a lit room."""
        if is_lit(frame.picture):
            return None
        if self.picture is None:
            self.picture = np.zeros_like(frame.picture)
        self._rise += RISE_PER_S * min(max(frame.time_s - self._last_s, 0.0), 1.0)
        self._last_s = frame.time_s
        whole = int(self._rise)
        self._rise -= whole
        risen = cv2.add(self.picture, np.full(3, whole, np.float64)) if whole else self.picture
        self.picture = np.asarray(cv2.min(risen, frame.picture), np.uint8)
        return self.picture


class LightMeter:
    """Measures the lit area in pictures of one camera."""

    def __init__(self, geometry: Geometry) -> None:
        camera = geometry.camera
        self._floor: Light | None = None
        if geometry.knows_floor:
            self._floor = np.zeros((camera.height_px, camera.width_px), np.uint8)
            cv2.fillPoly(self._floor, [np.round(geometry.floor_outline_px()).astype(np.int32)], (1,))

    def lit_px(self, levels: Light) -> int:
        """Return how many pixels of the floor are lit; of the whole picture, if the floor is not known.

        Lamps that flicker do not count: they raise whole rows where a camera exposes one row after the other, whole
        columns if the film is turned, and else all pixels.

        Args:
            levels: (height_px, width_px) the light of rings.
        """
        light = np.asarray(cv2.blur(levels, (SMOOTH_PX, SMOOTH_PX)), np.uint8)
        floor = np.ones_like(light) if self._floor is None else self._floor
        beyond = _beyond_usual(light, floor)
        beyond = _beyond_usual(beyond.T, floor.T).T
        return int(np.count_nonzero((beyond >= LEAST_LIGHT) & (floor > 0)))


def _beyond_usual(light: Light, floor: Light) -> Light:
    """Return (rows, columns) the light beyond the median of the floor in its row."""
    sample, is_floor = light[:, ::SAMPLED_PX], floor[:, ::SAMPLED_PX] > 0
    ascending = np.sort(np.where(is_floor, sample, 255), axis=1)
    usual = ascending[np.arange(len(light)), np.count_nonzero(is_floor, axis=1) // 2]
    return np.asarray(np.maximum(light, usual[:, None]) - usual[:, None], np.uint8)
