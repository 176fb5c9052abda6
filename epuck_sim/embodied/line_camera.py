"""The line camera: from poses and lit rings to rows of pixels, with exact occlusion (thesis 4.1.1).

Pixel i of n looks along one ray, the middle of its share of the field of view; index 0 is the left edge, as in a
picture. The nearest surface on the ray decides the pixel: a lit ring is red, all else is dark. Robots are discs of the
body's radius. The walls are dark, and the floor they bound is convex, so that they hide no robot.

Most rings are dark most of the time. Where few are lit, they are looked at first, as if there were no others; other
robots can but hide what they show, so that the search for those skips all other pixels, and ends where the lit are.
"""

import math

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.camera_pixels import Camera, Observer, Picture, add_robot, hide_behind_obstacles, view_between
from epuck_sim.embodied.cell_list import CellList
from epuck_sim.embodied.field_of_view import (
    SECTOR_RAD,
    cells_in_strip,
    distance_beyond,
    make_strips,
    make_wedge,
    may_contain_robot,
)
from epuck_sim.util.jit import jit, jit_inline

Labels = BoolArray | IntArray

_FORWARD = epuck.CAMERA_FORWARD_CM
_FEW_LIT = 8  # measured: to look at the lit first is as fast as to search for all robots at once if lit^2 = 8 robots


@jit
def see(
    poses: FloatArray,
    labels: Labels,
    circles: FloatArray,
    edges: FloatArray,
    cells: CellList,
    camera: Camera,
    observer: int,
    rows: IntArray,
) -> None:
    """Write the rows of pixels that some robots see: 0 where the nearest surface is dark, or beyond the range.

    Args:
        poses: (robots, 3) cm, cm, rad: x, y, heading.
        labels: (robots,) value of a pixel that sees this robot; for the line camera, whether its ring is lit.
        circles: (k, 3) cm: round obstacles, see `arena.Arena`.
        edges: (m, 4) cm: edges of the other obstacles, see `arena.Arena`.
        cells: Cell list sorted by `poses`.
        camera: The observers' camera.
        observer: Number of the first robot that observes.
        rows: (observers, pixels) one row for each of the robots from `observer` on; written.
    """
    rows[:] = 0
    lit = np.flatnonzero(labels)
    if len(lit) == 0:
        return
    few_lit = are_few(len(lit), len(poses))
    depth = np.empty(rows.shape[1])
    for row in range(len(rows)):
        eye = observer_at(poses, observer + row)
        picture = Picture(rows[row], depth)
        depth[camera.first : camera.end] = camera.range_cm
        if few_lit and not see_lit(poses, labels, lit, camera, eye, picture):
            continue  # nothing red to see: most of the time, where robots are few
        see_sectors(labels, cells, camera, eye, picture)
        if len(circles) + len(edges) > 0:
            hide_behind_obstacles(circles, edges, camera, eye, picture)


@jit_inline
def are_few(lit: int, robots: int) -> bool:
    """Return whether so few rings are lit that it is faster to look at them first."""
    return lit * lit <= _FEW_LIT * robots


@jit_inline
def observer_at(poses: FloatArray, robot: int) -> Observer:
    """Return a robot that looks about from where its camera is."""
    x, y, heading = poses[robot]
    cos, sin = math.cos(heading), math.sin(heading)
    return Observer(robot, x + _FORWARD * cos, y + _FORWARD * sin, cos, sin)


@jit_inline
def see_lit(poses: FloatArray, labels: Labels, lit: IntArray, camera: Camera, eye: Observer, picture: Picture) -> bool:
    """Write the robots whose numbers are in `lit` to a picture, as if there were no others; return whether any shows.

    Pixels that show none remain 0, whatever other robots hide.
    """
    view = view_between(eye, camera, camera.first, camera.end - 1)
    any_lit = False
    for other in lit:
        dx, dy = poses[other, 0] - eye.x, poses[other, 1] - eye.y
        if other != eye.robot and may_contain_robot(view, dx, dy):
            any_lit |= add_robot(dx, dy, labels[other], camera, eye, camera.first, camera.end - 1, picture)
    if any_lit:
        for pixel in range(camera.first, camera.end):
            if picture.row[pixel] == 0:
                picture.depth[pixel] = -math.inf
    return any_lit


@jit_inline
def see_sectors(labels: Labels, cells: CellList, camera: Camera, eye: Observer, picture: Picture) -> None:
    """Write all robots to a picture; leave out pixels that cannot change any more at the ends of each sector."""
    pixels = max(1, int(SECTOR_RAD * camera.pixels_per_rad))
    left = camera.first
    while left < camera.end:
        if picture.depth[left] < 0.0:
            left += 1
            continue
        right = min(left + pixels, camera.end) - 1
        while picture.depth[right] < 0.0:
            right -= 1
        _see_sector(labels, cells, camera, eye, left, right, picture)
        left = right + 1


@jit_inline
def _see_sector(
    labels: Labels, cells: CellList, camera: Camera, eye: Observer, left: int, right: int, picture: Picture
) -> None:
    """Write all robots to the pixels from `left` to `right`.

    Strips of cells are visited from near to far, until all remaining robots must be hidden.
    """
    view = view_between(eye, camera, left, right)
    strips = make_strips(view, cells)
    wedge = make_wedge(view, strips)
    strip = strips.first
    while 0 <= strip < strips.total:
        cell, spans, length = cells_in_strip(view, wedge, strips, strip, cells)
        for span in range(spans):
            start = cell + span * cells.columns
            for member in range(cells.first[start], cells.first[start + length]):
                dx, dy = cells.positions[member, 0] - eye.x, cells.positions[member, 1] - eye.y
                if may_contain_robot(view, dx, dy) and cells.members[member] != eye.robot:
                    add_robot(dx, dy, labels[cells.members[member]], camera, eye, left, right, picture)
        unseen = distance_beyond(wedge, strips, strip)
        outer = right - left
        while left <= right and picture.depth[left] < unseen:
            left += 1
        while left <= right and picture.depth[right] < unseen:
            right -= 1
        if left > right:
            return
        if right - left < outer:
            view = view_between(eye, camera, left, right)
            wedge = make_wedge(view, strips)
        strip += strips.step
