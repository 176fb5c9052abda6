"""The corners of the arena's floor in a picture: given by the user, or found in the lit room.

The floor is an even grey, surrounded by brighter or darker walls.
"""

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, Float32Array, FloatArray
from epuck_sim.errors import FilmError
from epuck_sim.geometry import contains, is_convex, polygon_area
from epuck_sim.overhead.camera import Picture

# corners that are given
MIN_SIDE = 0.1  # least side of the floor, relative to the picture's shorter one; rings are not located on less
MAX_OUTSIDE = 1.0  # largest distance of a corner from the picture, as a fraction of the picture's sides

# the floor's outline
BAND = 0.15  # largest relative difference of the floor from its own smooth shade; walls and robots differ by more
MIDDLE = 0.5  # radius, in half-diagonals, of the middle: vignetting is weak there, and the floor has one level
SHADE_FITS = 8  # fits of the floor's shade; each covers more of the picture, from the middle outwards
MIN_FLOOR = 0.1  # minimum area of the floor, as a fraction of the picture
CORNER_TOLERANCE = 0.004  # tolerance of approxPolyDP, relative to the outline's length; lenses bow straight edges

PADDING_PX = 9.0  # distance beyond the corners at which a film may be padded
BLACK_LEVEL = 6.0  # level of padding after compression; a lit room is brighter everywhere

# the sides
SEARCH_REACHES = (0.03, 0.015)
"""Distances from a line within which the edge is searched, relative to the picture's shorter side: first from the lines
of the outline, then from those of the first search."""
PROBES = 160  # places along each side at which the edge is searched
PROBE_STEP_PX = 0.25  # distance of samples across the side at each place
BEYOND_PX = 3.0  # distance beyond the floor at which its blur has ended
MAX_OFF_LINE_PX = 3.0  # distance from the first line; edges farther off belong to robots that stand at the wall
MAX_OFF_PARABOLA_PX = 1.0  # distance from the fitted parabola beyond which edges are left out
MIN_FOUND = 0.4  # share of the places along a side at which its edge must be on the curve


def check_corners(corners_px: npt.ArrayLike, width_px: int, height_px: int) -> FloatArray:
    """Return the floor's corners, (4, 2) px, counter-clockwise as seen, from the lower left one on.

    `corners_px` are (4, 2) columns and rows, in any order. FilmError is raised if they are no convex quadrilateral,
    too close together, or far outside of the picture.
    """
    given = "--corners " + ",".join(f"{number:g}" for number in np.ravel(corners_px))
    corners, size = np.asarray(corners_px, float), np.array([width_px, height_px])
    if not ((corners >= -MAX_OUTSIDE * size) & (corners <= (1 + MAX_OUTSIDE) * size)).all():
        said = f"a corner is far outside of the picture of {width_px} x {height_px} px"
        allowed = "up to a picture's width or height beyond its edges"
        raise FilmError(f"{given}: {said}; allowed: {allowed}; columns and rows count from the upper left corner")
    away = corners - corners.mean(axis=0)
    corners = corners[np.argsort(np.arctan2(-away[:, 1], away[:, 0]), kind="stable")]
    if not is_convex(corners * (1, -1)):  # rows count downwards
        instead = "give the floor's four corners as the picture shows them, in any order"
        raise FilmError(f"{given}: these are not the corners of a convex quadrilateral; {instead}")
    shortest = float(np.hypot(*(np.roll(corners, -1, axis=0) - corners).T).min())
    least = MIN_SIDE * min(width_px, height_px)
    if shortest < least:
        allowed = f"at least {least:.3g} px, because rings cannot be located on a smaller floor"
        raise FilmError(f"{given}: the shortest side is {shortest:.3g} px; allowed: {allowed}")
    lower_left = np.hypot(corners[:, 0], corners[:, 1] - (height_px - 1))
    return np.roll(corners, -int(lower_left.argmin()), axis=0)


def find_corners(picture: Picture) -> FloatArray | None:
    """Return (4, 2) px: columns and rows of the floor's corners in a lit picture; None if no floor is found.

    The shade of the floor is fitted from the picture's middle outwards, because lenses darken the corners and lamps
    hang off-centre. Its outline gives four lines; across each, the edge is located to a fraction of a pixel at many
    places. A parabola is fitted to each side, because distortion bows it; the tangents at its ends meet in the corners.
    """
    grey = np.asarray(cv2.GaussianBlur(picture, (0, 0), 1.0).mean(axis=2, dtype=np.float32), np.float32)
    if (shade := _relative_shade(grey)) is None or (corners := _outline_corners(shade)) is None:
        return None
    if not _is_around_middle(corners, shade.shape):
        return None
    for reach in SEARCH_REACHES:
        middle, reach_px = corners.mean(axis=0), reach * min(shade.shape)
        ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        sides = [side for start, end in ends if (side := _fit_side(shade, start, end, middle, reach_px)) is not None]
        if len(sides) < 4:
            return None
        corners = np.array([_intersection(sides[k - 1][1], sides[k][0]) for k in range(4)])
    rows, columns = shade.shape
    is_in = (corners >= 0).all() and (corners <= (columns - 1, rows - 1)).all()
    is_floor = is_in and _is_around_middle(corners, shade.shape) and not _borders_on_padding(grey, corners)
    return corners if is_floor else None


def _relative_shade(grey: Float32Array) -> Float32Array | None:
    """Return (rows, columns) levels relative to the floor's, 1 on the floor; None if the picture's middle is not floor.

    The floor's shade is modelled as a paraboloid: light from one side, and vignetting.
    """
    sides = np.array(grey.shape) / np.hypot(*grey.shape)
    y, x = np.mgrid[-1 : 1 : grey.shape[0] * 1j, -1 : 1 : grey.shape[1] * 1j] * sides[:, None, None]
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


def _outline_corners(shade: Float32Array) -> FloatArray | None:
    """Return (4, 2) px: intersections of the four longest sides of the floor's convex hull; None if it is cut off."""
    floor = (np.abs(shade - 1) < BAND).astype(np.uint8)
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(floor, connectivity=4)
    label = int(boxes[1:, cv2.CC_STAT_AREA].argmax()) + 1 if len(boxes) > 1 else 0
    left, top, width, height, area = boxes[label]
    rows, columns = shade.shape
    is_cut_off = left == 0 or top == 0 or left + width == columns or top + height == rows
    if not label or area < MIN_FLOOR * shade.size or is_cut_off:
        return None
    outlines, _ = cv2.findContours((labels == label).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    hull = cv2.convexHull(max(outlines, key=len))
    bends = cv2.approxPolyDP(hull, CORNER_TOLERANCE * cv2.arcLength(hull, True), True).reshape(-1, 2).astype(float)
    if len(bends) < 4:
        return None
    sides = np.stack([bends, np.roll(bends, -1, axis=0) - bends], axis=1)
    longest = sides[np.sort(np.argsort(-np.hypot(*sides[:, 1].T), kind="stable")[:4])]
    return np.array([_intersection(*lines) for lines in zip(longest, np.roll(longest, 1, axis=0), strict=True)])


def _intersection(line: FloatArray, other: FloatArray) -> FloatArray:
    """Return (2,) px: intersection of two lines, each a point and a vector along it; far away if they are parallel."""
    (point, along), (before, back) = line, other
    cross, gap = along[0] * back[1] - along[1] * back[0], before - point
    return np.asarray(point + along * ((gap[0] * back[1] - gap[1] * back[0]) / (cross or 1e-9)))


def _is_around_middle(corners: FloatArray, shape: tuple[int, ...]) -> bool:
    """Return whether (4, 2) corners, in either direction, bound a convex quadrilateral around the picture's middle."""
    rows, columns = shape
    if polygon_area(corners) < 0:
        corners = corners[::-1]
    return is_convex(corners) and bool(contains(corners, np.array([(columns - 1) / 2, (rows - 1) / 2])))


def _borders_on_padding(grey: Float32Array, corners: FloatArray) -> bool:
    """Return whether it is black beyond one of the sides: bars around a film are black, a lit room is black nowhere."""
    share = np.linspace(0.1, 0.9, PROBES)[:, None, None]
    away = corners.mean(axis=0) - corners
    beyond = corners - away * (PADDING_PX / np.hypot(*away.T))[:, None]
    levels = _sampled(grey, beyond + share * (np.roll(beyond, -1, axis=0) - beyond))
    return bool((np.median(levels, axis=0) <= BLACK_LEVEL).any())


def _sampled(picture: Float32Array, points_px: FloatArray) -> FloatArray:
    """Return (n, m) levels at (n, m, 2) px: columns and rows."""
    at_column, at_row = np.moveaxis(points_px, -1, 0).astype(np.float32)
    return np.asarray(cv2.remap(picture, at_column, at_row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), float)


def _fit_side(
    shade: Float32Array, start: FloatArray, end: FloatArray, middle: FloatArray, reach_px: float
) -> FloatArray | None:
    """Return (2, 2, 2) px: tangents at both ends of the floor's edge near a line; None if too little of it is visible.

    Each tangent is a point and a vector along it.
    """
    along = end - start
    outward = np.array([along[1], -along[0]]) / np.hypot(*along)
    outward *= np.sign(outward @ (start - middle))
    share, offsets = np.linspace(0.03, 0.97, PROBES), np.arange(-reach_px, reach_px, PROBE_STEP_PX)
    values = _sampled(shade, start + share[:, None, None] * along + offsets[:, None] * outward)
    off, has = _edges(np.abs(values - 1))
    if not has.any():
        return None
    share, off = share[has], off[has] * PROBE_STEP_PX - reach_px
    near = np.abs(off - np.polyval(_best_line(share, off), share)) <= MAX_OFF_LINE_PX
    for _ in range(3):
        if np.count_nonzero(near) < MIN_FOUND * PROBES:
            return None
        bow = np.polyfit(share[near], off[near], 2)
        near = np.abs(off - np.polyval(bow, share)) <= MAX_OFF_PARABOLA_PX
    square, linear, constant = bow
    ends = (start, constant, linear), (end, bow.sum(), 2 * square + linear)
    return np.array([(corner + off * outward, along + slope * outward) for corner, off, slope in ends])


def _edges(contrast: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the sample, a fraction, where each of (n, m) contrasts is half of that just beyond; and whether it is."""
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
    """Return (2,) slope and offset of the line through two of (n,) points that is near to the most points."""
    chosen = np.linspace(0, len(share) - 1, 12).astype(int)
    one, other = np.triu_indices(12, 1)
    one, other = chosen[one], chosen[other]
    slope = (off[other] - off[one]) / np.maximum(share[other] - share[one], 1e-9)
    lines = np.stack([slope, off[one] - slope * share[one]])
    misses = np.abs(off - lines[0][:, None] * share - lines[1][:, None])
    return np.asarray(lines[:, np.count_nonzero(misses <= MAX_OFF_LINE_PX, axis=1).argmax()])
