"""Finds the arena's floor in a picture of the lit room: an even grey, surrounded by brighter or darker walls."""

import cv2
import numpy as np

from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.geometry import contains, is_convex, polygon_area
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.edge_fit import BAND, fit_side, meeting_point
from epuck_sim.overhead.track.light import is_lit

Line = tuple[FloatArray, FloatArray]
"""A point, (2,) px, and the vector to another one, (2,) px."""

MIDDLE = 0.5
"""Radius, as a fraction of the half-diagonal, of the middle: vignetting is weak there, and one level is the floor's."""

SHADE_FITS = 8
"""Number of fits of the floor's shade; each covers more of the picture, from the middle outwards."""

MIN_FLOOR = 0.1
"""Minimum area of the floor, as a fraction of the picture."""

CORNER_TOLERANCE = 0.004
"""approxPolyDP tolerance, as a fraction of the outline's length; lenses bow straight edges."""

SEARCH_REACHES = (0.03, 0.015)
"""Distances on either side of a line within which the edge is searched, as fractions of the picture's shorter side:
first from the outline's lines, then from the lines that this gives."""


def find_corners(picture: Picture) -> FloatArray | None:
    """Return (4, 2) px: columns and rows of the floor's corners in a lit picture; None if no floor is found.

    The shade of the floor is fitted from the picture's middle outwards, because lenses darken the corners and lamps
    hang off-centre. Its outline gives four lines; across each, the edge is located to a fraction of a pixel at many
    places. A parabola is fitted to each side, because distortion bows it, and neighbouring sides are intersected.
    """
    if not is_lit(picture):
        return None
    grey = cv2.GaussianBlur(picture, (0, 0), 1.0).mean(axis=2, dtype=np.float32)
    shade = _relative_shade(np.asarray(grey, np.float32))
    if shade is None:
        return None
    lines = _outline_sides(shade)
    if lines is None:
        return None
    corners = _intersections(lines)
    if not _is_around_middle(corners, shade.shape):
        return None
    for reach in SEARCH_REACHES:
        middle, reach_px = corners.mean(axis=0), reach * min(shade.shape)
        sides = [fit_side(shade, corners[k], corners[(k + 1) % 4], middle, reach_px) for k in range(4)]
        whole = [side for side in sides if side is not None]
        if len(whole) < 4:
            return None
        corners = np.array([meeting_point(whole[k - 1], whole[k], corners[k]) for k in range(4)])
    rows, columns = shade.shape
    is_in = (corners >= 0).all() and (corners <= (columns - 1, rows - 1)).all()
    return corners if is_in and _is_around_middle(corners, shade.shape) else None


def _relative_shade(grey: Float32Array) -> Float32Array | None:
    """Return (rows, columns) levels relative to the floor's, 1 on the floor; None if the picture's middle is not floor.

    The floor's shade is modelled as a paraboloid: light from one side, and vignetting.
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
    for reach in np.linspace(MIDDLE, 1, SHADE_FITS):
        floor = (np.abs(values - shade) < BAND * shade) & (np.sqrt(few[:, 3]) < reach)
        if np.count_nonzero(floor) < MIN_FLOOR / 2 * len(few):
            return None
        terms, *_ = np.linalg.lstsq(few[floor], values[floor], rcond=None)
        shade = few @ terms
    return np.asarray(grey / np.maximum(design @ terms, 1), np.float32)


def _outline_sides(shade: Float32Array) -> list[Line] | None:
    """Return the lines along the four longest sides of the floor's convex hull; None if the floor is cut off."""
    floor = (np.abs(shade - 1) < BAND).astype(np.uint8)
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(floor, connectivity=4)
    label = int(boxes[1:, cv2.CC_STAT_AREA].argmax()) + 1 if len(boxes) > 1 else 0
    left, top, width, height, area = boxes[label]
    rows, columns = shade.shape
    if not label or area < MIN_FLOOR * shade.size:
        return None
    if left == 0 or top == 0 or left + width == columns or top + height == rows:
        return None
    outlines, _ = cv2.findContours((labels == label).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    hull = cv2.convexHull(max(outlines, key=len))
    bends = cv2.approxPolyDP(hull, CORNER_TOLERANCE * cv2.arcLength(hull, True), True).reshape(-1, 2).astype(float)
    along = np.roll(bends, -1, axis=0) - bends
    if len(bends) < 4:
        return None
    longest = np.sort(np.argsort(-np.hypot(*along.T), kind="stable")[:4])
    return [(bends[k], along[k]) for k in longest]


def _intersections(lines: list[Line]) -> FloatArray:
    """Return (4, 2) px: the intersection of each of four lines with the previous one; far away if they are parallel."""
    corners = []
    for k, (point, along) in enumerate(lines):
        before, back = lines[k - 1]
        cross = along[0] * back[1] - along[1] * back[0]
        gap = before - point
        corners.append(point + along * ((gap[0] * back[1] - gap[1] * back[0]) / (cross or 1e-9)))
    return np.array(corners)


def _is_around_middle(corners: FloatArray, shape: tuple[int, ...]) -> bool:
    """Return whether (4, 2) corners, in either direction, bound a convex quadrilateral around the picture's middle."""
    rows, columns = shape
    if polygon_area(corners) < 0:
        corners = corners[::-1]
    return is_convex(corners) and bool(contains(corners, np.array([(columns - 1) / 2, (rows - 1) / 2])))
