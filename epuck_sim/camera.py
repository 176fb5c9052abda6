"""The line camera: from poses and lit rings to rows of pixels, with exact occlusion (thesis 4.1.1).

Pixel i of n looks along one ray, the middle of its share of the field of view; index 0 is the left edge, as in a
picture. The nearest surface on the ray gives the pixel: a lit ring is red, all else is dark. Robots are discs of the
body's radius. The walls, dark and convex, hide nobody.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.cells import Cells, slot
from epuck_sim.compiled import kernel
from epuck_sim.rays import to_disc, to_segment

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Pixels = npt.NDArray[np.uint8]

_RADIUS = epuck.RADIUS_CM
_FORWARD = epuck.CAMERA_FORWARD_CM


class Camera(NamedTuple):
    """Where a camera's pixels look; angles are left of straight ahead."""

    first: int
    """The first pixel that is looked at, and the one after the last: the central window."""
    end: int
    left_rad: float
    """Angle of the middle of pixel 0."""
    pitch_rad: float
    """Angle from one pixel to the next, to the right."""
    half_view_rad: float
    """No pixel that is looked at is farther from straight ahead."""
    range_cm: float
    """Surfaces beyond it are not seen."""
    cos: Floats
    """(pixels,) the pixels' directions in the body's frame."""
    sin: Floats


def make_camera(pixels: int, field_of_view_rad: float, central_pixels: int, range_cm: float = math.inf) -> Camera:
    """Return the camera whose `pixels` share the field of view; only the `central_pixels` are looked at."""
    pitch = field_of_view_rad / pixels
    angles = field_of_view_rad / 2 - pitch * (np.arange(pixels) + 0.5)
    first = (pixels - central_pixels) // 2
    return Camera(
        first,
        first + central_pixels,
        float(angles[0]),
        pitch,
        central_pixels * pitch / 2,
        range_cm,
        np.cos(angles),
        np.sin(angles),
    )


@kernel
def see(
    poses: Floats,
    ring_on: Bools,
    circles: Floats,
    edges: Floats,
    cells: Cells,
    camera: Camera,
    observer: int,
    rows: Pixels,
) -> None:
    """Write the rows that the robots from number `observer` on see, one a row of (observers, pixels) `rows`.

    poses: (robots, 3) x cm, y cm, heading rad; ring_on: (robots,); circles (k, 3), edges (m, 4): see `arena.Arena`;
    cells: sorted by poses. Pixels outside the central window are dark.
    """
    rows[:] = 0
    if not ring_on.any():
        return
    depth = np.empty(rows.shape[1])
    for row in range(len(rows)):
        if _see_robots(poses, ring_on, cells, camera, observer + row, rows[row], depth):
            _hide_behind_obstacles(poses[observer + row], circles, edges, camera, rows[row], depth)


@kernel
def _see_robots(
    poses: Floats, ring_on: Bools, cells: Cells, camera: Camera, robot: int, row: Pixels, depth: Floats
) -> bool:
    """Write what one robot sees of the others, and the distances; return whether anything is red.

    Cells are visited in squares around the camera, from near to far, until what is left lies behind what was seen.
    """
    cos, sin = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
    x = poses[robot, 0] + _FORWARD * cos
    y = poses[robot, 1] + _FORWARD * sin
    depth[camera.first : camera.end] = camera.range_cm
    column = slot(x, cells.width_cm, cells.columns)
    line = slot(y, cells.height_cm, cells.rows)
    half_cell = 0.5 * math.hypot(cells.width_cm, cells.height_cm)
    red = False
    ring = 0
    while True:
        for r in range(max(line - ring, 0), min(line + ring + 1, cells.rows)):
            inner = line - ring < r < line + ring
            for c in range(column - ring, column + ring + 1, 2 * ring if inner else 1):
                if c < 0 or c >= cells.columns:
                    continue
                cell = r * cells.columns + c
                if cells.first[cell] == cells.first[cell + 1]:
                    continue
                dx, dy = (c + 0.5) * cells.width_cm - x, (r + 0.5) * cells.height_cm - y
                if not _in_view(dx * cos + dy * sin, dy * cos - dx * sin, half_cell + _RADIUS, camera):
                    continue
                for member in range(cells.first[cell], cells.first[cell + 1]):
                    other = cells.members[member]
                    if other == robot:
                        continue
                    dx, dy = poses[other, 0] - x, poses[other, 1] - y
                    ahead, aside = dx * cos + dy * sin, dy * cos - dx * sin
                    if _in_view(ahead, aside, _RADIUS, camera):
                        red |= _see_disc(ahead, aside, ring_on[other], camera, row, depth)
        unseen = math.inf  # nothing in the cells to come is nearer
        if column - ring > 0:
            unseen = min(unseen, x - (column - ring) * cells.width_cm)
        if column + ring < cells.columns - 1:
            unseen = min(unseen, (column + ring + 1) * cells.width_cm - x)
        if line - ring > 0:
            unseen = min(unseen, y - (line - ring) * cells.height_cm)
        if line + ring < cells.rows - 1:
            unseen = min(unseen, (line + ring + 1) * cells.height_cm - y)
        if unseen == math.inf or unseen - _RADIUS > depth[camera.first : camera.end].max():
            return red
        ring += 1


@kernel
def _in_view(ahead: float, aside: float, radius: float, camera: Camera) -> bool:
    """Whether a disc at (ahead, aside) may reach into the field of view; never False for one that does."""
    half = camera.half_view_rad
    if half >= 0.5 * math.pi:
        return True
    return abs(aside) * math.cos(half) - ahead * math.sin(half) <= radius


@kernel
def _see_disc(ahead: float, aside: float, lit: bool, camera: Camera, row: Pixels, depth: Floats) -> bool:
    """Write a robot's disc, centred at (ahead, aside) of the camera, where it is nearest; return whether in red."""
    distance = math.hypot(ahead, aside)
    bearing = math.atan2(aside, ahead)
    half_width = math.pi if distance <= _RADIUS else math.asin(_RADIUS / distance)
    red = False
    for turns in range(-1, 2):  # a disc behind the camera may show at both ends of a row that looks all round
        middle = bearing + turns * 2.0 * math.pi
        # one pixel more at either end: the ray itself decides
        low = (camera.left_rad - middle - half_width) / camera.pitch_rad - 1.0
        high = (camera.left_rad - middle + half_width) / camera.pitch_rad + 2.0
        if high <= camera.first or low >= camera.end:
            continue
        for pixel in range(max(int(low), camera.first), min(int(high), camera.end)):
            reach = to_disc(0.0, 0.0, camera.cos[pixel], camera.sin[pixel], ahead, aside, _RADIUS)
            if reach < depth[pixel] or (reach == depth[pixel] and lit and reach < math.inf):
                depth[pixel] = reach
                row[pixel] = lit
                red |= lit
    return red


@kernel
def _hide_behind_obstacles(
    pose: Floats, circles: Floats, edges: Floats, camera: Camera, row: Pixels, depth: Floats
) -> None:
    """Darken the red pixels before which an obstacle stands."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = pose[0] + _FORWARD * cos, pose[1] + _FORWARD * sin
    for pixel in range(camera.first, camera.end):
        if row[pixel] == 0:
            continue
        dx = cos * camera.cos[pixel] - sin * camera.sin[pixel]
        dy = sin * camera.cos[pixel] + cos * camera.sin[pixel]
        for circle in circles:
            if to_disc(x, y, dx, dy, circle[0], circle[1], circle[2]) < depth[pixel]:
                row[pixel] = 0
        for edge in edges:
            if to_segment(x, y, dx, dy, edge[0], edge[1], edge[2], edge[3]) < depth[pixel]:
                row[pixel] = 0
