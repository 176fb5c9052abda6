"""The caption of films in the light: clock, cycle and order parameter."""

from bisect import bisect_right
from collections import deque

import cv2

from epuck_sim.overhead.film.frame import Frame, Picture
from epuck_sim.overhead.render.virtual_camera import TIME_TOLERANCE_S

HEIGHT_SHARE = 0.03
"""Height of capital letters, as a share of the picture's height."""

CAPITAL_PX = 21
"""Height of capital letters at OpenCV's scale 1, in pixels."""


class Captions:
    """Writes into each frame what the trial had come to when its exposure began."""

    def __init__(self, start_s: float) -> None:
        """Begin the clock at `start_s`, the time on the film's clock at which robots start."""
        self._start_s = start_s
        self._states: deque[tuple[float, int, float | None]] = deque([(0.0, 0, None)])

    def add(self, time_s: float, cycles: int, order_parameter: float | None) -> None:
        """Add the state of the trial from `time_s` on; times rise."""
        self._states.append((time_s, cycles, order_parameter))

    def write(self, frame: Frame) -> Frame:
        """Return a frame with its caption; frames come in the order of their times."""
        time_s = max(0.0, frame.time_s - self._start_s)
        begun = bisect_right(self._states, time_s + TIME_TOLERANCE_S, key=lambda state: state[0])
        for _ in range(begun - 1):
            self._states.popleft()
        _, cycles, order_parameter = self._states[0]
        return frame._replace(picture=_write(frame.picture, caption(time_s, cycles, order_parameter)))


def caption(time_s: float, cycles: int, order_parameter: float | None) -> str:
    """Return the caption: time alone until an order parameter is measured.

    >>> caption(3.25, 0, None), caption(61, 12, 0.8)
    ('3.2 s', '61.0 s   cycle 12   order parameter 0.80')
    """
    clock = f"{time_s:.1f} s"
    return clock if order_parameter is None else f"{clock}   cycle {cycles}   order parameter {order_parameter:.2f}"


def _write(picture: Picture, text: str) -> Picture:
    """Return a copy of a picture with white letters, edged in black, in its upper left corner."""
    written = picture.copy()
    letter_px = HEIGHT_SHARE * len(picture)
    left, base, edge_px = round(letter_px / 2), round(1.6 * letter_px), max(1, round(letter_px / 8))
    around = [(x, y) for x in (-edge_px, 0, edge_px) for y in (-edge_px, 0, edge_px) if x or y]
    for x, y in (*around, (0, 0)):  # thicker letters would also be wider
        grey = (0, 0, 0) if x or y else (255, 255, 255)
        place = (left + x, base + y)
        cv2.putText(written, text, place, cv2.FONT_HERSHEY_SIMPLEX, letter_px / CAPITAL_PX, grey, 1, cv2.LINE_AA)
    return written
