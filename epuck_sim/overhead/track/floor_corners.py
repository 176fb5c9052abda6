"""Finds the floor of the arena in a picture of the lit room: one even grey, with walls that are brighter or darker."""

import cv2
import numpy as np

from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.edge_fit import BAND, fit_side, meeting_point
from epuck_sim.overhead.track.ring_detection import is_lit

Line = tuple[FloatArray, FloatArray]
"""(2,) px a point, and a vector to another one."""

MIDDLE = 0.5
"""Within this share of the picture's half-diagonal its middle is darkened so little that one level finds the floor."""

ROUNDS = 8
"""Of fitting the floor's shade: each takes in more of the picture, from the middle outwards."""

LEAST = 0.1
"""The floor is at least this share of the picture."""

CORNER = 0.004
"""Bends of the floor's outline that are flatter than this share of its length are none: lenses bow straight edges."""

NARROWING = (0.03, 0.015)
"""So far on either side of a line, in shares of the picture's shorter side, its edge is looked for: first, and again
from the better line."""


def find_corners(picture: Picture) -> FloatArray | None:
    """Return (4, 2) px, columns and rows of the floor's corners in a lit picture; None where there is no such floor.

    The shade of the floor is fitted from the picture's middle outwards, as lenses darken their corners and lamps hang
    aside. Its outline gives four lines; across each, the edge is placed to a fraction of a pixel at many places. A
    parabola goes through each side, as distortion bows them, and neighbours are intersected.
    """
    if not is_lit(picture):
        return None
    grey = cv2.GaussianBlur(picture, (0, 0), 1.0).mean(axis=2, dtype=np.float32)
    shade = _relative(np.asarray(grey, np.float32))
    if shade is None:
        return None
    lines = _outline(shade)
    if lines is None:
        return None
    corners = _meet(lines)
    if not _is_around_middle(corners, shade.shape):
        return None
    for reach in NARROWING:
        middle, reach_px = corners.mean(axis=0), reach * min(shade.shape)
        sides = [fit_side(shade, corners[k], corners[(k + 1) % 4], middle, reach_px) for k in range(4)]
        whole = [side for side in sides if side is not None]
        if len(whole) < 4:
            return None
        corners = np.array([meeting_point(whole[k - 1], whole[k], corners[k]) for k in range(4)])
    rows, columns = shade.shape
    is_in = (corners >= 0).all() and (corners <= (columns - 1, rows - 1)).all()
    return corners if is_in and _is_around_middle(corners, shade.shape) else None


def _relative(grey: Float32Array) -> Float32Array | None:
    """Return (rows, columns) levels over those of a floor there, 1 on the floor; None where the middle is no floor.

    The floor's shade is a paraboloid: of light from one side, and of vignetting.
    """
    rows, columns = grey.shape
    y, x = np.mgrid[-1 : 1 : rows * 1j, -1 : 1 : columns * 1j]
    x, y = x * columns / np.hypot(rows, columns), y * rows / np.hypot(rows, columns)
    design = np.stack([np.ones_like(x), x, y, x * x + y * y], axis=-1)
    step = max(min(grey.shape) // 120, 1)
    few, values = design[::step, ::step].reshape(-1, 4), grey[::step, ::step].ravel().astype(float)
    middle = np.sqrt(few[:, 3]) < MIDDLE
    levels = np.bincount(values[middle].astype(int), minlength=256)
    shade = np.full(len(few), float(np.convolve(levels, np.ones(9), "same").argmax()))
    for reach in np.linspace(MIDDLE, 1, ROUNDS):
        floor = (np.abs(values - shade) < BAND * shade) & (np.sqrt(few[:, 3]) < reach)
        if np.count_nonzero(floor) < LEAST / 2 * len(few):
            return None
        terms, *_ = np.linalg.lstsq(few[floor], values[floor], rcond=None)
        shade = few @ terms
    return np.asarray(grey / np.maximum(design @ terms, 1), np.float32)


def _outline(shade: Float32Array) -> list[Line] | None:
    """Return the four lines along the longest sides of the floor's convex hull; None where the floor is cut off."""
    floor = (np.abs(shade - 1) < BAND).astype(np.uint8)
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(floor, connectivity=4)
    label = int(boxes[1:, cv2.CC_STAT_AREA].argmax()) + 1 if len(boxes) > 1 else 0
    left, top, width, height, area = boxes[label]
    rows, columns = shade.shape
    if not label or area < LEAST * shade.size:
        return None
    if left == 0 or top == 0 or left + width == columns or top + height == rows:
        return None
    outlines, _ = cv2.findContours((labels == label).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    hull = cv2.convexHull(max(outlines, key=len))
    bends = cv2.approxPolyDP(hull, CORNER * cv2.arcLength(hull, True), True).reshape(-1, 2).astype(float)
    along = np.roll(bends, -1, axis=0) - bends
    if len(bends) < 4:
        return None
    longest = np.sort(np.argsort(-np.hypot(*along.T), kind="stable")[:4])
    return [(bends[k], along[k]) for k in longest]


def _meet(lines: list[Line]) -> FloatArray:
    """Return (4, 2): where each of four lines meets the one before it; far away if they are parallel."""
    corners = []
    for k, (point, along) in enumerate(lines):
        before, back = lines[k - 1]
        cross = along[0] * back[1] - along[1] * back[0]
        gap = before - point
        corners.append(point + along * ((gap[0] * back[1] - gap[1] * back[0]) / (cross or 1e-9)))
    return np.array(corners)


def _is_around_middle(corners: FloatArray, shape: tuple[int, ...]) -> bool:
    """Return whether (4, 2) corners bound a convex quadrilateral around the middle of the picture."""
    rows, columns = shape
    along = np.roll(corners, -1, axis=0) - corners
    to_middle = np.array([(columns - 1) / 2, (rows - 1) / 2]) - corners
    after = np.roll(along, -1, axis=0)
    turns = along[:, 0] * after[:, 1] - along[:, 1] * after[:, 0]
    around = along[:, 0] * to_middle[:, 1] - along[:, 1] * to_middle[:, 0]
    return bool(abs(np.sign(turns).sum() + np.sign(around).sum()) == 2 * len(corners))
