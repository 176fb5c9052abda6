"""Mirror images of lit rings in the four walls, as line cameras see them (thesis 4.4).

A wall mirrors a ray once: to a camera, what the ray meets then is as far as the whole way, and lies beyond the wall. So
the images in a wall are what a mirrored camera beyond it sees of the robots themselves, with left and right exchanged.
The camera sees them in pixels whose rays meet neither a robot nor an obstacle before the wall.
"""

import math
from typing import Any, NamedTuple

from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.embodied.sensors.camera import (
    FEW_LIT,
    Eye,
    Picture,
    eye_of,
    hide_behind_obstacles,
    see_lit,
    see_sectors,
)
from epuck_sim.embodied.sensors.lit_rings import find_lit, find_visible
from epuck_sim.embodied.swarm import Swarm, swarm_at
from epuck_sim.util.jit import jit_inline, jit_no_alloc

_LEFT, _RIGHT, _LOWER, _UPPER = range(4)


class WallsInView(NamedTuple):
    """The walls that a camera's pixels look at."""

    numbers: IntArray
    """(pixels,) wall at which the pixel's ray leaves the arena: 0 to 3 for left, right, lower, upper."""
    distances_cm: FloatArray
    """(pixels,) distance along the ray; below 0 if a robot that pushes holds its camera beyond the wall."""


@jit_no_alloc
def add_reflections(block: ByteArray, addresses: IntArray, number: int) -> None:
    """Add the lit rings that walls mirror to what the cameras of a group have in view; it follows `look`."""
    swarm = swarm_at(block)
    group, robots = swarm.groups[number], len(swarm.robots)
    pixels, scratch = group.pixels, swarm.numbers[2 * robots :]
    labels, dark = swarm.numbers[robots : 2 * robots], scratch[:robots]
    for robot in range(robots):
        dark[robot] = 0
    rays = swarm.rays[group.ray : group.ray + pixels]
    walls = WallsInView(scratch[robots : robots + pixels], swarm.depths[2 * pixels : 3 * pixels])
    image = Picture(rays, labels, scratch[robots + pixels : robots + 2 * pixels], swarm.depths[pixels : 2 * pixels])
    lit = find_lit(swarm.robots, swarm.numbers)
    for place in range(group.count):
        if swarm.scene[0].hides_flashes:
            lit = find_visible(block, addresses, group.first + place, robots, swarm.numbers)
        if lit > 0:
            first = group.in_view + place * pixels
            picture = Picture(rays, dark, swarm.pixels[first : first + pixels], swarm.depths[:pixels])
            _reflect(swarm, group.camera, group.first + place, lit, walls, image, picture)


@jit_inline
def _reflect(
    swarm: Swarm, camera: Any, robot: int, lit: int, walls: WallsInView, image: Picture, picture: Picture
) -> None:
    """Add what a robot sees in the walls to its picture; walls and image are scratch."""
    scene, cells, members, circles, edges = swarm.scene[0], swarm.cells, swarm.members, swarm.circles, swarm.edges
    eye = eye_of(swarm.robots[robot], robot, camera)
    find_walls(eye, camera, scene, picture.rays, walls)
    for pixel in range(len(picture.depth)):
        picture.depth[pixel] = -math.inf
    few_lit = lit * lit <= FEW_LIT * len(swarm.robots)
    any_image = False
    for wall in range(4):
        if not begin_image(wall, walls, camera, picture, image):
            continue
        mirrored = mirrored_in(wall, eye, scene)
        if few_lit and not see_lit(swarm, lit, camera, mirrored, image):
            continue
        see_sectors(scene, cells, members, camera, mirrored, image)
        hide_behind_obstacles(scene, circles, edges, camera, mirrored, image)
        any_image |= add_image(image, walls, camera, picture)
    if any_image:  # hide it where something stands before the wall
        see_sectors(scene, cells, members, camera, eye, picture)
        hide_behind_obstacles(scene, circles, edges, camera, eye, picture)


@jit_inline
def find_walls(eye: Eye, camera: Any, scene: Any, rays: Any, walls: WallsInView) -> None:
    """Find the wall that each pixel of the central window looks at."""
    for pixel in range(camera.first, camera.end):
        ray = rays[pixel]
        dx = eye.cos * ray.cos - eye.sin * ray.sin
        dy = eye.sin * ray.cos + eye.cos * ray.sin
        across, along = math.inf, math.inf
        if dx != 0.0:
            across = (scene.width_cm - eye.x if dx > 0.0 else -eye.x) / dx
        if dy != 0.0:
            along = (scene.height_cm - eye.y if dy > 0.0 else -eye.y) / dy
        if across < along:
            walls.numbers[pixel] = _RIGHT if dx > 0.0 else _LEFT
        else:
            walls.numbers[pixel] = _UPPER if dy > 0.0 else _LOWER
        walls.distances_cm[pixel] = min(across, along)


@jit_inline
def mirrored_in(wall: int, eye: Eye, scene: Any) -> Eye:
    """Return the mirror image of a camera; unlike the camera, it sees the robot whose camera it is."""
    x, y, cos, sin = eye.x, eye.y, eye.cos, eye.sin
    if wall in (_LEFT, _RIGHT):
        x, cos = (2.0 * scene.width_cm if wall == _RIGHT else 0.0) - x, -cos
    else:
        y, sin = (2.0 * scene.height_cm if wall == _UPPER else 0.0) - y, -sin
    return Eye(-1, x, y, cos, sin)


@jit_inline
def begin_image(wall: int, walls: WallsInView, camera: Any, picture: Picture, image: Picture) -> bool:
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


@jit_inline
def add_image(image: Picture, walls: WallsInView, camera: Any, picture: Picture) -> bool:
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
