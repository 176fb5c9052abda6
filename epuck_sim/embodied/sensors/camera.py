"""The line camera: from poses and lit rings to rows of pixels, with exact occlusion (thesis 4.1.1).

Pixel i of n looks along one ray, the middle of its share of the field of view; index 0 is the left edge, as in a
picture. The nearest surface on the ray decides the pixel: a lit ring is red, all else is dark. Robots are discs, as
large as their bodies. The walls are dark, and the floor they bound is convex, so that they hide no robot.

Most rings are dark most of the time. Where few are lit, these are drawn first, as if there were no others. Other robots
can only hide them, so the search for those skips all other pixels, and ends at the distance of the lit ones.

A wall mirrors a ray once. A camera sees what the ray then meets beyond the wall, at the length of the whole path. So
the images in a wall are the view of a mirrored camera beyond it, with left and right exchanged. The camera sees them in
pixels whose rays meet neither a robot nor an obstacle before the wall.

A camera may take fewer pictures than there are control steps, and deliver them late (thesis 4.3.1): at instants of its
own, `interval` control steps apart, the first at a random time. A picture shows the control step in which its instant
lies. The controller receives it after a random latency.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from epuck_sim import elementary
from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.embodied.sensors import sight
from epuck_sim.embodied.swarm import INT64, KEEP, Swarm, copy_array, swarm_at
from epuck_sim.scenario.robot_kind import RobotKind
from epuck_sim.scenario.robots import CameraSection
from epuck_sim.util.elementary import sin_cos
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import array_at
from epuck_sim.util.rng import uniform

NEVER = -2  # control step in which a picture arrives, as long as a camera has taken none

_LEFT, _RIGHT, _LOWER, _UPPER = range(4)

FEW_LIT = 8  # measured: to draw the lit first is as fast as to search for all robots at once if lit^2 = 8 robots


def set_camera(record: Any, rays: Any, section: CameraSection, kind: RobotKind, control_hz: float) -> None:
    """Set CAMERA, and (pixels,) RAY, of a group by its section of a scenario."""
    pixels, central = section.pixels, section.central_pixels or section.pixels
    pitch = math.radians(section.field_of_view_deg) / pixels
    angles = math.radians(section.field_of_view_deg) / 2 - pitch * (np.arange(pixels) + 0.5)
    rays["sin"], rays["cos"] = np.transpose([elementary.sin_cos(angle) for angle in angles.tolist()])
    record.first = (pixels - central) // 2
    record.end = record.first + central
    record.left_rad = angles[0]
    record.pixels_per_rad = 1 / pitch
    record.half_view_rad = half_view_rad(section)
    record.range_cm = section.range_cm or math.inf
    record.reflection_range_cm = section.reflection_range_cm
    record.forward_cm = kind.camera_forward_cm
    record.interval = 0 if section.frames_per_s is None else control_hz / section.frames_per_s
    record.latency = section.latency_ms * control_hz / 1000


def half_view_rad(section: CameraSection) -> float:
    """Return the largest angle between straight ahead and the edge of a camera's central window."""
    pitch = math.radians(section.field_of_view_deg) / section.pixels
    return (section.central_pixels or section.pixels) * pitch / 2


class Eye(NamedTuple):
    """A camera at work."""

    robot: int  # number of the robot that has it, which it does not see
    x: float  # cm
    y: float  # cm
    cos: float  # cosine of the robot's heading
    sin: float


class Picture(NamedTuple):
    """A camera's picture while it is being taken."""

    rays: Any  # (pixels,) RAY: where pixels look
    labels: IntArray  # (robots,) value of a pixel that shows the robot
    row: IntArray  # (pixels,) label of the nearest surface
    depth: FloatArray  # (pixels,) cm: a nearer surface changes the pixel; -inf where nothing can change it


@jit_no_alloc
def look(block: ByteArray, addresses: IntArray, number: int) -> None:
    """Write what the cameras of a group have in view, and whose rings they see where `KEEP` says."""
    swarm = swarm_at(block)
    group = swarm.groups[number]
    rows = swarm.pixels[group.in_view : group.in_view + group.count * group.pixels]
    for pixel in range(len(rows)):
        rows[pixel] = 0
    lit = sight.find_lit(swarm)
    at = addresses[KEEP]
    words = array_at(block, at, at + 16, INT64)
    kept = array_at(block, at + 16, at + 16 + 8 * words[1], INT64)
    for place in range(lit if at != 0 else 0):  # labels that tell the lit robots apart
        swarm.numbers[len(swarm.robots) + swarm.numbers[place]] += swarm.numbers[place]
    for place in range(group.count):
        if swarm.scene[0].hides_flashes:
            lit = sight.find_visible(block, addresses, swarm, group.first + place)
        row = rows[place * group.pixels : (place + 1) * group.pixels]
        is_red = lit > 0 and see(swarm, group, group.first + place, lit, row)
        if is_red and at != 0:
            words[0] = list_seen(swarm.scene[0].step, group.first + place, row, kept, words[0])
            for pixel in range(group.pixels):
                row[pixel] = min(row[pixel], 1)


@jit_inline
def see(swarm: Swarm, group: Any, robot: int, lit: int, row: IntArray) -> bool:
    """Write to `row`, zeros, the label of the robot each pixel shows, see `find_lit`; return whether any may show."""
    camera = group.camera
    eye = eye_of(swarm, robot, camera)
    robots = len(swarm.robots)
    rays, labels = swarm.rays[group.ray : group.ray + group.pixels], swarm.numbers[robots : 2 * robots]
    picture = Picture(rays, labels, row, swarm.depths)
    for pixel in range(camera.first, camera.end):
        picture.depth[pixel] = camera.range_cm
    few_lit = lit * lit <= FEW_LIT * robots
    if few_lit and not see_lit(swarm, lit, camera, eye, picture):
        return False  # nothing red to see: most of the time, where robots are few
    see_sectors(swarm, camera, eye, picture)
    hide_behind_obstacles(swarm, camera, eye, picture)
    return True


@jit_inline
def list_seen(step: int, robot: int, row: IntArray, found: IntArray, count: int) -> int:
    """Add the robots that a row shows by numbers from 1, each once and from left to right, as `add_pair` does."""
    last = 0
    for pixel in range(len(row)):
        if row[pixel] in (0, last):
            continue
        last, first = row[pixel], 0
        while row[first] != last:
            first += 1
        if first == pixel:  # else it showed before, to the left of an obstacle
            count = sight.add_pair(step, robot, last - 1, found, count)
    return count


@jit_inline
def eye_of(swarm: Swarm, number: int, camera: Any) -> Eye:
    """Return a robot's camera where it is."""
    robot = swarm.robots[number]
    sin, cos = sin_cos(robot.heading)
    return Eye(number, robot.x + camera.forward_cm * cos, robot.y + camera.forward_cm * sin, cos, sin)


@jit_inline
def view_between(camera: Any, eye: Eye, rays: Any, left: int, right: int, largest_cm: float) -> sight.FieldOfView:
    """Return a camera's field of view from pixel `left` to pixel `right`; largest_cm: radius of the largest robot."""
    first, last = rays[left], rays[right]
    return sight.FieldOfView(
        eye.x,
        eye.y,
        eye.cos * first.cos - eye.sin * first.sin,
        eye.sin * first.cos + eye.cos * first.sin,
        eye.cos * last.cos - eye.sin * last.sin,
        eye.sin * last.cos + eye.cos * last.sin,
        right - left >= camera.pixels_per_rad * math.pi,
        largest_cm + sight.SLACK_CM,
    )


@jit_inline
def see_lit(swarm: Swarm, lit: int, camera: Any, eye: Eye, picture: Picture) -> bool:
    """Draw the listed robots as if there were no others, and close pixels that show none; return whether any shows."""
    view = view_between(camera, eye, picture.rays, camera.first, camera.end - 1, swarm.scene[0].largest_cm)
    any_lit = False
    for place in range(lit):
        number = swarm.numbers[place]
        robot = swarm.robots[number]
        dx, dy = robot.x - eye.x, robot.y - eye.y
        if number != eye.robot and sight.may_contain_robot(view, dx, dy):
            label, last = picture.labels[number], camera.end - 1
            any_lit |= add_robot(dx, dy, robot.radius_cm, label, camera, eye, camera.first, last, picture)
    if any_lit:
        for pixel in range(camera.first, camera.end):
            if picture.row[pixel] == 0:
                picture.depth[pixel] = -math.inf
    return any_lit


@jit_inline
def see_sectors(swarm: Swarm, camera: Any, eye: Eye, picture: Picture) -> None:
    """Draw all robots in a picture, sector by sector, leaving out pixels that cannot change any more."""
    pixels = max(1, int(sight.SECTOR_RAD * camera.pixels_per_rad))
    left = camera.first
    while left < camera.end:
        if picture.depth[left] < 0.0:
            left += 1
            continue
        right, end = left, min(left + pixels, camera.end)
        while right + 1 < end and picture.depth[right + 1] >= 0.0:
            right += 1
        _see_sector(swarm, camera, eye, left, right, picture)
        left = right + 1


@jit_inline
def _see_sector(swarm: Swarm, camera: Any, eye: Eye, left: int, right: int, picture: Picture) -> None:
    """Draw all robots in some pixels, strip by strip from near to far, until all remaining ones must be hidden."""
    scene = swarm.scene[0]
    view = view_between(camera, eye, picture.rays, left, right, scene.largest_cm)
    strips = sight.make_strips(view, scene)
    wedge = sight.make_wedge(view, strips)
    strip = strips.first
    while 0 <= strip < strips.total:
        cell, spans, length = sight.cells_in_strip(view, wedge, strips, strip, scene)
        for span in range(spans):
            start = cell + span * scene.columns
            for place in range(swarm.cells[start], swarm.cells[start + length]):
                member = swarm.members[place]
                dx, dy = member.x - eye.x, member.y - eye.y
                if sight.may_contain_robot(view, dx, dy) and member.robot != eye.robot:
                    label = picture.labels[member.robot]
                    add_robot(dx, dy, member.radius_cm, label, camera, eye, left, right, picture)
        unseen = sight.distance_beyond(wedge, strips, strip)
        outer = right - left
        while left <= right and picture.depth[left] < unseen:
            left += 1
        while left <= right and picture.depth[right] < unseen:
            right -= 1
        if left > right:
            return
        if right - left < outer:
            view = view_between(camera, eye, picture.rays, left, right, scene.largest_cm)
            wedge = sight.make_wedge(view, strips)
        strip += strips.step


@jit_inline
def add_robot(
    dx: float, dy: float, radius: float, label: int, camera: Any, eye: Eye, left: int, right: int, picture: Picture
) -> bool:
    """Write a label where a robot at (dx, dy) from the camera is nearest so far; return whether it shows, lit."""
    ahead, aside = dx * eye.cos + dy * eye.sin, dy * eye.cos - dx * eye.sin
    row, depth, rays = picture.row, picture.depth, picture.rays
    distance = math.sqrt(ahead * ahead + aside * aside)
    nearest = distance - radius - 1e-9
    width = sight.angular_radius_bound(distance, radius)
    spread = (width + 2.0 * sight.ATAN2_ERROR_RAD) * camera.pixels_per_rad
    direction = sight.fast_atan2(ahead, aside)
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
            reach = sight.to_disc(0.0, 0.0, rays[pixel].cos, rays[pixel].sin, ahead, aside, radius)
            if reach < depth[pixel] or (reach == depth[pixel] and label > row[pixel] and reach < math.inf):
                depth[pixel] = reach
                row[pixel] = label
                any_lit |= label > 0
    return any_lit


@jit_inline
def hide_behind_obstacles(swarm: Swarm, camera: Any, eye: Eye, picture: Picture) -> None:
    """Set pixels to 0 where an obstacle is nearer than the robot seen."""
    scene, row, depth = swarm.scene[0], picture.row, picture.depth
    if scene.circles + scene.edges == 0:
        return
    for pixel in range(camera.first, camera.end):
        if row[pixel] == 0:
            continue
        ray = picture.rays[pixel]
        dx = eye.cos * ray.cos - eye.sin * ray.sin
        dy = eye.sin * ray.cos + eye.cos * ray.sin
        for place in range(scene.circles):
            circle = swarm.circles[place]
            if sight.to_disc(eye.x, eye.y, dx, dy, circle.x, circle.y, circle.radius) < depth[pixel]:
                row[pixel] = 0
        for place in range(scene.edges):
            edge = swarm.edges[place]
            if sight.to_segment(eye.x, eye.y, dx, dy, edge.ax, edge.ay, edge.bx, edge.by) < depth[pixel]:
                row[pixel] = 0


class WallsInView(NamedTuple):
    """The walls that a camera's pixels look at, and in which lit rings are mirrored (thesis 4.4)."""

    numbers: IntArray  # (pixels,) wall at which the pixel's ray leaves the arena: 0 to 3 for left, right, lower, upper
    distances_cm: FloatArray  # (pixels,) along the ray; below 0 if a robot that pushes holds its camera beyond the wall


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
    lit = sight.find_lit(swarm)
    for place in range(group.count):
        if swarm.scene[0].hides_flashes:
            lit = sight.find_visible(block, addresses, swarm, group.first + place)
        if lit > 0:
            first = group.in_view + place * pixels
            picture = Picture(rays, dark, swarm.pixels[first : first + pixels], swarm.depths[:pixels])
            _reflect(swarm, group.camera, group.first + place, lit, walls, image, picture)


@jit_inline
def _reflect(
    swarm: Swarm, camera: Any, robot: int, lit: int, walls: WallsInView, image: Picture, picture: Picture
) -> None:
    """Add what a robot sees in the walls to its picture; walls and image are scratch."""
    scene = swarm.scene[0]
    eye = eye_of(swarm, robot, camera)
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
        see_sectors(swarm, camera, mirrored, image)
        hide_behind_obstacles(swarm, camera, mirrored, image)
        for pixel in range(camera.first, camera.end):
            if image.row[len(image.row) - 1 - pixel] > 0:
                picture.row[pixel] = 1
                picture.depth[pixel] = walls.distances_cm[pixel]
                any_image = True
    if any_image:  # hide it where something stands before the wall
        see_sectors(swarm, camera, eye, picture)
        hide_behind_obstacles(swarm, camera, eye, picture)


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
    """Clear the mirrored camera's picture, with left and right exchanged; return whether any pixel may show a ring."""
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
def begin_pictures(block: ByteArray, number: int) -> None:
    """Draw the times, in the first interval, at which the cameras of a group take their first pictures."""
    swarm = swarm_at(block)
    group = swarm.groups[number]
    for member in range(group.count):
        robot = swarm.robots[group.first + member]
        robot.first_picture = group.camera.interval * uniform(robot.signal_random)
        robot.picture_arrives = NEVER


@jit_no_alloc
def take_pictures(block: ByteArray, addresses: IntArray, number: int) -> None:  # noqa: ARG001
    """Take the pictures that are due from what is in view, and deliver those that arrive; call it after `look`."""
    swarm = swarm_at(block)
    group, step = swarm.groups[number], swarm.scene[0].step
    interval, latency = group.camera.interval, group.camera.latency
    for place in range(group.count):
        robot, first, length = swarm.robots[group.first + place], place * group.pixels, group.pixels
        row = swarm.pixels[group.row + first : group.row + first + length]
        in_view = swarm.pixels[group.in_view + first : group.in_view + first + length]
        waiting = swarm.pixels[group.waiting + first : group.waiting + first + length]
        robot.sensors.new_picture = robot.picture_arrives == step
        if robot.sensors.new_picture:
            copy_array(waiting, row)
        instant = robot.first_picture + robot.pictures * interval
        if instant < step + 1.0:
            robot.pictures += 1
            copy_array(in_view, waiting)
            robot.picture_arrives = int(instant + latency * uniform(robot.signal_random))
            if robot.picture_arrives == step:
                robot.sensors.new_picture = True
                copy_array(in_view, row)
