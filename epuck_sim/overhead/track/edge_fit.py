"""Places one side of the arena's floor in a picture of the lit room, to a fraction of a pixel."""

from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim.arrays import BoolArray, Float32Array, FloatArray

BAND = 0.15
"""The floor differs from its own smooth shade by at most this share; walls and robots by more."""

PROBES = 160
PROBE_PX = 0.25
"""Places along each side where the edge is looked for, and how densely across it."""

BEYOND_PX = 3.0
"""So far from where the floor ends its blur ends, too."""

OFF_PX = (3.0, 1.0)
"""Edges farther than this from the side are left out, at first (from a line) and at last (from a parabola): they are of
robots that stand at the wall."""

FOUND = 0.4
"""Share of the places along a side where its edge is on the curve, at least."""


class Side(NamedTuple):
    """A side of the floor, slightly bowed."""

    start: FloatArray
    along: FloatArray
    """(2,) px a line that it is near to."""
    outward: FloatArray
    """(2,) unit vector across."""
    bow: FloatArray
    """(3,) px: how far outward it lies, a polynomial of the share of the way along; highest power first."""

    def miss(self, point: FloatArray) -> tuple[float, FloatArray]:
        """Return how far outward of the side a point is, px, and the gradient of that, (2,)."""
        unit = self.along / (self.along @ self.along)
        share = (point - self.start) @ unit
        off = (point - self.start) @ self.outward - np.polyval(self.bow, share)
        return float(off), self.outward - np.polyval(np.polyder(self.bow), share) * unit


def fit_side(
    shade: Float32Array, start: FloatArray, end: FloatArray, middle: FloatArray, reach_px: float
) -> Side | None:
    """Return the floor's edge that lies about the line from `start` to `end`; None where it is too seldom seen.

    shade: (rows, columns) levels over the floor's own, 1 on the floor; middle: (2,) a point on the floor's side of it;
    reach_px: how far the edge is from the line, at most.
    """
    along = end - start
    outward = np.array([along[1], -along[0]]) / np.hypot(*along)
    outward *= np.sign(outward @ (start - middle))
    share, offsets = np.linspace(0.03, 0.97, PROBES), np.arange(-reach_px, reach_px, PROBE_PX)
    points = start + share[:, None, None] * along + offsets[:, None] * outward
    at_column, at_row = np.moveaxis(points, -1, 0).astype(np.float32)
    values = cv2.remap(shade, at_column, at_row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    off, has = _edges(np.abs(np.asarray(values, float) - 1))
    if not has.any():
        return None
    share, off = share[has], off[has] * PROBE_PX - reach_px
    near = np.abs(off - np.polyval(_best_line(share, off), share)) <= OFF_PX[0]
    for _ in range(3):
        if np.count_nonzero(near) < FOUND * PROBES:
            return None
        bow = np.polyfit(share[near], off[near], 2)
        near = np.abs(off - np.polyval(bow, share)) <= OFF_PX[1]
    return Side(start, along, outward, bow)


def _edges(unlike: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return (n,) samples from the first of each row to the edge, and whether the row has one.

    unlike: (n, m) differences from the floor's shade, outwards. The edge is halfway to what lies beyond: where the
    difference is half of that a little farther out.
    """
    width = unlike.shape[1]
    rows, samples = np.arange(len(unlike)), np.arange(width)
    leaves = (unlike > BAND).argmax(axis=1)
    beyond = unlike[rows, np.minimum(leaves + round(BEYOND_PX / PROBE_PX), width - 1)]
    level = np.maximum(beyond / 2, BAND)
    after = ((samples >= leaves[:, None]) & (unlike >= level[:, None])).argmax(axis=1)
    first, before = unlike[rows, after], unlike[rows, np.maximum(after - 1, 0)]
    edge = after - np.clip((first - level) / np.maximum(first - before, 1e-9), 0, 1)
    return edge, (leaves * PROBE_PX >= 1) & (after > 0)


def _best_line(share: FloatArray, off: FloatArray) -> FloatArray:
    """Return (2,) slope and offset of the line that is near to the most of the points, (n,) each; it is through two."""
    chosen = np.linspace(0, len(share) - 1, 12).astype(int)
    one, other = np.triu_indices(12, 1)
    one, other = chosen[one], chosen[other]
    slope = (off[other] - off[one]) / np.maximum(share[other] - share[one], 1e-9)
    lines = np.stack([slope, off[one] - slope * share[one]])
    misses = np.abs(off - lines[0][:, None] * share - lines[1][:, None])
    return np.asarray(lines[:, np.count_nonzero(misses <= OFF_PX[0], axis=1).argmax()])


def meeting_point(one: Side, other: Side, guess: FloatArray) -> FloatArray:
    """Return (2,) px: where two sides meet, near a guess (Newton)."""
    corner = guess
    for _ in range(10):
        misses, slopes = zip(*(side.miss(corner) for side in (one, other)), strict=True)
        corner = corner - np.linalg.solve(np.array(slopes), np.array(misses))
    return corner
