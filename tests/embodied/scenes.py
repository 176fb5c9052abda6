"""Scenes to try the sensors on, and slow twins of the sensors.

The twins are written from the facts about the robot alone. They cast each ray on each surface, in the frame of the
world, and report which rays run within `EDGE_CM` of a decision, which rounding may reverse.
"""

import math
from typing import NamedTuple

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from epuck_sim.arena import Arena, clearance_cm, make_arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.camera_pixels import Camera, make_camera
from epuck_sim.embodied.cell_list import CellList, make_cell_list, sort_into_cells
from epuck_sim.embodied.infrared import sense_infrared
from epuck_sim.embodied.line_camera import see
from epuck_sim.geometry import box_corners

RADIUS_CM = 3.7
EDGE_CM = 1e-9


class Scene(NamedTuple):
    """Robots in an arena."""

    poses: FloatArray
    """(robots, 3) x cm, y cm, heading rad."""
    lit: BoolArray
    """(robots,) whether each ring is on."""
    arena: Arena


class CameraSettings(NamedTuple):
    """Settings of a camera, as a scenario gives them."""

    pixels: int = 60
    field_of_view_deg: float = 56.0
    central_pixels: int = 60
    range_cm: float = math.inf
    reflection_range_cm: float = 0.0

    def make(self) -> Camera:
        view_rad = math.radians(self.field_of_view_deg)
        return make_camera(self.pixels, view_rad, self.central_pixels, self.range_cm, self.reflection_range_cm)

    def angles(self) -> FloatArray:
        """Return rad: directions of the middles of the pixels, left of straight ahead, from left to right."""
        return np.radians(self.field_of_view_deg * (0.5 - (np.arange(self.pixels) + 0.5) / self.pixels))


# --- the sensors under test, for all robots in a scene ----------------------------------------------


def sorted_cells(scene: Scene) -> CellList:
    cells = make_cell_list(scene.arena.width_cm, scene.arena.height_cm, len(scene.poses))
    sort_into_cells(scene.poses, cells)
    return cells


def readings(scene: Scene, observer: int = 0) -> FloatArray:
    """Return the noiseless infrared readings of the robots from `observer` on."""
    arena = scene.arena
    written = np.full((len(scene.poses) - observer, 8), np.nan)
    walls = arena.width_cm, arena.height_cm
    sense_infrared(scene.poses, *walls, arena.circles, arena.edges, sorted_cells(scene), True, observer, written)
    return written


def rows(scene: Scene, camera: CameraSettings, observer: int = 0) -> IntArray:
    """Return the rows of pixels of the robots from `observer` on."""
    arena = scene.arena
    written = np.full((len(scene.poses) - observer, camera.pixels), 77, np.int64)
    cells = sorted_cells(scene)
    see(scene.poses, scene.lit, arena.circles, arena.edges, cells, camera.make(), observer, written)
    return written


# --- scenes -----------------------------------------------------------------------------------------


def empty_arena(width_cm: float = 200.0, height_cm: float = 200.0) -> Arena:
    return make_arena(width_cm, height_cm, [], [])


@st.composite
def scenes(draw: st.DrawFn, robots: tuple[int, ...] = (1, 2, 3, 10, 60)) -> Scene:
    """Robots that do not overlap, some in contact, in corners or at walls, among obstacles of every kind."""
    count = draw(st.sampled_from(robots))
    floor_cm2 = 500.0 + count * draw(st.sampled_from([120.0, 400.0, 2000.0]))
    slenderness = draw(st.sampled_from([1.0, 2.0, 8.0, 0.125]))
    obstacles = draw(st.integers(0, 6))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    height = math.sqrt(floor_cm2 / slenderness)
    arena = random_arena(floor_cm2 / height, height, obstacles, random)
    poses = random_poses(arena, count, random)
    assume(len(poses) > 0)
    return Scene(poses, random.random(len(poses)) < random.choice([0.1, 0.5, 1.0]), arena)


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


def random_poses(arena: Arena, count: int, random: np.random.Generator) -> FloatArray:
    """Return up to `count` poses, as many as find room in a few attempts each."""
    poses = np.empty((count, 3))
    placed = 0
    for _ in range(15 * count):
        pose = x, y, _ = _candidate(arena, poses[:placed], random)
        gaps = np.hypot(poses[:placed, 0] - x, poses[:placed, 1] - y) - 2 * RADIUS_CM
        if (gaps >= -1e-12).all() and clearance_cm(arena, x, y) >= RADIUS_CM - 1e-12:
            poses[placed] = pose
            placed += 1
            if placed == count:
                break
    return poses[:placed]


def _candidate(arena: Arena, placed: FloatArray, random: np.random.Generator) -> tuple[float, float, float]:
    """Return a pose that may be free: anywhere, at one or two walls, touching an obstacle or another robot."""
    low, high = RADIUS_CM, np.array([arena.width_cm, arena.height_cm]) - RADIUS_CM
    x, y = random.uniform(low, high)
    heading = random.choice([random.uniform(-20, 20), random.integers(8) * math.pi / 4])
    kind = random.random()
    if kind < 0.05:
        return random.choice([low, high[0]]), random.choice([low, high[1], y]), heading
    discs = np.vstack([np.column_stack([placed[:, :2], np.full(len(placed), RADIUS_CM)]), arena.circles])
    if kind < 0.2 and len(discs):
        x, y, radius = random.choice(discs)
        towards = random.uniform(-math.pi, math.pi)
        apart = radius + RADIUS_CM
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


# --- rays, cast on everything -----------------------------------------------------------------------


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
    by_an_end = ((np.abs(aside_a) < EDGE_CM) & (ahead_a > -EDGE_CM)) | (
        (np.abs(aside_b) < EDGE_CM) & (ahead_b > -EDGE_CM)
    )
    distance = np.where(crosses & (crossing >= 0), np.maximum(crossing, 0), np.inf)
    return distance, by_an_end | (crosses & (np.abs(crossing) < EDGE_CM))


def _bodies(scene: Scene) -> FloatArray:
    return np.column_stack([scene.poses[:, :2], np.full(len(scene.poses), RADIUS_CM)])


def _towards(angles: FloatArray) -> FloatArray:
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


# --- the infrared sensors' twin ---------------------------------------------------------------------

SENSORS = np.array(
    [
        (3.35, -1.05, -18),
        (2.30, -2.60, -45),
        (0.00, -3.30, -90),
        (-3.00, -1.80, -142),
        (-3.00, 1.80, 142),
        (0.00, 3.30, 90),
        (2.30, 2.60, 45),
        (3.35, 1.05, 18),
    ]
)
"""(8, 3) x cm, y cm, direction in degrees."""


def slow_response(distance_cm: FloatArray) -> FloatArray:
    """F of the facts: level nearer than 0.3 cm, nothing beyond 12 cm."""
    x = np.clip(distance_cm, 0.3, 12)
    return np.where(distance_cm > 12, 0, 3731 * (0.7 - 0.3**2) / (x**2 - 2 * 0.3 * x + 0.7))


def slow_readings(scene: Scene) -> tuple[FloatArray, BoolArray]:
    """Return (robots, 8) readings, and for which of them a ray runs along an edge."""
    written, doubtful = np.empty((len(scene.poses), 8)), np.empty((len(scene.poses), 8), bool)
    bodies = _bodies(scene)
    right, top, out = scene.arena.width_cm, scene.arena.height_cm, 100  # out: that no ray slips through a corner
    walls = np.array(
        [
            (-out, 0, right + out, 0),
            (-out, top, right + out, top),
            (0, -out, 0, top + out),
            (right, -out, right, top + out),
        ]
    )
    for robot, (x, y, heading) in enumerate(scene.poses):
        forward, left = _towards(heading), _towards(heading + math.pi / 2)
        positions = (x, y) + SENSORS[:, :1] * forward + SENSORS[:, 1:2] * left
        angles = heading + np.radians(SENSORS[:, 2:] + (-15, 0, 15))
        rays = np.repeat(positions, 3, axis=0), _towards(angles.ravel())
        discs, by_disc = cast_on_discs(*rays, np.vstack([np.delete(bodies, robot, axis=0), scene.arena.circles]))
        flats, by_flat = cast_on_segments(*rays, np.vstack([walls, scene.arena.edges]))
        distance = np.hstack([discs, flats]).min(axis=1).reshape(8, 3)
        foot = distance[:, 1] / math.cos(math.radians(15))
        total = slow_response(distance).sum(axis=1) - 2 * slow_response(foot)
        written[robot] = np.clip(total, 0, 3731)
        by_edge = (by_disc.any(axis=1) | by_flat.any(axis=1)).reshape(8, 3)
        at_range = np.abs(np.column_stack([distance, foot]) - 12) < EDGE_CM
        doubtful[robot] = by_edge.any(axis=1) | at_range.any(axis=1)
    return written, doubtful


# --- the camera's twin ------------------------------------------------------------------------------


def slow_rows(scene: Scene, camera: CameraSettings) -> tuple[BoolArray, BoolArray]:
    """Return (robots, pixels) whether red, and for which of them two answers lie within rounding."""
    written, doubtful = np.zeros((2, len(scene.poses), camera.pixels), bool)
    bodies = _bodies(scene)
    outside = (camera.pixels - camera.central_pixels) // 2
    window = slice(outside, camera.pixels - outside)
    for robot, (x, y, heading) in enumerate(scene.poses):
        directions = _towards(heading + camera.angles()[window])
        rays = np.tile((x, y) + RADIUS_CM * _towards(heading), (len(directions), 1)), directions
        lit = scene.lit & (np.arange(len(bodies)) != robot)
        dark = ~scene.lit & (np.arange(len(bodies)) != robot)
        reds, by_red = cast_on_discs(*rays, bodies[lit])
        discs, by_disc = cast_on_discs(*rays, np.vstack([bodies[dark], scene.arena.circles]))
        flats, by_flat = cast_on_segments(*rays, scene.arena.edges)
        red = reds.min(axis=1, initial=np.inf)
        other = np.minimum(discs.min(axis=1, initial=np.inf), flats.min(axis=1, initial=np.inf))
        written[robot, window] = (red < np.inf) & (red <= other) & (red <= camera.range_cm)
        by_edge = np.hstack([by_red, by_disc, by_flat]).any(axis=1)
        seen = np.where(red < np.inf, red, -1)
        ties = (np.abs(seen - other) < EDGE_CM) | (np.abs(seen - camera.range_cm) < EDGE_CM)
        doubtful[robot, window] = by_edge | ties
    return written, doubtful
