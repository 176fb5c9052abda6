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
Pixels = npt.NDArray[np.int64]

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
        1 / pitch,
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
    lit = np.flatnonzero(ring_on)
    if len(lit) == 0:
        return
    depth = np.empty(rows.shape[1])
    for row in range(len(rows)):
        robot = observer + row
        if not _is_any_in_view(poses, lit, camera, robot):
            continue  # nothing red to see: most of the time, where robots are few
        if _see_robots(poses, ring_on, cells, camera, robot, rows[row], depth):
            _hide_behind_obstacles(poses[robot], circles, edges, camera, rows[row], depth)


class View(NamedTuple):
    """The part of the floor between the rays of two pixels, as seen from (x, y)."""

    x: float
    y: float
    left_x: float
    left_y: float
    right_x: float
    right_y: float
    """Directions of the leftmost and the rightmost ray."""
    wide: bool
    """Whether they are half a turn apart or more; then nothing is ruled out."""


@kernel
def _view(pose: Floats, camera: Camera, left: int, right: int) -> View:
    """Return what a robot's camera views from pixel `left` to pixel `right`."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return View(
        pose[0] + _FORWARD * cos,
        pose[1] + _FORWARD * sin,
        cos * camera.cos[left] - sin * camera.sin[left],
        sin * camera.cos[left] + cos * camera.sin[left],
        cos * camera.cos[right] - sin * camera.sin[right],
        sin * camera.cos[right] + cos * camera.sin[right],
        right - left >= camera.pixels_per_rad * math.pi,
    )


@kernel
def _may_hold(view: View, dx: float, dy: float, radius: float) -> bool:
    """Whether a disc at (dx, dy) from the camera may reach into the view; never False for one that does."""
    beyond_left = dy * view.left_x - dx * view.left_y
    beyond_right = dx * view.right_y - dy * view.right_x
    return view.wide or max(beyond_left, beyond_right) <= radius


@kernel
def _is_any_in_view(poses: Floats, others: npt.NDArray[np.int64], camera: Camera, robot: int) -> bool:
    """Whether any of `others`, numbers of robots, may reach into a robot's field of view."""
    view = _view(poses[robot], camera, camera.first, camera.end - 1)
    for other in others:
        if other != robot and _may_hold(view, poses[other, 0] - view.x, poses[other, 1] - view.y, _RADIUS):
            return True
    return False


@kernel
def _see_robots(
    poses: Floats, ring_on: Bools, cells: Cells, camera: Camera, robot: int, row: Pixels, depth: Floats
) -> bool:
    """Write what one robot sees of the others, and the distances; return whether anything is red.

    Cells are visited in squares around the camera, from near to far, until what is left lies behind what was seen.
    """
    cos, sin = math.cos(poses[robot, 2]), math.sin(poses[robot, 2])
    depth[camera.first : camera.end] = camera.range_cm
    left, right = camera.first, camera.end - 1  # pixels beyond them see something nearer than what is to come
    view = _view(poses[robot], camera, left, right)
    column = slot(view.x, cells.width_cm, cells.columns)
    line = slot(view.y, cells.height_cm, cells.rows)
    half_cell = 0.5 * math.hypot(cells.width_cm, cells.height_cm)
    red = False
    for ring in range(max(cells.columns, cells.rows)):
        west, east = _span(view.left_x, view.right_x, view.wide, column, ring, cells.columns)
        south, north = _span(view.left_y, view.right_y, view.wide, line, ring, cells.rows)
        any_in_view = False
        for r in range(south, north):
            inside = line - ring < r < line + ring
            for c in range(column - ring, column + ring + 1, 2 * ring if inside else 1):
                if c < west or c >= east:
                    continue
                dx, dy = (c + 0.5) * cells.width_cm - view.x, (r + 0.5) * cells.height_cm - view.y
                if not _may_hold(view, dx, dy, half_cell + _RADIUS):
                    continue
                any_in_view = True
                cell = r * cells.columns + c
                for member in range(cells.first[cell], cells.first[cell + 1]):
                    other = cells.members[member]
                    dx, dy = poses[other, 0] - view.x, poses[other, 1] - view.y
                    if other != robot and _may_hold(view, dx, dy, _RADIUS):
                        ahead, aside = dx * cos + dy * sin, dy * cos - dx * sin
                        red |= _see_disc(ahead, aside, ring_on[other], camera, row, depth)
        if not any_in_view:  # nor will there be any beyond
            return red
        unseen = _distance_beyond(view.x, view.y, column, line, ring, cells) - _RADIUS
        while left <= right and depth[left] < unseen:
            left += 1
        while left <= right and depth[right] < unseen:
            right -= 1
        if left > right:
            return red
        view = _view(poses[robot], camera, left, right)
    return red


@kernel
def _span(left: float, right: float, wide: bool, here: int, ring: int, slots: int) -> tuple[int, int]:
    """Return the first column (or row) up to `ring` away that the view may hold, and the one after the last.

    left, right: the components of the view's outermost rays along the columns. Where neither points backwards, a robot
    that is seen may still have its centre in the column before.
    """
    low = here - (ring if wide or min(left, right) < 0.0 else min(ring, 1))
    high = here + (ring if wide or max(left, right) > 0.0 else min(ring, 1))
    return max(low, 0), min(high + 1, slots)


@kernel
def _distance_beyond(x: float, y: float, column: int, line: int, ring: int, cells: Cells) -> float:
    """Return how far, at least, a point of the arena outside the square of cells up to `ring` is from (x, y)."""
    distance = math.inf
    if column - ring > 0:
        distance = min(distance, x - (column - ring) * cells.width_cm)
    if column + ring < cells.columns - 1:
        distance = min(distance, (column + ring + 1) * cells.width_cm - x)
    if line - ring > 0:
        distance = min(distance, y - (line - ring) * cells.height_cm)
    if line + ring < cells.rows - 1:
        distance = min(distance, (line + ring + 1) * cells.height_cm - y)
    return distance


@kernel
def _half_width(distance: float) -> float:
    """Return an angle no smaller than half of what a robot at `distance` covers, asin(radius / distance)."""
    if distance <= _RADIUS:
        return math.pi
    share = _RADIUS / distance
    return share + (0.5 * math.pi - 1.0) * share * share * share


@kernel
def _bearing(ahead: float, aside: float) -> float:
    """Return atan2(aside, ahead) to 1e-5 in a fifth of its time (Abramowitz and Stegun 4.4.49)."""
    x, y = abs(ahead), abs(aside)
    longer = max(x, y)
    if longer == 0.0:
        return 0.0
    slope = min(x, y) / longer
    square = slope * slope
    angle = slope * (
        0.9998660 + square * (-0.3302995 + square * (0.1801410 + square * (-0.0851330 + square * 0.0208351)))
    )
    if y > x:
        angle = 0.5 * math.pi - angle
    if ahead < 0.0:
        angle = math.pi - angle
    return angle if aside >= 0.0 else -angle


@kernel
def _see_disc(ahead: float, aside: float, lit: bool, camera: Camera, row: Pixels, depth: Floats) -> bool:
    """Write a robot's disc, centred at (ahead, aside) of the camera, where it is nearest; return whether in red."""
    distance = math.sqrt(ahead * ahead + aside * aside)
    nearest = distance - _RADIUS - 1e-9
    half_width = _half_width(distance)
    bearing = _bearing(ahead, aside)
    # a disc behind the camera may show at both ends of a row that looks nearly all round
    round_about = 1 if half_width + camera.half_view_rad >= math.pi else 0
    red = False
    for turn in range(-round_about, round_about + 1):
        middle = (camera.left_rad - bearing - turn * 2.0 * math.pi) * camera.pixels_per_rad
        spread = half_width * camera.pixels_per_rad + 1.0
        low = max(int(middle - spread), camera.first)
        high = min(int(middle + spread) + 1, camera.end)
        for pixel in range(low, high):
            if depth[pixel] < nearest:
                continue
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
