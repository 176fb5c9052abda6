"""The light of rings in a picture: apart from the room's light, and how much of the floor it covers."""

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray
from epuck_sim.overhead.camera import Frame, Geometry, Light, Picture

LIT_LEVEL = 40  # median level of a picture's darkest colour from which the room is lit: haze of rings is coloured
LIT_SAMPLES = 80  # pixels along the shorter side that are examined for whether the room is lit
LEAST_LIGHT = 12  # level from which a pixel shows light; noise in the dark hardly reaches it
RISE_PER_S = 10.0  # levels by which the background follows light that stays; a flash of half a second adds 5 of 255
SMOOTH_PX = 3  # side of the square over which noise is averaged
SAMPLED = 4  # distance of the counted pixels of a row, or of a column, from which its usual light is measured
SPARSE = 8  # distance of the pixels, across and down, by which the usual level of the background is measured
SAMPLED_LINES = 240  # rows and columns of a picture, about, in which lit pixels are counted


def is_lit(picture: Picture) -> bool:
    """Return whether the room's lights are on, judged by the picture's middle; the table around may be black."""
    rows, columns, _ = picture.shape
    step = max(min(rows, columns) // LIT_SAMPLES, 1)
    middle = picture[rows // 4 : rows - rows // 4 : step, columns // 4 : columns - columns // 4 : step]
    red, green, blue = np.moveaxis(middle, -1, 0)
    return median(np.minimum(np.minimum(red, green), blue)) >= LIT_LEVEL


def median(levels: npt.NDArray[np.uint8]) -> float:
    """Return the median of some levels, for which NumPy's function takes several times as long."""
    below, above = (levels.size - 1) // 2, levels.size // 2
    ordered = np.partition(levels, (below, above), axis=None)
    return (float(ordered[below]) + float(ordered[above])) / 2


def ring_light(picture: Picture) -> tuple[Light, bool]:
    """Return the light of rings in a picture, and whether the room is lit.

    It is the mean of the colours: a ring that burns out in one still has its shape in the others. In a lit room it is
    their difference: grey things are no rings.
    """
    red, green, blue = cv2.split(picture)
    if is_lit(picture):
        most, least = (combine(combine(red, green), blue) for combine in (cv2.max, cv2.min))
        return np.asarray(cv2.subtract(most, least), np.uint8), True
    mean = cv2.addWeighted(cv2.addWeighted(red, 1 / 2, green, 1 / 2, 0), 2 / 3, blue, 1 / 3, 0)
    return np.asarray(mean, np.uint8), False


class Background:
    """Learns the background of the dark frames of a film: the least light of each pixel, which rises slowly.

    What goes off leaves the background at once, what goes on joins it within half a minute.
    """

    def __init__(self, levels: Light | None = None) -> None:
        """Begin with what is known of it."""
        self.levels = levels
        self._rise = self._last_s = 0.0

    def light_beyond(self, frame: Frame) -> tuple[Light, bool]:
        """Learn from the next frame; return the light of its rings, and whether the room is lit, without background."""
        light, room_is_lit = ring_light(frame.picture)
        if room_is_lit:
            return light, True
        levels = np.zeros_like(light) if self.levels is None else self.levels
        self._rise += RISE_PER_S * min(max(frame.time_s - self._last_s, 0.0), 1.0)
        self._last_s = frame.time_s
        whole = int(self._rise)
        self._rise -= whole
        self.levels = np.asarray(cv2.min(cv2.convertScaleAbs(levels, beta=whole), light), np.uint8)
        return np.asarray(cv2.subtract(light, self.levels), np.uint8), False

    def usual(self) -> float:
        """Return its median level, to which the even light of a room is near; 0 if there is no background yet."""
        return 0.0 if self.levels is None else median(self.levels[::SPARSE, ::SPARSE])


class LightMeter:
    """Measures the lit area in pictures of one camera."""

    def __init__(self, geometry: Geometry) -> None:
        camera = geometry.camera
        self._step = max(min(camera.width_px, camera.height_px) // SAMPLED_LINES, 1)
        floor = np.ones((camera.height_px, camera.width_px), np.uint8)
        if geometry.knows_floor:
            floor[:] = 0
            cv2.fillPoly(floor, [np.round(geometry.floor_outline_px()).astype(np.int32)], (1,))
        self._floor = floor[:: self._step, :: self._step] > 0

    def lit_px(self, levels: Light, background: Light | None = None, usual: float = 0.0) -> int:
        """Return about how many of (height_px, width_px) levels on the floor, or anywhere if it is not known, are lit.

        Lamps that flicker do not count. Those that light the room raise whole rows where a camera exposes one row after
        the other, whole columns if the film is turned, and else all pixels. Those in the picture, and screens, shine by
        less than twice their least light, by which the background exceeds its usual level.
        """
        if cv2.minMaxLoc(levels)[1] < LEAST_LIGHT:
            return 0
        light = np.asarray(cv2.blur(levels, (SMOOTH_PX, SMOOTH_PX)), np.uint8)[:: self._step, :: self._step]
        beyond = _beyond_usual(light, self._floor)
        beyond = _beyond_usual(beyond.T, self._floor.T).T
        is_light = (beyond >= LEAST_LIGHT) & self._floor
        if background is not None:
            is_light &= beyond + usual >= background[:: self._step, :: self._step]
        return self._step**2 * int(np.count_nonzero(is_light))

    def share(self, levels: Light, least: float) -> float:
        """Return the share of the floor, or of the picture if it is not known, that has such a level or more."""
        bright = levels[:: self._step, :: self._step] >= least
        return float(np.mean(bright[self._floor]))


def _beyond_usual(light: Light, floor: BoolArray) -> Light:
    """Return (rows, columns) the light beyond the median of the floor in its row."""
    sampled = floor[:, ::SAMPLED]
    ascending = np.sort(np.where(sampled, light[:, ::SAMPLED], 255), axis=1, kind="stable")  # by radix
    usual = ascending[np.arange(len(light)), np.count_nonzero(sampled, axis=1) // 2]
    return np.asarray(np.maximum(light, usual[:, None]) - usual[:, None], np.uint8)
