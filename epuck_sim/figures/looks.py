"""How lines look: colours and markers that tell them apart."""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray

COLOURS = ("#002dc3", "#ff5a00", "#690f00", "#1e96ff", "#c300a5", "#87784b", "#d27896", "#3c2d4b")
"""Colours of curves, without a green. A search found them: each has a contrast of at least 3 with white, and any two
are at least 26 apart in CIELAB, also as people without one kind of cones see them (Machado et al. 2009)."""

MARKERS = ("o", "s", "D", ">", "P", "<", "p", "*")
"""Markers of curves; triangles that point up and down, and crosses, have meanings of their own."""

MARKER_DISTANCE, MARKER_SHIFT = 0.2, 0.03
"""Distance from one marker of a line to the next, and from those of one line to those of the next, relative to the
panel's diagonal."""


class Look(NamedTuple):
    """How a curve looks."""

    colour: str
    marker: str


def choose_looks(count: int) -> list[Look]:
    """Return the looks of curves; up to 64 all differ, in the colour, the marker or both.

    >>> choose_looks(9)[0] == choose_looks(9)[8]
    False
    """
    rounds = [divmod(number, len(COLOURS)) for number in range(count)]
    return [Look(COLOURS[place], MARKERS[(place + past) % len(MARKERS)]) for past, place in rounds]


def space_markers(values: FloatArray, place: int) -> tuple[float, float] | None:
    """Return matplotlib's `markevery` for a line over time: few markers, which no two lines have at one place.

    Args:
        values: (n,) values of the line.
        place: Number of the line.
    """
    if not np.isfinite(values).any():
        return None  # matplotlib cannot space markers on a line without any point
    return place * MARKER_SHIFT, MARKER_DISTANCE
