"""Fits one side of the arena's floor in a picture of the lit room, to a fraction of a pixel."""

from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim.arrays import BoolArray, Float32Array, FloatArray

BAND = 0.15
"""Largest relative difference of the floor from its own smooth shade; walls and robots differ by more."""

PROBES = 160
"""Number of places along each side at which the edge is searched."""

PROBE_STEP_PX = 0.25
"""Distance of samples across the side at each place."""

BEYOND_PX = 3.0
"""Distance from the end of the floor at which its blur has ended, too."""

MAX_OFF_LINE_PX = 3.0
"""Distance from the first line beyond which edges are left out; they belong to robots that stand at the wall."""

MAX_OFF_PARABOLA_PX = 1.0
"""Distance from the fitted parabola beyond which edges are left out."""

MIN_FOUND = 0.4
"""Minimum fraction of the places along a side at which its edge is on the curve."""


class Side(NamedTuple):
    """A side of the floor, slightly bowed."""

    start: FloatArray
    """(2,) px: beginning of a line near the side."""
    along: FloatArray
    """(2,) px: vector from the beginning of that line to its end."""
    outward: FloatArray
    """(2,) unit vector perpendicular to the line, away from the floor."""
    bow: FloatArray
    """(3,) px: polynomial, highest power first, of the side's distance outward of the line over the fraction of the way
    along it."""

    def signed_distance(self, point: FloatArray) -> tuple[float, FloatArray]:
        """Return the distance of a (2,) point outward of the side, in px, and its (2,) gradient."""
        unit = self.along / (self.along @ self.along)
        share = (point - self.start) @ unit
        off = (point - self.start) @ self.outward - np.polyval(self.bow, share)
        return float(off), self.outward - np.polyval(np.polyder(self.bow), share) * unit


def fit_side(
    shade: Float32Array, start: FloatArray, end: FloatArray, middle: FloatArray, reach_px: float
) -> Side | None:
    """Return the floor's edge near a line; None if too little of it is visible.

    Args:
        shade: (rows, columns) levels relative to the floor's, 1 on the floor.
        start: (2,) px: beginning of the line.
        end: (2,) px: end of the line.
        middle: (2,) px: a point on the floor's side of the line.
        reach_px: Largest distance of the edge from the line.
    """
    along = end - start
    outward = np.array([along[1], -along[0]]) / np.hypot(*along)
    outward *= np.sign(outward @ (start - middle))
    share, offsets = np.linspace(0.03, 0.97, PROBES), np.arange(-reach_px, reach_px, PROBE_STEP_PX)
    points = start + share[:, None, None] * along + offsets[:, None] * outward
    at_column, at_row = np.moveaxis(points, -1, 0).astype(np.float32)
    values = cv2.remap(shade, at_column, at_row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    off, has = _edges(np.abs(np.asarray(values, float) - 1))
    if not has.any():
        return None
    share, off = share[has], off[has] * PROBE_STEP_PX - reach_px
    near = np.abs(off - np.polyval(_best_line(share, off), share)) <= MAX_OFF_LINE_PX
    for _ in range(3):
        if np.count_nonzero(near) < MIN_FOUND * PROBES:
            return None
        bow = np.polyfit(share[near], off[near], 2)
        near = np.abs(off - np.polyval(bow, share)) <= MAX_OFF_PARABOLA_PX
    return Side(start, along, outward, bow)


def _edges(contrast: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return (n,) the place of the edge in each row, in samples from the first, and (n,) whether the row has an edge.

    The edge is where the contrast is half of that slightly farther out.

    Args:
        contrast: (n, m) differences from the floor's shade at m samples from the floor outwards.
    """
    width = contrast.shape[1]
    rows, samples = np.arange(len(contrast)), np.arange(width)
    leaves = (contrast > BAND).argmax(axis=1)
    beyond = contrast[rows, np.minimum(leaves + round(BEYOND_PX / PROBE_STEP_PX), width - 1)]
    level = np.maximum(beyond / 2, BAND)
    after = ((samples >= leaves[:, None]) & (contrast >= level[:, None])).argmax(axis=1)
    first, before = contrast[rows, after], contrast[rows, np.maximum(after - 1, 0)]
    edge = after - np.clip((first - level) / np.maximum(first - before, 1e-9), 0, 1)
    return edge, (leaves * PROBE_STEP_PX >= 1) & (after > 0)


def _best_line(share: FloatArray, off: FloatArray) -> FloatArray:
    """Return (2,) slope and offset of the line through two of (n,) points that is near to most of them."""
    chosen = np.linspace(0, len(share) - 1, 12).astype(int)
    one, other = np.triu_indices(12, 1)
    one, other = chosen[one], chosen[other]
    slope = (off[other] - off[one]) / np.maximum(share[other] - share[one], 1e-9)
    lines = np.stack([slope, off[one] - slope * share[one]])
    misses = np.abs(off - lines[0][:, None] * share - lines[1][:, None])
    return np.asarray(lines[:, np.count_nonzero(misses <= MAX_OFF_LINE_PX, axis=1).argmax()])


def meeting_point(one: Side, other: Side, guess: FloatArray) -> FloatArray:
    """Return (2,) px: the intersection of two sides near a guess, by Newton's method."""
    corner = guess
    for _ in range(10):
        misses, slopes = zip(*(side.signed_distance(corner) for side in (one, other)), strict=True)
        corner = corner - np.linalg.solve(np.array(slopes), np.array(misses))
    return corner
