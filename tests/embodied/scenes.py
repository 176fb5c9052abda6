"""Scenes to try the sensors on, and slow twins of the sensors.

The twins are written from the facts about the robot alone. They cast each ray on each surface, in the frame of the
world, and report which rays run within `EDGE_CM` of a decision, which rounding may reverse.
"""

import math
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from hypothesis import assume, strategies as st

from epuck_sim.arena import Arena, clearance_cm, make_arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.cells import sort_into_cells
from epuck_sim.embodied.layout import room_for, set_arena, set_bodies
from epuck_sim.embodied.sensors.camera import add_reflections, look, set_camera
from epuck_sim.embodied.sensors.infrared import sense_infrared, set_infrared
from epuck_sim.embodied.swarm import KEEP, make_block, open_block
from epuck_sim.geometry import box_corners
from epuck_sim.scenario.robot_kind import CameraMount, ProximitySection, RobotKind, cell_cm
from epuck_sim.scenario.robots import CameraSection, InfraredSection, RobotGroup

RADIUS_CM = 3.7
EDGE_CM = 1e-9
SEEDS = st.integers(0, 2**32 - 1)

_RIGHT = np.array([(3.35, -1.05, -18), (2.30, -2.60, -45), (0.00, -3.30, -90), (-3.00, -1.80, -142)])
SENSORS = np.vstack([_RIGHT, _RIGHT[::-1] * (1, -1, -1)])  # (8, 3) x cm, y cm, direction in degrees


def kind_of(radius_cm, forward_cm, sensors, spread_deg, *response) -> RobotKind:
    named = dict(zip(("range_cm", "peak_counts", "peak_cm", "width_cm2"), response, strict=True))
    infrared = ProximitySection(sensors=list(map(tuple, sensors.tolist())), spread_deg=spread_deg, **named)
    camera = CameraMount(forward_cm=forward_cm)
    return RobotKind(radius_cm=radius_cm, wheel_base_cm=radius_cm, camera=camera, infrared=infrared)


E_PUCK = kind_of(RADIUS_CM, RADIUS_CM, SENSORS, 15, 12, 3731, 0.3, 0.7)  # by the facts
FEW = np.array([(1.5, 0.4, 10.0), (-1.0, -1.2, -140.0), (0.2, 1.6, 95.0)])
SMALL = kind_of(1.65, 0.5, FEW, 25, 7, 900, 0.5, 1.5)
LARGE = kind_of(6.0, 4.0, np.array([(5.5, 2.0, 20.0), (-5.9, 0.0, 180.0)]), 5, 21, 4500, 0.0, 3.0)
BODIES = (E_PUCK, SMALL, LARGE)


class Scene(NamedTuple):
    poses: FloatArray  # (robots, 3) x cm, y cm, heading rad
    lit: BoolArray  # (robots,) whether each ring is on
    arena: Arena
    body: RobotKind = E_PUCK  # the kind whose sensors they have
    others_cm: FloatArray | None = None  # (robots,) radius of each, where that is not the kind's

    @property
    def radii_cm(self) -> FloatArray:
        return np.full(len(self.poses), self.body.radius_cm) if self.others_cm is None else self.others_cm

    @property
    def discs(self) -> FloatArray:
        """(robots, 3) x, y, radius of each body, cm."""
        return np.column_stack([self.poses[:, :2], self.radii_cm])


class CameraSettings(NamedTuple):
    pixels: int = 60
    field_of_view_deg: float = 56.0
    central_pixels: int = 60
    range_cm: float = math.inf
    reflection_range_cm: float = 0.0

    def section(self) -> CameraSection:
        """Return what a scenario says of it, checks left out: some tests look farther by walls than straight ahead."""
        given = self._asdict() | {"range_cm": None if self.range_cm == math.inf else self.range_cm}
        return CameraSection.model_construct(**given, frames_per_s=None, latency_ms=0.0)

    def angles(self) -> FloatArray:
        """Return rad: directions of the middles of the pixels, left of straight ahead, from left to right."""
        return np.radians(self.field_of_view_deg * (0.5 - (np.arange(self.pixels) + 0.5) / self.pixels))

    def window(self) -> slice:
        outside = (self.pixels - self.central_pixels) // 2
        return slice(outside, self.pixels - outside)


CAMERA, INFRARED = CameraSettings(), InfraredSection()
ADDRESSES = np.zeros(KEEP + 1, np.int64)  # of a swarm that calls nothing


def block_of(scene: Scene, camera=CAMERA, observer=0, infrared=INFRARED, noise_counts=0.0) -> SimpleNamespace:
    """Return bytes and swarm of a scene's robots, sorted into cells; those from `observer` on are the only group."""
    arena, kind, robots = scene.arena, scene.body, len(scene.poses)
    kinds = [kind.model_copy(update={"radius_cm": radius}) for radius in scene.radii_cm.tolist()]
    room = room_for([RobotGroup(count=1, camera={"pixels": camera.pixels})] * robots, kinds, [arena])
    block = make_block({**room, "groups": 1, "pixels": (robots - observer) * camera.pixels, "rays": camera.pixels})
    swarm = open_block(block)
    set_bodies(swarm, kinds)
    set_arena(swarm, arena, cell_cm(kinds))
    swarm.robots.x, swarm.robots.y, swarm.robots.heading = scene.poses.T
    swarm.robots.ring_on, swarm.robots.infrared_gain = scene.lit, 1.0
    group = swarm.groups[0]
    group.first, group.count, group.pixels = observer, robots - observer, camera.pixels
    set_infrared(group.infrared, kind, infrared, noise_counts)
    set_camera(group.camera, swarm.rays, camera.section(), kind, 10.0)
    swarm.pixels[:] = 77
    sort_into_cells(block)
    return SimpleNamespace(bytes=block, swarm=swarm)


def readings(scene: Scene) -> FloatArray:
    block = block_of(scene)
    sense_infrared(block.bytes, ADDRESSES, 0)
    return block.swarm.robots.sensors.infrared[:, : len(scene.body.infrared.sensors)]


def rows(scene: Scene, camera: CameraSettings) -> IntArray:
    block = block_of(scene, camera)
    look(block.bytes, ADDRESSES, 0)
    if camera.reflection_range_cm > 0:
        add_reflections(block.bytes, ADDRESSES, 0)
    return block.swarm.pixels.reshape(-1, camera.pixels)


def empty_arena(width_cm: float = 200.0, height_cm: float = 200.0) -> Arena:
    return make_arena(width_cm, height_cm, [], [])


@st.composite
def any_scenes(draw: st.DrawFn, robots=(1, 2, 3, 10, 60), bodies=(E_PUCK,)) -> Scene:
    """Robots that do not overlap, some in contact, in corners or at walls, among obstacles of every kind."""
    count = draw(st.sampled_from(robots))
    body = draw(st.sampled_from(bodies))
    is_mixed = len(bodies) > 1 and draw(st.booleans())
    body = min(bodies, key=lambda each: each.radius_cm) if is_mixed else body  # whose sensors lie within any
    share = (max(each.radius_cm for each in (bodies if is_mixed else [body])) / RADIUS_CM) ** 2
    floor_cm2 = share * (500.0 + count * draw(st.sampled_from([120.0, 400.0, 2000.0])))
    slenderness = draw(st.sampled_from([1.0, 2.0, 8.0, 0.125]))
    obstacles = draw(st.integers(0, 6))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    height = math.sqrt(floor_cm2 / slenderness)
    arena = random_arena(floor_cm2 / height, height, obstacles, random)
    radii = random.choice([each.radius_cm for each in bodies], count) if is_mixed else np.full(count, body.radius_cm)
    poses = random_poses(arena, count, random, radii)
    assume(len(poses) > 0)
    lit = random.random(len(poses)) < random.choice([0.1, 0.5, 1.0])
    return Scene(poses, lit, arena, body, radii[: len(poses)] if is_mixed else None)


def random_arena(width: float, height: float, obstacles: int, random: np.random.Generator) -> Arena:
    """Return an arena with small and large circles, boxes and polygons, which may overlap each other."""
    circles, polygons = [], []
    for _ in range(obstacles):
        size = random.uniform(0.5, min(8.0, width / 4, height / 4))
        x, y = random.uniform(size, width - size), random.uniform(size, height - size)
        kind = random.integers(3)
        if kind == 0:
            circles.append((x, y, size))
        elif kind == 1:
            length = random.uniform(0.2, 1.9) * size
            turned = random.choice([0.0, random.uniform(-4, 4)])
            polygons.append(box_corners(x, y, length, math.sqrt(4 * size**2 - length**2), turned))
        else:
            corners = random.integers(3, 8)
            around = 2 * math.pi * (np.arange(corners) + random.uniform(0, 0.7, corners)) / corners
            polygons.append(np.column_stack([x + size * np.cos(around), y + size * np.sin(around)]))
    return make_arena(width, height, circles, polygons)


def random_poses(arena: Arena, count: int, random: np.random.Generator, radii: FloatArray) -> FloatArray:
    """Return up to `count` poses of robots of these radii, cm, as many as find room in a few attempts each."""
    poses, placed = np.empty((count, 3)), 0
    for _ in range(15 * count):
        radius_cm = float(radii[placed])
        discs = np.column_stack([poses[:placed, :2], radii[:placed]])
        pose = x, y, _ = _candidate(arena, discs, random, radius_cm)
        gaps = np.hypot(discs[:, 0] - x, discs[:, 1] - y) - (discs[:, 2] + radius_cm)
        if (gaps >= -1e-12).all() and clearance_cm(arena, x, y) >= radius_cm - 1e-12:
            poses[placed] = pose
            placed += 1
            if placed == count:
                break
    return poses[:placed]


def _candidate(arena: Arena, placed: FloatArray, random: np.random.Generator, radius_cm: float):
    """Return a pose that may be free: anywhere, at one or two walls, touching an obstacle or another robot."""
    low, high = radius_cm, np.array([arena.width_cm, arena.height_cm]) - radius_cm
    x, y = random.uniform(low, high)
    heading = random.choice([random.uniform(-20, 20), random.integers(8) * math.pi / 4])
    kind = random.random()
    if kind < 0.05:
        return random.choice([low, high[0]]), random.choice([low, high[1], y]), heading
    discs = np.vstack([placed, arena.circles])
    if kind < 0.2 and len(discs):
        x, y, radius = random.choice(discs)
        towards = random.uniform(-math.pi, math.pi)
        apart = radius + radius_cm
        nose_on = random.random() < 0.1
        return x - apart * math.cos(towards), y - apart * math.sin(towards), towards if nose_on else heading
    return x, y, heading


@st.composite
def camera_settings(draw: st.DrawFn) -> CameraSettings:
    """Settings of cameras from narrow to all round, with all or only central pixels, with or without limited range."""
    pixels = draw(st.sampled_from([60, 1, 2, 20, 61, 150]))
    return CameraSettings(
        pixels,
        draw(st.sampled_from([56.0, 360.0]) | st.floats(10, 360)),
        draw(st.just(pixels) | st.integers(1, pixels).filter(lambda central: (pixels - central) % 2 == 0)),
        draw(st.sampled_from([math.inf, 20.0, 60.0])),
    )


def _in_frame_of_rays(origins: FloatArray, directions: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far ahead and how far left of each ray each point is, both (rays, points)."""
    offset = points[None] - origins[:, None]
    ahead = offset[..., 0] * directions[:, :1] + offset[..., 1] * directions[:, 1:]
    aside = offset[..., 1] * directions[:, :1] - offset[..., 0] * directions[:, 1:]
    return ahead, aside


def cast_on_discs(origins: FloatArray, directions: FloatArray, discs: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the (rays, discs) distances, inf where a ray misses, and whether it nearly does or nearly does not."""
    ahead, aside = _in_frame_of_rays(origins, directions, discs[:, :2])
    half_chord = np.sqrt(np.maximum(discs[:, 2] ** 2 - aside**2, 0))
    meets = (ahead > 0) & (np.abs(aside) <= discs[:, 2])
    grazes = (ahead > -EDGE_CM) & (np.abs(np.abs(aside) - discs[:, 2]) < EDGE_CM)
    looks_along = (np.abs(ahead) < EDGE_CM) & (np.hypot(ahead, aside) < discs[:, 2] + EDGE_CM)
    return np.where(meets, np.maximum(ahead - half_chord, 0), np.inf), grazes | looks_along


def cast_on_segments(origins: FloatArray, directions: FloatArray, segments: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the (rays, segments) distances, inf where a ray misses, and whether it nearly does or nearly does not."""
    ahead_a, aside_a = _in_frame_of_rays(origins, directions, segments[:, :2])
    ahead_b, aside_b = _in_frame_of_rays(origins, directions, segments[:, 2:])
    crosses = (aside_a > 0) != (aside_b > 0)
    share = aside_a / np.where(crosses, aside_a - aside_b, 1)
    crossing = ahead_a + share * (ahead_b - ahead_a)
    by_an_end = (np.abs(aside_a) < EDGE_CM) & (ahead_a > -EDGE_CM)
    by_an_end |= (np.abs(aside_b) < EDGE_CM) & (ahead_b > -EDGE_CM)
    distance = np.where(crosses & (crossing >= 0), np.maximum(crossing, 0), np.inf)
    return distance, by_an_end | (crosses & (np.abs(crossing) < EDGE_CM))


def walls_of(arena: Arena, out: float = 100.0) -> FloatArray:
    """Return (4, 4) cm: left, right, lower and upper wall; out: how much longer, so that no ray slips through."""
    right, top = arena.width_cm, arena.height_cm
    upright = [(x, -out, x, top + out) for x in (0, right)]
    return np.array([*upright, *((-out, y, right + out, y) for y in (0, top))], float)


def directions_of(angles: FloatArray) -> FloatArray:
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def slow_response(distance_cm: FloatArray, of: ProximitySection) -> FloatArray:
    """F of the facts: level nearer than 0.3 cm, nothing beyond 12 cm."""
    x0 = of.peak_cm
    x = np.clip(distance_cm, x0, of.range_cm)
    counts = of.peak_counts * (of.width_cm2 - x0**2) / (x**2 - 2 * x0 * x + of.width_cm2)
    return np.where(distance_cm > of.range_cm, 0, counts)


def slow_readings(scene: Scene) -> tuple[FloatArray, BoolArray]:
    """Return (robots, sensors) readings, and for which of them a ray runs along an edge."""
    infrared, sensors = scene.body.infrared, np.array(scene.body.infrared.sensors)
    count = len(sensors)
    written, doubtful = np.empty((len(scene.poses), count)), np.empty((len(scene.poses), count), bool)
    spread = np.array((-1, 0, 1)) * infrared.spread_deg
    walls = walls_of(scene.arena)
    for robot, (x, y, heading) in enumerate(scene.poses):
        forward, left = directions_of(heading), directions_of(heading + math.pi / 2)
        positions = (x, y) + sensors[:, :1] * forward + sensors[:, 1:2] * left
        angles = heading + np.radians(sensors[:, 2:] + spread)
        rays = np.repeat(positions, 3, axis=0), directions_of(angles.ravel())
        discs, by_disc = cast_on_discs(*rays, np.vstack([np.delete(scene.discs, robot, axis=0), scene.arena.circles]))
        flats, by_flat = cast_on_segments(*rays, np.vstack([walls, scene.arena.edges]))
        distance = np.hstack([discs, flats]).min(axis=1).reshape(count, 3)
        foot = distance[:, 1] / math.cos(math.radians(infrared.spread_deg))
        total = slow_response(distance, infrared).sum(axis=1) - 2 * slow_response(foot, infrared)
        written[robot] = np.clip(total, 0, infrared.peak_counts)
        by_edge = (by_disc.any(axis=1) | by_flat.any(axis=1)).reshape(count, 3)
        at_range = np.abs(np.column_stack([distance, foot]) - infrared.range_cm) < EDGE_CM
        doubtful[robot] = by_edge.any(axis=1) | at_range.any(axis=1)
    return written, doubtful


def slow_pixels(scene: Scene, camera: CameraSettings, robot: int) -> tuple[tuple, IntArray, FloatArray, BoolArray]:
    """Return rays of the pixels of a camera's central window, and what they show; all but the rays are (pixels,).

    That is the number of a robot, or -1; cm to what each ray meets first; and where two answers lie within rounding.
    """
    x, y, heading = scene.poses[robot]
    directions = directions_of(heading + camera.angles()[camera.window()])
    rays = np.tile((x, y) + scene.body.camera_forward_cm * directions_of(heading), (len(directions), 1)), directions
    to_robots, by_robot = cast_on_discs(*rays, scene.discs)
    to_robots[:, robot], by_robot[:, robot] = np.inf, False
    to_circles, by_circle = cast_on_discs(*rays, scene.arena.circles)
    to_edges, by_edge = cast_on_segments(*rays, scene.arena.edges)
    reach = np.hstack([to_robots, to_circles, to_edges, np.full((len(directions), 1), camera.range_cm)])
    nearest = reach.argmin(axis=1)
    shown = np.where((nearest < len(scene.poses)) & (reach.min(axis=1) < np.inf), nearest, -1)
    first, second = np.sort(reach, axis=1)[:, :2].T
    doubtful = np.hstack([by_robot, by_circle, by_edge]).any(axis=1) | (second < first + EDGE_CM)
    return rays, shown, reach[:, :-1].min(axis=1), doubtful


def slow_rows(scene: Scene, camera: CameraSettings, every: int = 1) -> tuple[BoolArray, BoolArray]:
    """Return (robots, pixels) whether red, and where two answers lie within rounding, of every nth robot."""
    written, doubtful = np.zeros((2, len(scene.poses[::every]), camera.pixels), bool)
    is_lit = np.append(scene.lit, False)  # the last stands for nobody
    for row in range(len(written)):
        rays, shown, reach_cm, doubt = slow_pixels(scene, camera, row * every)
        is_red = is_lit[shown]
        if camera.reflection_range_cm > 0:
            is_mirrored, more_doubt = _slow_images(scene, camera, rays, reach_cm)
            is_red, doubt = is_red | is_mirrored, doubt | more_doubt
        written[row, camera.window()], doubtful[row, camera.window()] = is_red, doubt
    return written, doubtful


def _slow_images(scene, camera, rays, reach) -> tuple[BoolArray, BoolArray]:
    """Return (rays,) whether a lit ring is seen in a wall, and where that is within rounding.

    Everything is mirrored in each wall, and counts from there on, where nothing is met before: within (rays,) reach.
    """
    arena, lit, robots = scene.arena, scene.lit, len(scene.poses)
    to_walls, by_wall = cast_on_segments(*rays, walls_of(arena, 0))
    red, doubt = np.zeros(len(reach), bool), by_wall.any(axis=1)
    for wall in range(4):
        towards = to_walls[:, wall] < np.inf
        doubt |= np.abs(np.where(towards, to_walls[:, wall], -1) - reach) < EDGE_CM
        discs = np.vstack([scene.discs, arena.circles])
        discs[:, :2] = _mirrored(discs[:, :2], wall, arena)
        ends = [_mirrored(arena.edges[:, two], wall, arena) for two in (slice(0, 2), slice(2, 4))]
        to_discs, by_disc = cast_on_discs(*rays, discs)
        to_images, by_image = cast_on_segments(*rays, np.hstack(ends))
        image = to_discs[:, :robots][:, lit].min(axis=1, initial=np.inf)
        hidden_by = np.hstack([to_discs[:, :robots][:, ~lit], to_discs[:, robots:], to_images])
        is_first = (image <= hidden_by.min(axis=1, initial=np.inf)) & (reach > to_walls[:, wall])
        red |= towards & is_first & (image <= camera.reflection_range_cm) & (image < np.inf)
        found = np.where(image < np.inf, image, -1)[:, None]
        doubt |= towards & np.hstack([by_disc, by_image, np.abs(found - hidden_by) < EDGE_CM]).any(axis=1)
        doubt |= towards & (np.abs(found[:, 0] - camera.reflection_range_cm) < EDGE_CM)
    return red, doubt


def _mirrored(places: FloatArray, wall: int, arena: Arena) -> FloatArray:
    """Return (n, 2) places beyond the left, right, lower or upper wall."""
    mirrored = places.copy()
    axis, is_far = divmod(wall, 2)
    mirrored[:, axis] = 2 * is_far * (arena.width_cm, arena.height_cm)[axis] - mirrored[:, axis]
    return mirrored
