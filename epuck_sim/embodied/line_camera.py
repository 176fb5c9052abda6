"""The line camera: from poses and lit rings to rows of pixels, with exact occlusion (thesis 4.1.1).

Pixel i of n looks along one ray, the middle of its share of the field of view; index 0 is the left edge, as in a
picture. The nearest surface on the ray gives the pixel: a lit ring is red, all else is dark. Robots are discs of the
body's radius. The walls, dark and convex, hide nobody.
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

Shown = BoolArray | IntArray

_RADIUS = epuck.RADIUS_CM
_FORWARD = epuck.CAMERA_FORWARD_CM


class Camera(NamedTuple):
    """Where a camera's pixels look; angles are left of straight ahead."""

    first: int
    """The first pixel that is looked at, and the one after the last: the central window."""
    end: int
    left_rad: float
    """Angle of the middle of pixel 0."""
    pixels_per_rad: float
    """Pixels, to the right, in one radian."""
    half_view_rad: float
    """No pixel that is looked at is farther from straight ahead."""
    range_cm: float
    """Surfaces beyond it are not seen."""
    cos: FloatArray
    """(pixels,) the pixels' directions in the body's frame."""
    sin: FloatArray


def make_camera(pixels: int, field_of_view_rad: float, central_pixels: int, range_cm: float = math.inf) -> Camera:
    """Return the camera whose `pixels` share the field of view; only the `central_pixels` are looked at."""
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
    shown: Shown,
    circles: FloatArray,
    edges: FloatArray,
    cells: CellList,
    camera: Camera,
    observer: int,
    rows: IntArray,
) -> None:
    """Write the rows that the robots from number `observer` on see, one a row of (observers, pixels) `rows`.

    poses: (robots, 3) x cm, y cm, heading rad; shown: (robots,) what a pixel holds that meets this robot, 0 if it is
    dark (of the line camera: whose ring is on); circles (k, 3), edges (m, 4): see `arena.Arena`; cells: sorted by
    poses. Pixels outside the central window are 0.
    """
    rows[:] = 0
    lit = np.flatnonzero(shown)
    if len(lit) == 0:
        return
    depth = np.empty(rows.shape[1])
    for row in range(len(rows)):
        robot = observer + row
        if not _is_any_in_view(poses, lit, camera, robot):
            continue  # nothing red to see: most of the time, where robots are few
        if _see_robots(poses, shown, cells, camera, robot, rows[row], depth):
            _hide_behind_obstacles(poses[robot], circles, edges, camera, rows[row], depth)


@jit
def _view(pose: FloatArray, cos: float, sin: float, camera: Camera, left: int, right: int) -> FieldOfView:
    """Return what a robot's camera views from pixel `left` to pixel `right`; cos, sin: of its heading."""
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
    """Whether any of `others`, numbers of robots, may reach into a robot's field of view."""
    cos, sin = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
    view = _view(poses[robot], cos, sin, camera, camera.first, camera.end - 1)
    for other in others:
        if other != robot and may_contain_disc(view, poses[other, 0] - view.x, poses[other, 1] - view.y, _RADIUS):
            return True
    return False


@jit
def _see_robots(
    poses: FloatArray, shown: Shown, cells: CellList, camera: Camera, robot: int, row: IntArray, depth: FloatArray
) -> bool:
    """Write what one robot sees of the others, and the distances; return whether any of them is lit.

    Cells are visited in squares around the camera, from near to far, until what is left lies behind what was seen.
    """
    cos, sin = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
    depth[camera.first : camera.end] = camera.range_cm
    left, right = camera.first, camera.end - 1  # pixels beyond them see something nearer than what is to come
    view = _view(poses[robot], cos, sin, camera, left, right)
    column = cell_index(view.x, cells.width_cm, cells.columns)
    line = cell_index(view.y, cells.height_cm, cells.rows)
    half_cell = 0.5 * math.hypot(cells.width_cm, cells.height_cm)
    any_lit = False
    for ring in range(max(cells.columns, cells.rows)):
        west, east = visible_cells(view.left_x, view.right_x, view.wide, column, ring, cells.columns)
        south, north = visible_cells(view.left_y, view.right_y, view.wide, line, ring, cells.rows)
        any_in_view = False
        for r in range(south, north):
            inside = line - ring < r < line + ring
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
                        any_lit |= _see_disc(ahead, aside, shown[other], camera, row, depth)
        if not any_in_view:  # nor will there be any beyond
            return any_lit
        unseen = distance_outside(view.x, view.y, column, line, ring, cells) - _RADIUS
        while left <= right and depth[left] < unseen:
            left += 1
        while left <= right and depth[right] < unseen:
            right -= 1
        if left > right:
            return any_lit
        view = _view(poses[robot], cos, sin, camera, left, right)
    return any_lit


@jit
def _see_disc(ahead: float, aside: float, shown: int, camera: Camera, row: IntArray, depth: FloatArray) -> bool:
    """Write a robot's disc, centred at (ahead, aside) of the camera, where it is nearest; return whether as lit."""
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
            if reach < depth[pixel] or (reach == depth[pixel] and shown > row[pixel] and reach < math.inf):
                depth[pixel] = reach
                row[pixel] = shown
                any_lit |= shown > 0
    return any_lit


@jit
def _hide_behind_obstacles(
    pose: FloatArray, circles: FloatArray, edges: FloatArray, camera: Camera, row: IntArray, depth: FloatArray
) -> None:
    """Darken the lit pixels before which an obstacle stands."""
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
