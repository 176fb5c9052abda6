"""Mirror images of lit rings in the four walls, as line cameras see them (thesis 4.4).

A wall mirrors a ray once: to a camera, what the ray meets then is as far as the whole way, and lies beyond the wall. So
the images in a wall are what a mirrored camera beyond it sees of the robots themselves, with left and right exchanged.
The camera sees them in pixels whose rays meet neither a robot nor an obstacle before the wall.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.camera_pixels import Camera, Observer, Picture, hide_behind_obstacles
from epuck_sim.embodied.line_camera import are_few, observer_at, see, see_lit, see_sectors
from epuck_sim.embodied.sensing import SensingArrays
from epuck_sim.util.jit import jit, jit_no_alloc

_LEFT, _RIGHT, _LOWER, _UPPER = range(4)


class WallsInView(NamedTuple):
    """The walls that a camera's pixels look at."""

    numbers: IntArray
    """(pixels,) wall at which the pixel's ray leaves the arena: 0 to 3 for left, right, lower, upper."""
    distances_cm: FloatArray
    """(pixels,) distance along the ray; below 0 if a robot that pushes holds its camera beyond the wall."""


@jit
def see_with_reflections(group: SensingArrays, lit: BoolArray, observer: int, rows: IntArray) -> None:
    """Write the rows of pixels that some robots see, with the lit rings that walls mirror.

    Args:
        group: What the group with these robots senses with.
        lit: (robots,) whether each ring is lit.
        observer: Number of the first robot that observes.
        rows: (observers, pixels) one row for each of the robots from `observer` on, 1 where red; written.
    """
    see(group.poses, lit, group.circles, group.edges, group.cells, group.camera, observer, rows)
    numbers = np.flatnonzero(lit)
    if len(numbers) == 0:
        return
    camera, cells, circles, edges = group.camera, group.cells, group.circles, group.edges
    pixels = rows.shape[1]
    few_lit = are_few(len(numbers), len(lit))
    dark = np.zeros(len(lit), np.bool_)
    walls = WallsInView(np.empty(pixels, np.int64), np.empty(pixels))
    depth = np.empty(pixels)
    image = Picture(np.empty(pixels, np.int64), np.empty(pixels))
    for row in range(len(rows)):
        eye = observer_at(group.poses, observer + row)
        picture = Picture(rows[row], depth)
        find_walls(eye, camera, group.width_cm, group.height_cm, walls)
        depth[:] = -math.inf
        any_image = False
        for wall in range(4):
            if not begin_image(wall, walls, camera, picture, image):
                continue
            mirrored = mirrored_in(wall, eye, group.width_cm, group.height_cm)
            if few_lit and not see_lit(group.poses, lit, numbers, camera, mirrored, image):
                continue
            see_sectors(lit, cells, camera, mirrored, image)
            hide_behind_obstacles(circles, edges, camera, mirrored, image)
            any_image |= add_image(image, walls, camera, picture)
        if any_image:  # hide it where something stands before the wall
            see_sectors(dark, cells, camera, eye, picture)
            hide_behind_obstacles(circles, edges, camera, eye, picture)


@jit_no_alloc
def find_walls(eye: Observer, camera: Camera, width_cm: float, height_cm: float, walls: WallsInView) -> None:
    """Find the wall that each pixel of the central window looks at."""
    for pixel in range(camera.first, camera.end):
        dx = eye.cos * camera.cos[pixel] - eye.sin * camera.sin[pixel]
        dy = eye.sin * camera.cos[pixel] + eye.cos * camera.sin[pixel]
        across, along = math.inf, math.inf
        if dx != 0.0:
            across = (width_cm - eye.x if dx > 0.0 else -eye.x) / dx
        if dy != 0.0:
            along = (height_cm - eye.y if dy > 0.0 else -eye.y) / dy
        if across < along:
            walls.numbers[pixel] = _RIGHT if dx > 0.0 else _LEFT
        else:
            walls.numbers[pixel] = _UPPER if dy > 0.0 else _LOWER
        walls.distances_cm[pixel] = min(across, along)


@jit_no_alloc
def mirrored_in(wall: int, eye: Observer, width_cm: float, height_cm: float) -> Observer:
    """Return the mirror image of a camera; unlike the camera, it sees the robot whose camera it is."""
    x, y, cos, sin = eye.x, eye.y, eye.cos, eye.sin
    if wall in (_LEFT, _RIGHT):
        x, cos = (2.0 * width_cm if wall == _RIGHT else 0.0) - x, -cos
    else:
        y, sin = (2.0 * height_cm if wall == _UPPER else 0.0) - y, -sin
    return Observer(-1, x, y, cos, sin)


@jit_no_alloc
def begin_image(wall: int, walls: WallsInView, camera: Camera, picture: Picture, image: Picture) -> bool:
    """Empty the picture that the camera's mirror image in a wall takes; its first pixel is the camera's last.

    Returns:
        Whether any pixel may show an image: it looks at the wall, which is within range, and is not red yet.
    """
    last = len(picture.row) - 1
    any_open = False
    for pixel in range(camera.first, camera.end):
        is_near = walls.distances_cm[pixel] < camera.reflection_range_cm
        is_open = walls.numbers[pixel] == wall and is_near and picture.row[pixel] == 0
        image.row[last - pixel] = 0
        image.depth[last - pixel] = camera.reflection_range_cm if is_open else -math.inf
        any_open |= is_open
    return any_open


@jit_no_alloc
def add_image(image: Picture, walls: WallsInView, camera: Camera, picture: Picture) -> bool:
    """Write the lit rings in a mirrored picture to the camera's own; its depth there is the distance of the wall.

    Returns:
        Whether there are any.
    """
    last = len(picture.row) - 1
    any_lit = False
    for pixel in range(camera.first, camera.end):
        if image.row[last - pixel] > 0:
            picture.row[pixel] = 1
            picture.depth[pixel] = walls.distances_cm[pixel]
            any_lit = True
    return any_lit
