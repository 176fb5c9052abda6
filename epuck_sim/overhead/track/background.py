"""What of a film's light is there all the time: lamps, windows, a floor that is not quite dark, robots in dim light."""

import cv2
import numpy as np

from epuck_sim.overhead.film.frame import Frame, Picture
from epuck_sim.overhead.track.ring_detection import is_lit

RISE_PER_S = 10.0
"""Levels per second by which the background follows light that stays; a flash of half a second adds 5 of 255."""


class Background:
    """Learns the background of the dark frames of a film: the least light of each pixel, which rises slowly.

    What goes off leaves the background at once, what goes on joins it within half a minute.
    """

    picture: Picture | None
    """The background so far."""

    def __init__(self, picture: Picture | None = None) -> None:
        """Begin with what is known of it."""
        self.picture = picture
        self._rise = 0.0
        self._last_s = 0.0

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
