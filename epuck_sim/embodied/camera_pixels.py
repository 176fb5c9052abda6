"""The pixels of a line camera: where each looks, and what a robot or an obstacle changes in a picture.

Each pixel looks along one ray. The nearest surface on the ray decides the pixel.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.embodied.field_of_view import ATAN2_ERROR_RAD, FieldOfView, angular_radius_bound, fast_atan2
from epuck_sim.embodied.ray_casting import to_disc, to_segment
from epuck_sim.util.jit import jit, jit_inline

_RADIUS = epuck.RADIUS_CM


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
    reflection_range_cm: float
    """Longest way in cm, by a wall to a ring, on which the ring's reflection is seen; 0 if walls reflect nothing."""
    cos: FloatArray
    """(pixels,) cosines of the pixels' directions in the body's frame."""
    sin: FloatArray
    """(pixels,) sines of the pixels' directions in the body's frame."""


def make_camera(
    pixels: int,
    field_of_view_rad: float,
    central_pixels: int,
    range_cm: float = math.inf,
    reflection_range_cm: float = 0.0,
) -> Camera:
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
        reflection_range_cm,
        np.cos(angles),
        np.sin(angles),
    )


class Observer(NamedTuple):
    """A robot that looks about."""

    robot: int
    """Its number."""
    x: float
    """x of its camera in cm."""
    y: float
    """y of its camera in cm."""
    cos: float
    """Cosine of its heading."""
    sin: float
    """Sine of its heading."""


class Picture(NamedTuple):
    """What a robot sees so far."""

    row: IntArray
    """(pixels,) label of the nearest surface."""
    depth: FloatArray
    """(pixels,) distance in cm within which a surface would be nearer; -inf where nothing can change the pixel."""


@jit_inline
def view_between(eye: Observer, camera: Camera, left: int, right: int) -> FieldOfView:
    """Return a robot's field of view from pixel `left` to pixel `right`."""
    return FieldOfView(
        eye.x,
        eye.y,
        eye.cos * camera.cos[left] - eye.sin * camera.sin[left],
        eye.sin * camera.cos[left] + eye.cos * camera.sin[left],
        eye.cos * camera.cos[right] - eye.sin * camera.sin[right],
        eye.sin * camera.cos[right] + eye.cos * camera.sin[right],
        right - left >= camera.pixels_per_rad * math.pi,
    )


@jit_inline
def add_robot(
    dx: float, dy: float, label: int, camera: Camera, eye: Observer, left: int, right: int, picture: Picture
) -> bool:
    """Write the label of a robot at (dx, dy) from the camera to the pixels that it is nearest in so far.

    Returns:
        Whether any pixel from `left` to `right` now shows it, and its label is not 0.
    """
    ahead, aside = dx * eye.cos + dy * eye.sin, dy * eye.cos - dx * eye.sin
    row, depth = picture.row, picture.depth
    distance = math.sqrt(ahead * ahead + aside * aside)
    nearest = distance - _RADIUS - 1e-9
    width = angular_radius_bound(distance)
    spread = (width + 2.0 * ATAN2_ERROR_RAD) * camera.pixels_per_rad
    direction = fast_atan2(ahead, aside)
    # a disc behind the camera may show at both ends of a row that looks nearly all round
    round_about = 1 if width + camera.half_view_rad >= math.pi else 0
    any_lit = False
    for turn in range(-round_about, round_about + 1):
        middle = (camera.left_rad - direction - turn * 2.0 * math.pi) * camera.pixels_per_rad
        first = max(math.ceil(middle - spread), left)
        end = min(math.floor(middle + spread), right) + 1
        for pixel in range(first, end):
            if depth[pixel] < nearest:
                continue
            reach = to_disc(0.0, 0.0, camera.cos[pixel], camera.sin[pixel], ahead, aside, _RADIUS)
            if reach < depth[pixel] or (reach == depth[pixel] and label > row[pixel] and reach < math.inf):
                depth[pixel] = reach
                row[pixel] = label
                any_lit |= label > 0
    return any_lit


@jit
def hide_behind_obstacles(
    circles: FloatArray, edges: FloatArray, camera: Camera, eye: Observer, picture: Picture
) -> None:
    """Set pixels to 0 where an obstacle is nearer than the robot seen."""
    for pixel in range(camera.first, camera.end):
        if picture.row[pixel] == 0:
            continue
        dx = eye.cos * camera.cos[pixel] - eye.sin * camera.sin[pixel]
        dy = eye.sin * camera.cos[pixel] + eye.cos * camera.sin[pixel]
        for circle in circles:
            if to_disc(eye.x, eye.y, dx, dy, circle[0], circle[1], circle[2]) < picture.depth[pixel]:
                picture.row[pixel] = 0
        for edge in edges:
            if to_segment(eye.x, eye.y, dx, dy, edge[0], edge[1], edge[2], edge[3]) < picture.depth[pixel]:
                picture.row[pixel] = 0
