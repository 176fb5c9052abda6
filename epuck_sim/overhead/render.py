"""Renders one exposure of the overhead camera: lit rings in the dark, or everything in a lit room (thesis 4.3.1).

An overexposed ring of LEDs has a saturated core, and a haze around it. Some real films also show rings as eight points,
and mirror images in the walls. The lit room has floor, walls, obstacles, bodies and tags, whose grey levels are our
estimates. Each robot is drawn within its bounding box, not over the whole picture.

An `image` is (rows, columns) of light or levels, changed in place. `floor_cm` is (rows, columns, 2) cm, the point of
the floor that each pixel shows, `eye_cm` (3,) cm the position of the camera. `robots` are (n, 7): x, y in cm and
heading in rad, radius and height of the body, and of the ring, in cm. `boxes` are (n, 4) px, see `bounding_boxes`.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arena import Arena, brightness_at
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray, IntArray
from epuck_sim.geometry import contains
from epuck_sim.overhead.camera import WALL_HEIGHT_CM, CameraModel, Frame, Light, Picture, overhead_camera
from epuck_sim.overhead.tags import tag_dictionary, tag_modules
from epuck_sim.scenario.arena import OverheadSection
from epuck_sim.scenario.embodied import EmbodiedScenario, largest_cm
from epuck_sim.scenario.loader import load_of_model, with_values
from epuck_sim.scenario.robot_kind import EPUCK, RobotKind
from epuck_sim.scenario.scenario import ScenarioLike
from epuck_sim.util.jit import jit

COLOUR_LEVELS = (900.0, 130.0, 120.0)
"""Levels of red, green and blue that a ring of light 1 adds; our estimate.

Red is saturated all along the ring, and what leaks into green and blue makes its core pinkish, as in thesis Fig. 4.5.
"""

# rings; widths and brightnesses are our estimates
NOMINAL_EXPOSURE_MS = 20.0  # exposure at which an LED has light 1; our definition
WIDTH_CM = 0.3  # standard deviation of the brightness across a ring, which shines through a diffuser
DEPTH = 0.5  # share by which a ring is darker midway between two of its eight LEDs
FADE_CM = 1.0  # distance from a ring at which its haze has fallen to 1/e of its brightness
CORE_CM = 5 * WIDTH_CM  # distance beyond which a ring's core adds less than half a level, even in a second's exposure
FAINT_LEVELS = 0.5  # levels of haze below which it rounds to nothing
LED_ANGLES = np.arange(8) * math.tau / 8  # of the LEDs of an e-puck, from its heading

# grey levels
TABLE, FLOOR = 30.0, 145.0  # the table around the arena, and its floor where that is white
WALL_FACE, WALL_TOP = 200.0, 240.0  # inner side and top of the walls
LAMP = 255.0  # dots that stand for lamps
OBSTACLE = 85.0  # obstacles and movables, which are drawn flat on the floor
BODY_SIDE, BODY_TOP = 40.0, 75.0
HEADING_MARK = 225.0  # the wedge on a robot's top that points ahead
PAPER, INK = 225.0, 20.0  # white and black on a tag

WALL_THICKNESS_CM = 1.0
MODULE_PX = 8  # pixels of a module in the pattern of a tag that is drawn; more than in pictures
FINER = 4  # parts of a pixel's side, over which a tag is averaged

NOISE_OFFSETS = 2**20  # number of different places in the noise table at which the noise of a picture may begin

PERFECT = {"blur_px": 0.0, "vignetting": 0.0, "distortion": 0.0, "noise_levels": 0.0, "light": "lit"}
"""Values of the section `overhead` of a camera without faults in a lit room."""

NO_MOVABLES = np.empty((0, 2))  # places of the movables of an arena that has none

_OCTAGON = np.column_stack([np.cos(LED_ANGLES), np.sin(LED_ANGLES)]) / math.cos(math.pi / 8)
"""(8, 2) corners of an octagon around a circle of radius 1."""
_CIRCLE = np.column_stack([np.cos(np.arange(48) * math.tau / 48), np.sin(np.arange(48) * math.tau / 48)])
_MARK = np.array([(3.2, 0.0), (0.4, 1.26), (0.4, -1.26)])
"""(3, 2) cm: the mark on an e-puck, ahead of its centre and aside; other robots' marks are in proportion."""


class ExposureSample(NamedTuple):
    """The robots at one moment of an exposure."""

    poses: FloatArray  # (robots, 3) cm, cm, rad: x, y, heading
    ring_on: BoolArray  # (robots,) which rings are on
    movables: FloatArray = NO_MOVABLES  # (movables, 2) cm: where the arena's movables are
    arena: Arena | None = None  # walls and obstacles; by default those that the renderer was made with


class Renderer:
    """Renders pictures of one arena; the same pictures in the same order with the same seed are equal."""

    def __init__(
        self,
        section: OverheadSection,
        camera: CameraModel,
        arena: Arena,
        seed: int,
        kinds: Sequence[RobotKind] = (EPUCK,),
    ) -> None:
        """Prepare what all pictures share; kinds: one for each robot, or one for all; seed: the seed of the noise."""
        self._section, self._camera = section, camera
        sizes = [(kind.radius_cm, kind.height_cm, kind.ring_radius_cm, kind.ring_height_cm) for kind in kinds]
        self._sizes_cm = np.array(sizes, float)
        self._light = section.gain * section.exposure_ms / NOMINAL_EXPOSURE_MS
        self._floor_cm = camera.plane_map(0.0)
        self._dimming = dimming(camera.width_px, camera.height_px, section.vignetting)
        self._movable_cm = arena.circles[arena.first_movable :, 2]
        self._lamps = np.zeros(self._floor_cm.shape[:2], bool)  # the camera sees those below it; nothing hides them
        for x, y, height_cm, _ in arena.lamps[arena.lamps[:, 2] < camera.position_cm[2]]:
            rise = height_cm / camera.position_cm[2]
            off_cm = (1 - rise) * self._floor_cm + rise * camera.position_cm[:2] - (x, y)
            self._lamps |= np.hypot(*np.moveaxis(off_cm, -1, 0)) <= arena.lamp_cm
        self._room = render_room(self._floor_cm, camera.position_cm, arena)
        self._arena = self._first_arena = arena
        self._random = np.random.default_rng(seed)
        drawn = self._random.standard_normal(3 * camera.width_px * camera.height_px + NOISE_OFFSETS, np.float32)
        noise = np.rint(section.noise_levels * drawn).astype(np.int16)[: len(drawn) // 3 * 3]
        self._noise = np.ascontiguousarray(noise.reshape(-1, 3).T)  # a row a colour, as they take turns
        self._dark = np.clip(self._noise, 0, 255).astype(np.uint8)  # pictures without light
        self._dark.flags.writeable = False

    def render(self, samples: Sequence[ExposureSample], *, room_is_lit: bool) -> list[Light]:
        """Return red, green and blue of one exposure, to which all samples contribute equally.

        A lit room is as bright in a long exposure as in a short one, as if its lamps were dimmed; rings get brighter.
        """
        ambient = 1.0 if room_is_lit else self._section.ambient
        if not ambient and not any(sample.ring_on.any() for sample in samples):
            return self._next(self._dark)
        light = self._through_lens(self._rings(samples))
        channels = [levels * light for levels in COLOUR_LEVELS]
        if ambient:
            grey = np.float32(ambient) * self._through_lens(self._scene(samples))
            channels = [grey + channel for channel in channels]
        noisy = zip(channels, self._next(self._noise), strict=True)
        return [np.asarray(cv2.add(*pair, dtype=cv2.CV_8U), np.uint8) for pair in noisy]  # rounds, and clips to 0..255

    def _robots(self, sample: ExposureSample) -> FloatArray:
        count = len(sample.poses)
        return np.hstack([sample.poses, np.broadcast_to(self._sizes_cm[:count], (count, 4))])

    def _rings(self, samples: Sequence[ExposureSample]) -> Float32Array:
        image = np.zeros(self._room.shape, np.float32)
        light = self._light / len(samples)
        lit = np.concatenate([self._robots(sample)[sample.ring_on] for sample in samples])
        lit = lit[~np.isnan(lit[:, 0])]
        self._add_rings(image, lit, light)
        if self._section.gloss:
            images = mirror_images(lit, samples[0].arena or self._first_arena)
            self._add_rings(image, images, self._section.gloss * light)
        return image

    def _add_rings(self, image: Float32Array, robots: FloatArray, light: float) -> None:
        if self._section.led_points:
            add_points(image, self._camera, robots, light)
            return
        bloom = self._section.bloom
        brightest = self._light * bloom * max(COLOUR_LEVELS) / FAINT_LEVELS
        reach = max(CORE_CM, FADE_CM * math.log(max(brightest, 1.0)))  # of core or haze that is visible
        boxes = bounding_boxes(self._camera, robots, reach)
        add_rings(image, self._floor_cm, self._camera.position_cm, robots, boxes, light, bloom, reach)

    def _scene(self, samples: Sequence[ExposureSample]) -> Float32Array:
        """Return (rows, columns) the levels of the lit room with the robots in it."""
        camera, tags = self._camera, self._section.tags
        scene = np.zeros(self._room.shape, np.float32)
        for sample in samples:
            arena = sample.arena or self._first_arena
            if arena is not self._arena:
                self._arena, self._room = arena, render_room(self._floor_cm, camera.position_cm, arena)
            image = self._room.copy()
            for place, radius in zip(sample.movables, self._movable_cm, strict=True):
                _draw_circle(image, self._floor_cm, place[0], place[1], radius)
            robots = self._robots(sample)
            bodies = robots[~np.isnan(robots[:, 0])]
            from_axis_cm = np.hypot(*(bodies[:, :2] - camera.position_cm[:2]).T)
            farthest_first = np.argsort(-from_axis_cm, kind="stable")  # none is hidden by one farther out
            draw_bodies(image, camera, bodies[farthest_first])
            if tags is not None:
                draw_tags(image, camera, robots, tags, float(self._section.tag_cm))
            image[self._lamps] = LAMP
            scene += image
        return scene / np.float32(len(samples))

    def _through_lens(self, image: Float32Array) -> Float32Array:
        if self._section.blur_px > 0:
            blurred = cv2.GaussianBlur(image, (0, 0), self._section.blur_px, borderType=cv2.BORDER_REPLICATE)
            image = np.asarray(blurred, np.float32)
        return self._dimming * image

    def _next(self, table: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
        """Return (rows, columns) levels of three colours that take turns in a noise table, from a random place on.

        Drawing new numbers for each picture would take longer than all the rest.
        """
        first = self._random.integers(NOISE_OFFSETS)
        places = (divmod(first + colour, 3) for colour in range(3))
        return [table[part, begin : begin + self._room.size].reshape(self._room.shape) for begin, part in places]


class ArenaView:
    """Draws the robots of one scenario in their arena, as a camera without faults sees them in a lit room.

    >>> from epuck_sim import ArenaView, Simulation
    >>> simulation = Simulation("thesis", seed=1)
    >>> view = ArenaView(simulation.scenario, width_px=240, height_px=240)
    >>> step = next(simulation)
    >>> view.draw(step.poses, step.ring_on).shape
    (240, 240, 3)
    """

    def __init__(self, scenario: ScenarioLike, width_px: int | None = None, height_px: int | None = None) -> None:
        """Place the camera.

        Args:
            scenario: A scenario of robots, or what `load_scenario` takes; its section `overhead` places the camera.
            width_px: Width of pictures, an even number; the scenario's by default.
            height_px: Height of pictures, an even number; the scenario's by default.

        Raises:
            ScenarioError: The scenario, or the size, is not allowed.
            EpuckSimError: The camera would hang between the walls.
        """
        scenario = load_of_model(scenario, EmbodiedScenario, "an ArenaView shows robots")
        given = {**PERFECT, "width_px": width_px, "height_px": height_px}
        changed = {f"overhead.{key}": value for key, value in given.items() if value is not None}
        section = with_values(scenario, changed, scenario.name).overhead
        camera = overhead_camera(section, *largest_cm(scenario))
        arena = scenario.arena.build()
        self._movables = arena.circles[arena.first_movable :, :2]
        self._renderer = Renderer(section, camera, arena, seed=0, kinds=scenario.robot_kinds)

    def draw(
        self, poses: FloatArray, ring_on: BoolArray, movables: FloatArray | None = None, arena: Arena | None = None
    ) -> Picture:
        """Return (height, width, 3) the picture of robots in red, green and blue from 0 to 255.

        Args:
            poses: (robots, 3) cm, cm, rad: x, y, heading.
            ring_on: (robots,) whether each ring is lit.
            movables: (movables, 2) cm: where the arena's movables are, as steps have it; by default where they begin.
            arena: Walls and obstacles, as steps have it; by default those of the start.
        """
        places = self._movables if movables is None else np.asarray(movables)
        sample = ExposureSample(np.asarray(poses), np.asarray(ring_on, np.bool_), places, arena)
        return Frame(0.0, colours=self._renderer.render([sample], room_is_lit=True)).picture


def dimming(width_px: int, height_px: int, vignetting: float) -> Float32Array:
    """Return (height_px, width_px) the fraction of light that the lens passes: 1 - `vignetting` in the corners."""
    across = np.linspace(-1, 1, width_px) * width_px
    down = np.linspace(-1, 1, height_px) * height_px
    square = (across**2 + down[:, None] ** 2) / (width_px**2 + height_px**2)
    return (1 - vignetting * square).astype(np.float32)


def bounding_boxes(camera: CameraModel, robots: FloatArray, reach: float) -> IntArray:
    """Return (n, 4) px: the box of each ring and of all within `reach`, cm, of it; empty outside of the picture.

    Its columns are the first row, the row after the last, the first column, and the column after the last.
    """
    if not len(robots):  # OpenCV refuses empty arrays
        return np.empty((0, 4), np.int64)
    octagons = robots[:, None, :2] + (robots[:, 5] + reach)[:, None, None] * _OCTAGON
    points = np.column_stack([octagons.reshape(-1, 2), np.repeat(robots[:, 6], len(_OCTAGON))])
    pixels = camera.project(points).reshape(len(robots), len(_OCTAGON), 2)
    low, high = np.floor(pixels.min(axis=1)), np.ceil(pixels.max(axis=1)) + 1
    bounds = np.clip(np.stack([low, high], axis=-1), 0, [[camera.width_px], [camera.height_px]])
    return np.asarray(bounds[:, ::-1].reshape(-1, 4).astype(np.int64))


@jit
def add_rings(
    image: Float32Array,
    floor_cm: Float32Array,
    eye_cm: FloatArray,
    robots: FloatArray,
    boxes: IntArray,
    light: float,
    bloom: float,
    reach: float,
) -> None:
    """Add to an image the light of rings: `light` at an LED, `bloom` times as much haze; none beyond `reach`, cm."""
    for ring in range(len(robots)):
        radius, rise = robots[ring, 5], robots[ring, 6] / eye_cm[2]
        # the ring's centre, projected along the lines of sight onto the floor, where the ring appears enlarged
        x, y = robots[ring, 0] - rise * eye_cm[0], robots[ring, 1] - rise * eye_cm[1]
        ahead_x, ahead_y = math.cos(robots[ring, 2]), math.sin(robots[ring, 2])
        for row in range(boxes[ring, 0], boxes[ring, 1]):
            for column in range(boxes[ring, 2], boxes[ring, 3]):
                dx = (1.0 - rise) * floor_cm[row, column, 0] - x
                dy = (1.0 - rise) * floor_cm[row, column, 1] - y
                distance = math.sqrt(dx * dx + dy * dy)
                off_ring = abs(distance - radius)
                if off_ring <= reach:
                    brightness = bloom * math.exp(-off_ring / FADE_CM)
                    if off_ring <= CORE_CM:
                        ahead = (dx * ahead_x + dy * ahead_y) / max(distance, 1e-9)  # cosine of an angle
                        for _ in range(3):  # each round gives the cosine of twice the angle: 1 at each of eight LEDs
                            ahead = 2.0 * ahead * ahead - 1.0
                        leds = 1.0 - DEPTH * 0.5 * (1.0 - ahead)
                        brightness += leds * math.exp(-0.5 * (off_ring / WIDTH_CM) ** 2)
                    image[row, column] += light * brightness


def add_points(image: Float32Array, camera: CameraModel, robots: FloatArray, light: float) -> None:
    """Add to an image the LEDs of robots as points of light, as wide as a ring is thick; see `add_rings`."""
    if not len(robots):
        return
    x, y, heading, _, _, radius_cm, height_cm = robots.T[:, :, None]
    angles = heading + LED_ANGLES
    places = np.stack([x + radius_cm * np.cos(angles), y + radius_cm * np.sin(angles), height_cm + 0 * angles], axis=2)
    pixels = camera.project(places.reshape(-1, 3))
    width_px = WIDTH_CM * camera.lens.focal_px / (camera.position_cm[2] - height_cm.max())
    points = np.zeros_like(image)
    rows, columns = image.shape
    whole = np.floor(pixels).astype(int)
    part = pixels - whole
    for right, below in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = whole[:, 0] + right, whole[:, 1] + below
        share = np.abs(1 - right - part[:, 0]) * np.abs(1 - below - part[:, 1])
        is_in = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
        np.add.at(points, (row[is_in], column[is_in]), share[is_in])
    image += light * math.tau * width_px**2 * cv2.GaussianBlur(points, (0, 0), width_px)


def mirror_images(robots: FloatArray, arena: Arena) -> FloatArray:
    """Return (4 n, 7) the mirror images of robots in the four walls."""
    x, y, heading, *sizes = robots.T
    beside = [(wall - x, y, math.pi - heading) for wall in (0.0, 2 * arena.width_cm)]
    ahead = [(x, wall - y, -heading) for wall in (0.0, 2 * arena.height_cm)]
    return np.concatenate([np.column_stack([*poses, *sizes]) for poses in beside + ahead])


def render_room(floor_cm: Float32Array, eye_cm: FloatArray, arena: Arena) -> Float32Array:
    """Return (rows, columns) the grey levels of the arena without robots and movables."""
    rise = WALL_HEIGHT_CM / eye_cm[2]
    at_top = (1 - rise) * floor_cm + rise * eye_cm[:2]  # where a line of sight is at the height of the walls
    room = np.full(floor_cm.shape[:2], TABLE, np.float32)
    room[_is_within(at_top, arena, WALL_THICKNESS_CM)] = WALL_TOP
    room[_is_within(at_top, arena, 0.0)] = WALL_FACE
    on_floor = _is_within(floor_cm, arena, 0.0)
    room[on_floor] = FLOOR * brightness_at(arena, *floor_cm[on_floor].T)
    for x, y, radius in arena.circles[: arena.first_movable]:
        _draw_circle(room, floor_cm, x, y, radius)
    for corners in arena.polygons:
        room[contains(corners, floor_cm)] = OBSTACLE
    return room


def _draw_circle(image: Float32Array, floor_cm: Float32Array, x: float, y: float, radius: float) -> None:
    image[np.hypot(floor_cm[..., 0] - x, floor_cm[..., 1] - y) <= radius] = OBSTACLE


def _is_within(points: npt.NDArray[np.floating], arena: Arena, margin_cm: float) -> BoolArray:
    """Return whether each of (..., 2) points is in the arena or at most `margin_cm` beyond its walls."""
    within: BoolArray = (points >= -margin_cm) & (points <= (arena.width_cm + margin_cm, arena.height_cm + margin_cm))
    return within[..., 0] & within[..., 1]


def draw_bodies(image: Float32Array, camera: CameraModel, robots: FloatArray) -> None:
    """Draw robots one after the other, each over those before: cylinders with a mark that points ahead."""
    for x, y, heading, radius, height in robots[:, :5]:
        turn = np.array([(math.cos(heading), -math.sin(heading)), (math.sin(heading), math.cos(heading))])
        shapes = np.vstack([radius * _CIRCLE, radius * _CIRCLE, radius / epuck.RADIUS_CM * _MARK]) @ turn.T + (x, y)
        heights = np.where(np.arange(len(shapes)) < len(_CIRCLE), 0.0, height)
        pixels = np.round(16 * camera.project(np.column_stack([shapes, heights]))).astype(np.int32)
        foot, top, mark = np.split(pixels, (len(_CIRCLE), 2 * len(_CIRCLE)))
        outline = cv2.convexHull(np.vstack([foot, top]))
        for corners, level in ((outline, BODY_SIDE), (top, BODY_TOP), (mark, HEADING_MARK)):
            cv2.fillConvexPoly(image, corners, level, shift=4)  # 1/16 pixel


def draw_tags(image: Float32Array, camera: CameraModel, robots: FloatArray, dictionary: str, side_cm: float) -> None:
    """Draw on each present robot the tag with its number, if the dictionary has it; side_cm: of the black border."""
    paper_cm = side_cm * (1 + 1 / tag_modules(dictionary))
    off = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * paper_cm / 2  # ahead and to the left, clockwise
    for number, robot in enumerate(robots[: len(tag_dictionary(dictionary).bytesList)]):
        if not np.isnan(robot[0]):
            ahead = np.array([math.cos(robot[2]), math.sin(robot[2])])
            left = np.array([-ahead[1], ahead[0]])
            corners_cm = robot[:2] + off[:, :1] * ahead + off[:, 1:] * left
            corners_px = camera.project(np.column_stack([corners_cm, np.full(4, robot[4])]))
            _draw_between(image, _tag_levels(dictionary, number), corners_px)


@cache
def _tag_levels(dictionary: str, number: int) -> Float32Array:
    side_px = tag_modules(dictionary) * MODULE_PX
    pattern = cv2.aruco.generateImageMarker(tag_dictionary(dictionary), number, side_px)
    paper = np.pad(pattern, MODULE_PX // 2, constant_values=255)  # with half a module of white around the pattern
    return np.where(paper > 0, PAPER, INK).astype(np.float32)


def _draw_between(image: Float32Array, levels: Float32Array, corners_px: FloatArray) -> None:
    """Draw a square pattern between four corners, averaged over each pixel."""
    low = np.maximum(np.floor(corners_px.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(corners_px.max(axis=0)).astype(int) + 2, image.shape[::-1])
    if (high <= low).any():
        return
    side = len(levels)
    pattern_px = np.array([(0, 0), (side, 0), (side, side), (0, side)], np.float32) - 0.5
    box_px = ((corners_px - low + 0.5) * FINER - 0.5).astype(np.float32)
    size = tuple(int(side_px) for side_px in (high - low) * FINER)
    way = cv2.getPerspectiveTransform(pattern_px, box_px)
    fine = (cv2.warpPerspective(each, way, size) for each in (levels, np.ones_like(levels)))
    ink, cover = (cv2.resize(each, None, fx=1 / FINER, fy=1 / FINER, interpolation=cv2.INTER_AREA) for each in fine)
    box = image[low[1] : high[1], low[0] : high[0]]
    box[:] = (1 - cover) * box + ink
