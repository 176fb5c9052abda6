"""The line camera: from poses and lit rings to rows of pixels, with exact occlusion (thesis 4.1.1).

Pixel i of n looks along one ray, the middle of its share of the field of view; index 0 is the left edge, as in a
picture. The nearest surface on the ray decides the pixel: a lit ring is red, all else is dark. Robots are discs of the
body's radius. The walls are dark, and the floor they bound is convex, so that they hide no robot.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.cell_list import CellList, cell_index
from epuck_sim.embodied.field_of_view import (
    FieldOfView,
    angular_radius_bound,
    distance_outside,
    fast_atan2,
    may_contain_disc,
    visible_cells,
)
from epuck_sim.embodied.ray_casting import to_disc, to_segment
from epuck_sim.util.jit import jit

Labels = BoolArray | IntArray

_RADIUS = epuck.RADIUS_CM
_FORWARD = epuck.CAMERA_FORWARD_CM


class Camera(NamedTuple):
    """The directions of a camera's pixels; angles are left of straight ahead."""

    first: int
    """First pixel of the central window; pixels outside the window are always 0."""
    end: int
    """Pixel after the last one of the central window."""
    left_rad: float
    """Angle of the middle of pixel 0."""
    pixels_per_rad: float
    """Pixels in one radian, counted to the right."""
    half_view_rad: float
    """Largest angle between straight ahead and the edge of the central window."""
    range_cm: float
    """Range of the camera in cm; rings farther away are not seen."""
    cos: FloatArray
    """(pixels,) cosines of the pixels' directions in the body's frame."""
    sin: FloatArray
    """(pixels,) sines of the pixels' directions in the body's frame."""


def make_camera(pixels: int, field_of_view_rad: float, central_pixels: int, range_cm: float = math.inf) -> Camera:
    """Return the camera whose `pixels` share the field of view, with a window of `central_pixels`."""
    pitch = field_of_view_rad / pixels
    angles = field_of_view_rad / 2 - pitch * (np.arange(pixels) + 0.5)
    first = (pixels - central_pixels) // 2
    return Camera(
        first,
        first + central_pixels,
        float(angles[0]),
        1 / pitch,
        central_pixels * pitch / 2,
        range_cm,
        np.cos(angles),
        np.sin(angles),
    )


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
    depth = np.empty(rows.shape[1])
    for row in range(len(rows)):
        robot = observer + row
        if not _is_any_in_view(poses, lit, camera, robot):
            continue  # nothing red to see: most of the time, where robots are few
        if _see_robots(poses, labels, cells, camera, robot, rows[row], depth):
            _hide_behind_obstacles(poses[robot], circles, edges, camera, rows[row], depth)


@jit
def _view(pose: FloatArray, cos: float, sin: float, camera: Camera, left: int, right: int) -> FieldOfView:
    """Return a robot's field of view from pixel `left` to pixel `right`; `cos` and `sin` are those of its heading."""
    return FieldOfView(
        pose[0] + _FORWARD * cos,
        pose[1] + _FORWARD * sin,
        cos * camera.cos[left] - sin * camera.sin[left],
        sin * camera.cos[left] + cos * camera.sin[left],
        cos * camera.cos[right] - sin * camera.sin[right],
        sin * camera.cos[right] + cos * camera.sin[right],
        right - left >= camera.pixels_per_rad * math.pi,
    )


@jit
def _is_any_in_view(poses: FloatArray, others: IntArray, camera: Camera, robot: int) -> bool:
    """Return whether any robot whose number is in `others` may reach into a robot's field of view."""
    cos, sin = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
    view = _view(poses[robot], cos, sin, camera, camera.first, camera.end - 1)
    for other in others:
        if other != robot and may_contain_disc(view, poses[other, 0] - view.x, poses[other, 1] - view.y, _RADIUS):
            return True
    return False


@jit
def _see_robots(
    poses: FloatArray, labels: Labels, cells: CellList, camera: Camera, robot: int, row: IntArray, depth: FloatArray
) -> bool:
    """Write the labels that one robot sees, and the distances, to its row; return whether any label is not 0.

    Cells are visited in squares around the camera, from near to far, until all remaining robots must be hidden.
    """
    cos, sin = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
    depth[camera.first : camera.end] = camera.range_cm
    left, right = camera.first, camera.end - 1  # pixels beyond them see something nearer than any robot to come
    view = _view(poses[robot], cos, sin, camera, left, right)
    column = cell_index(view.x, cells.width_cm, cells.columns)
    cell_row = cell_index(view.y, cells.height_cm, cells.rows)
    half_cell = 0.5 * math.hypot(cells.width_cm, cells.height_cm)
    any_lit = False
    for ring in range(max(cells.columns, cells.rows)):
        west, east = visible_cells(view.left_x, view.right_x, view.wide, column, ring, cells.columns)
        south, north = visible_cells(view.left_y, view.right_y, view.wide, cell_row, ring, cells.rows)
        any_in_view = False
        for r in range(south, north):
            inside = cell_row - ring < r < cell_row + ring
            for c in range(column - ring, column + ring + 1, 2 * ring if inside else 1):
                if c < west or c >= east:
                    continue
                dx, dy = (c + 0.5) * cells.width_cm - view.x, (r + 0.5) * cells.height_cm - view.y
                if not may_contain_disc(view, dx, dy, half_cell + _RADIUS):
                    continue
                any_in_view = True
                cell = r * cells.columns + c
                for member in range(cells.first[cell], cells.first[cell + 1]):
                    other = cells.members[member]
                    dx, dy = poses[other, 0] - view.x, poses[other, 1] - view.y
                    if other != robot and may_contain_disc(view, dx, dy, _RADIUS):
                        ahead, aside = dx * cos + dy * sin, dy * cos - dx * sin
                        any_lit |= _see_disc(ahead, aside, labels[other], camera, row, depth)
        if not any_in_view:  # nothing farther out is in view either
            return any_lit
        unseen = distance_outside(view.x, view.y, column, cell_row, ring, cells) - _RADIUS
        while left <= right and depth[left] < unseen:
            left += 1
        while left <= right and depth[right] < unseen:
            right -= 1
        if left > right:
            return any_lit
        view = _view(poses[robot], cos, sin, camera, left, right)
    return any_lit


@jit
def _see_disc(ahead: float, aside: float, label: int, camera: Camera, row: IntArray, depth: FloatArray) -> bool:
    """Write the label of a robot at (ahead, aside) where its disc is nearest so far; return whether a pixel is lit."""
    distance = math.sqrt(ahead * ahead + aside * aside)
    nearest = distance - _RADIUS - 1e-9
    width = angular_radius_bound(distance)
    direction = fast_atan2(ahead, aside)
    # a disc behind the camera may show at both ends of a row that looks nearly all round
    round_about = 1 if width + camera.half_view_rad >= math.pi else 0
    any_lit = False
    for turn in range(-round_about, round_about + 1):
        middle = (camera.left_rad - direction - turn * 2.0 * math.pi) * camera.pixels_per_rad
        spread = width * camera.pixels_per_rad + 1.0
        low = max(int(middle - spread), camera.first)
        high = min(int(middle + spread) + 1, camera.end)
        for pixel in range(low, high):
            if depth[pixel] < nearest:
                continue
            reach = to_disc(0.0, 0.0, camera.cos[pixel], camera.sin[pixel], ahead, aside, _RADIUS)
            if reach < depth[pixel] or (reach == depth[pixel] and label > row[pixel] and reach < math.inf):
                depth[pixel] = reach
                row[pixel] = label
                any_lit |= label > 0
    return any_lit


@jit
def _hide_behind_obstacles(
    pose: FloatArray, circles: FloatArray, edges: FloatArray, camera: Camera, row: IntArray, depth: FloatArray
) -> None:
    """Set pixels to 0 where an obstacle is nearer than the robot seen."""
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
