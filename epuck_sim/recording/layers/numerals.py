"""Numbers drawn as lines, which keep their place beside a picture's rows at any zoom; the viewer's labels do not."""

import numpy as np
import rerun as rr

from epuck_sim.arrays import FloatArray
from epuck_sim.recording.layers.arena import NUMBERS

_STROKES = (
    ((0, 0), (1, 0), (1, 2), (0, 2), (0, 0)),
    ((1, 0), (1, 2)),
    ((0, 0), (1, 0), (1, 1), (0, 1), (0, 2), (1, 2)),
    ((0, 0), (1, 0), (1, 1), (0, 1), (1, 1), (1, 2), (0, 2)),
    ((0, 0), (0, 1), (1, 1), (1, 0), (1, 2)),
    ((1, 0), (0, 0), (0, 1), (1, 1), (1, 2), (0, 2)),
    ((1, 0), (0, 0), (0, 2), (1, 2), (1, 1), (0, 1)),
    ((0, 0), (1, 0), (1, 2)),
    ((0, 0), (1, 0), (1, 2), (0, 2), (0, 1), (1, 1), (0, 1), (0, 0)),
    ((1, 1), (0, 1), (0, 0), (1, 0), (1, 2), (0, 2)),
)
"""Corners of each digit, as on a display of seven segments; y points down."""

SCALE = 0.32
"""Width of a digit, in rows; it is twice as high."""

PITCH = 0.55
"""Distance from one digit to the next, in rows."""

THICKNESS = 0.1
"""Thickness of lines, in rows."""


def row_numbers(rows: int) -> rr.LineStrips2D:
    """Return the numbers of the rows of a picture, to its left, right-aligned."""
    strips = [strip for row in range(rows) for strip in number_strips(row, -PITCH, row + 0.5 - SCALE)]
    return rr.LineStrips2D(strips, radii=THICKNESS / 2, colors=NUMBERS)


def number_strips(number: int, right: float, top: float) -> list[FloatArray]:
    """Return a strip, (corners, 2), for each digit of a number; `right` and `top` are those of its last digit."""
    lefts = right - SCALE - PITCH * np.arange(len(str(number)))[::-1]
    return [
        (left, top) + SCALE * np.array(_STROKES[int(digit)], float)
        for left, digit in zip(lefts, str(number), strict=True)
    ]
