"""Drawings of a recording: the arena of any model, and at level full the senses and links of robots or agents.

The arena lies under `/arena`, in cm. In rerun's pictures y points down; a transform there flips them, so that data keep
the coordinates of the simulation. What each entity holds is in docs/recordings.md.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arena import Arena, floor_levels
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.control.interface import SENSORS
from epuck_sim.display.arena_svg import MOST_NUMBERED
from epuck_sim.embodied.observers import find_contacts, find_sightings, make_scene
from epuck_sim.embodied.sensors.camera import half_view_rad
from epuck_sim.embodied.start import parked
from epuck_sim.recording import GREY, LIT, WHITE, Level
from epuck_sim.recording.rerun import static_chunk, temporal_chunk
from epuck_sim.recording.rows import Population, RowBatch
from epuck_sim.recording.series import KEEP_EXTREMES, WHEELS, robot_names, scalars
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import Cone, ParticleScenario, Range
from epuck_sim.scenario.robot_kind import ProximitySection, RobotKind
from epuck_sim.scenario.robots import CameraSignal, RobotGroup

ARENA = "/arena"  # with the transform
WALLS = "/arena/walls"
OBSTACLES = "/arena/obstacles"
MOVABLES = "/arena/movables"
FLOOR = "/arena/floor"
LAMPS = "/arena/lamps"
ROBOTS = "/arena/robots"  # robots or agents, of class 1 while the ring is lit or the flash is shown
NUMBERS = "/arena/numbers"
HEADINGS = "/arena/headings"
RANGES = "/arena/ranges"
CONES = "/arena/cones"
LINKS = "/arena/links"
VIEWS = "/arena/views"
SIGHTINGS = "/arena/sightings"
CONTACTS = "/arena/contacts"
LEGEND = "/legend"
CAMERA = "/camera/rows"
CAMERA_NUMBERS = "/camera/rows/numbers"
SPACE_TIME = "/camera/space_time"
INFRARED = "/infrared"
INFRARED_NUMBERS = "/infrared/numbers"

CIRCLE_CORNERS = 64  # corners of a round obstacle's outline
FLOOR_PX = 1024  # longer side of the picture of a floor
ARROW_RADIUS = 0.25 / 3.7  # half-thickness of a heading arrow, in radii of the disc
UNBOUNDED_SHARE = 1 / 8  # drawn length of a cone of unlimited range, as a share of the side
ARC_STEP_RAD = math.radians(12)  # largest angle between two corners of an arc
NOWHERE_CM = -1e5  # place, on both axes, of the numbers of robots that are not in the arena
UNBOUNDED_VIEW_CM = 12.0  # drawn length of a robot's field of view of unlimited range
PICTURE_STEPS = 600  # control steps in a picture over time, a row each; robots are side by side
MAX_COLUMNS = 4096  # most columns of that picture; robots beyond them are left out
GAP, BETWEEN = 4, 2  # columns between two robots, and their class

FAINT = (90, 90, 100)
DARK = (62, 67, 78)
LAMP = (255, 200, 0)
YELLOW = (240, 200, 40)
RINGS = rr.AnnotationContext([(0, "dark", DARK), (1, "lit", LIT)])
"""Rings differ in brightness, too, for people who cannot tell red from green. White numbers have a contrast of 4.8 on
lit rings and of 10 on dark ones."""

PULSES = rr.AnnotationContext([(0, "receives", (95, 105, 135)), (1, "is shifted", YELLOW)])
SIGHTS = rr.AnnotationContext([(0, "in view", (75, 85, 110)), (1, "seen lit", LIT)])
PIXELS = rr.AnnotationContext([(0, "dark", (30, 30, 34)), (1, "red", (225, 40, 40)), (BETWEEN, "", (90, 90, 96))])

MEANINGS = {
    "robot": (
        "Disc: a robot, bright red while its ring is lit; white arrow: its heading.",
        "Grey lines: the edges of its field of view. Coloured arrows: from a camera to each robot in its view, red if "
        "it sees that lit. Yellow dot: contact.",
    ),
    "agent": (
        "Disc: an agent, bright red when it has just fired; white arrow: its heading.",
        "Grey lines: its cone, or how far it reaches. Coloured arrows: from who fires to each who receives the pulse, "
        "yellow if that shifts its phase.",
    ),
}
"""Legends for robots and for agents: for all recordings with an arena, and in addition for full ones."""

_STROKES = (
    ((0, 0), (1, 0), (1, 2), (0, 2), (0, 0)),
    ((1, 0), (1, 2)),
    ((0, 0), (1, 0), (1, 1), (0, 1), (0, 2), (1, 2)),
    ((0, 0), (1, 0), (1, 1), (0, 1), (1, 1), (1, 2), (0, 2)),
    ((0, 0), (0, 1), (1, 1), (1, 0), (1, 2)),
    ((1, 0), (0, 0), (0, 1), (1, 1), (1, 2), (0, 2)),
    ((1, 0), (0, 0), (0, 2), (1, 2), (1, 1), (0, 1)),
    ((0, 0), (1, 0), (1, 2)),
    ((0, 0), (1, 0), (1, 2), (0, 2), (0, 1), (1, 1), (0, 1), (0, 0)),
    ((1, 1), (0, 1), (0, 0), (1, 0), (1, 2), (0, 2)),
)
"""Corners of each digit, as on a display of seven segments; y points down."""

SCALE, PITCH, THICKNESS = 0.32, 0.55, 0.1
"""Width of a digit, half its height, distance from one digit to the next, and thickness of lines; in rows."""


def row_numbers(rows: int) -> rr.LineStrips2D:
    """Return the numbers of the rows of a picture, to its left, right-aligned."""
    strips = [strip for row in range(rows) for strip in number_strips(row, -PITCH, row + 0.5 - SCALE)]
    return rr.LineStrips2D(strips, radii=THICKNESS / 2, colors=WHITE)


def number_strips(number: int, right: float, top: float) -> list[FloatArray]:
    """Return a strip, (corners, 2), for each digit of a number, whose last digit is at `right` and `top`."""
    lefts = right - SCALE - PITCH * np.arange(len(str(number)))[::-1]
    digits = zip(lefts, map(int, str(number)), strict=True)
    return [(left, top) + SCALE * np.array(_STROKES[digit], float) for left, digit in digits]


LEGIBLE_SHARE = 1 / 15  # smallest diameter of a disc that has room for a number, as a share of the arena's longer side

ON_DISC, BESIDE_DISC = (1.1, 0.4), (1.8, 1.9)
"""Size of numbers, relative to row numbers of rows as high as the disc's radius, and their distance behind the middle
of their disc, in radii."""


def static_arena_entities(population: Population, level: Level) -> Iterator[Chunk]:
    """Yield floor, lamps, walls and obstacles that stay, and the appearance of movables and of robots or agents."""
    arena = population.arena
    drawn = MEANINGS[population.noun][: 1 if level is Level.POSES else None]
    yield static_chunk(LEGEND, rr.TextDocument(" ".join(drawn)))
    width, height = population.largest_cm
    yield static_chunk(ARENA, rr.Transform3D(translation=[0, height, 0], mat3x3=np.diag([1, -1, 1])))
    if not arena.floor.is_white:
        levels = floor_levels(replace(arena, width_cm=width, height_cm=height), FLOOR_PX)
        rows, columns = levels.shape
        pixel_cm = np.diag([width / columns, -height / rows, 1])  # rows count downwards
        yield static_chunk(FLOOR, rr.Transform3D(translation=[0, height, 0], mat3x3=pixel_cm))
        yield static_chunk(FLOOR, rr.Image(levels, color_model="L", draw_order=-10))
    if len(arena.lamps):
        labels = [f"{above:g} cm, strength {strength:g}" for _, _, above, strength in arena.lamps]
        lamps = rr.Points2D(arena.lamps[:, :2], radii=arena.lamp_cm, colors=LAMP, labels=labels, draw_order=10)
        yield static_chunk(LAMPS, lamps)
    for entity, outlines in ((WALLS, _wall_outlines(arena)), (OBSTACLES, _obstacle_outlines(arena))):
        if population.arena_changes:
            yield static_chunk(entity, rr.LineStrips2D.from_fields(colors=GREY))
        elif outlines:
            yield static_chunk(entity, rr.LineStrips2D(outlines, colors=GREY))
    if len(arena.movables):
        radii = arena.circles[arena.first_movable :, 2]
        yield static_chunk(MOVABLES, rr.Points2D.from_fields(radii=radii, colors=GREY, draw_order=15))
    yield static_chunk(ROBOTS, RINGS)
    yield static_chunk(ROBOTS, rr.Points2D.from_fields(radii=population.radii_cm, show_labels=False, draw_order=20))
    if population.size < MOST_NUMBERED:
        size, _ = number_style(population)
        for number, radius_cm in enumerate(population.radii_cm):
            digits = number_strips(number, 0.0, 0.0)
            middle = (np.vstack(digits).min(axis=0) + np.vstack(digits).max(axis=0)) / 2
            strips = [size * radius_cm * (digit - middle) * (1, -1) for digit in digits]
            thin = size * radius_cm * THICKNESS / 2
            yield static_chunk(f"{NUMBERS}/{number}", rr.LineStrips2D(strips, radii=thin, colors=WHITE, draw_order=35))
    arrows = rr.Arrows2D.from_fields(colors=WHITE, radii=ARROW_RADIUS * population.radii_cm, draw_order=30)
    yield static_chunk(HEADINGS, arrows)


def _wall_outlines(arena: Arena) -> list[FloatArray]:
    width, height = arena.width_cm, arena.height_cm
    return [np.array([(0, 0), (width, 0), (width, height), (0, height), (0, 0)])]


def _obstacle_outlines(arena: Arena) -> list[FloatArray]:
    """Return the outline of each obstacle, (corners, 2) cm, whose last corner is its first one."""
    angles = np.linspace(0, 2 * math.pi, CIRCLE_CORNERS + 1)
    rounds = [(x, y) + r * unit_vectors(angles) for x, y, r in arena.circles[: arena.first_movable]]
    return rounds + [np.vstack([corners, corners[:1]]) for corners in arena.polygons]


def number_style(population: Population) -> tuple[float, float]:
    """Return the size of numbers and their distance from the middle: they are beside discs that are too small."""
    return ON_DISC if 2 * population.radii_cm.min() >= LEGIBLE_SHARE * max(population.largest_cm) else BESIDE_DISC


def arena_entities(batch: RowBatch, population: Population) -> Iterator[Chunk]:
    """Yield positions, headings and rings in these rows, movables, and walls that change."""
    if population.arena_changes:
        rows, arenas = zip(*batch.arenas, strict=True)
        for entity, outlines_of in ((WALLS, _wall_outlines), (OBSTACLES, _obstacle_outlines)):
            outlines = [outlines_of(arena) for arena in arenas]
            strips = rr.LineStrips2D.columns(strips=[*chain.from_iterable(outlines)])
            yield temporal_chunk(entity, batch.time_ns[[*rows]], strips, [*map(len, outlines)])
    count, time_ns, places = population.size, batch.time_ns, batch.poses[..., :2]
    ahead = population.radii_cm[:, None] * unit_vectors(batch.poses[..., 2])
    middles, rings = places.reshape(-1, 2), batch.ring_on.ravel().astype(np.uint16)
    yield temporal_chunk(ROBOTS, time_ns, rr.Points2D.columns(positions=middles, class_ids=rings), count)
    yield temporal_chunk(HEADINGS, time_ns, rr.Arrows2D.columns(origins=middles, vectors=ahead.reshape(-1, 2)), count)
    if count < MOST_NUMBERED:
        behind = places - number_style(population)[1] * ahead
        behind = np.nan_to_num(np.pad(behind, ((0, 0), (0, 0), (0, 1))), nan=NOWHERE_CM)
        for number in range(count):
            moved = rr.Transform3D.columns(translation=behind[:, number])
            yield temporal_chunk(f"{NUMBERS}/{number}", time_ns, moved)
    if batch.movables.size:
        pushed = rr.Points2D.columns(positions=batch.movables.reshape(-1, 2))
        yield temporal_chunk(MOVABLES, time_ns, pushed, batch.movables.shape[1])


def static_ranges(ranges_cm: FloatArray, thin_cm: float) -> Chunk:
    """Return the appearance of circles of (circles,) radii; `thin_cm` is half the thickness of a line."""
    sizes = np.column_stack([ranges_cm, ranges_cm])
    return static_chunk(RANGES, rr.Ellipses2D.from_fields(half_sizes=sizes, colors=FAINT, line_radii=thin_cm))


def ranges(middles: FloatArray, batch: RowBatch) -> Chunk:
    """Return the circles in these rows, around `middles`, (rows, circles, 2) cm."""
    circles = rr.Ellipses2D.columns(centers=middles.reshape(-1, 2))
    return temporal_chunk(RANGES, batch.time_ns, circles, middles.shape[1])


def unit_vectors(angle: FloatArray) -> FloatArray:
    """Return (..., 2) the unit vectors of angles, (...) rad."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def ray_ends(origins: FloatArray, rays: FloatArray, longest_cm: FloatArray | float, arena: Arena) -> FloatArray:
    """Return (..., 2) cm: ends of rays from within the walls, `longest_cm` away, or at the outer walls if nearer.

    Origins are (..., 2) cm, rays (..., 2) unit vectors, `longest_cm` is (...); obstacles do not stop rays.
    """
    walls = np.array([arena.width_cm, arena.height_cm])
    ahead = np.where(rays > 0, walls - origins, origins)  # distance to the next wall, along each axis
    to_walls = (ahead / np.maximum(np.abs(rays), 1e-9)).min(axis=-1)
    ends: FloatArray = origins + np.clip(to_walls, 0, longest_cm)[..., None] * rays
    return ends


def line_strips(entity: str, time_ns: IntArray, strips: FloatArray) -> Chunk:
    """Return a chunk of strips of k points, (rows, strips, k, 2): rerun's own conversion loops over strips."""
    rows, count, corners, _ = strips.shape
    flat = pa.FixedSizeListArray.from_arrays(pa.array(strips.astype(np.float32).ravel()), 2)
    offsets = pa.array(np.arange(rows * count + 1, dtype=np.int32) * corners)
    array = pa.ListArray.from_arrays(offsets, flat).cast(rr.components.LineStrip2DBatch._ARROW_DATATYPE)
    return temporal_chunk(entity, time_ns, rr.LineStrips2D.columns(strips=array), count)


class AgentLayers:
    """Cones or ranges, and pulse links.

    Cones are drawn in squares only: a segment has no angles, and a cube is seen from above.
    """

    def __init__(self, scenario: ParticleScenario, population: Population) -> None:
        rule = scenario.neighbourhood
        radius_cm = rule.radius_cm if isinstance(rule, Cone | Range) else None
        is_sector = isinstance(rule, Cone) and rule.angle_deg < 360
        self._population = population
        self._range_cm = None if is_sector else radius_cm
        self._cone_cm = UNBOUNDED_SHARE * scenario.space.side_cm if radius_cm is None else radius_cm
        self._arc: FloatArray | None = None  # (corners,) rad: angles from the heading to the corners of a cone's arc
        if isinstance(rule, Cone) and is_sector and scenario.space.dimensions == 2:
            half = math.radians(rule.angle_deg) / 2
            self._arc = np.linspace(-half, half, 1 + math.ceil(2 * half / ARC_STEP_RAD))

    def static_chunks(self) -> Iterator[Chunk]:
        """Yield the appearance of cones, ranges and links."""
        thin = 0.03 * self._population.radii_cm[0]
        if self._arc is not None:
            yield static_chunk(CONES, rr.LineStrips2D.from_fields(colors=FAINT, radii=thin, draw_order=10))
        if self._range_cm is not None:
            yield static_ranges(np.full(self._population.size, self._range_cm), thin)
        yield static_chunk(LINKS, PULSES)
        yield static_chunk(LINKS, rr.Arrows2D.from_fields(radii=2 * thin, show_labels=False, draw_order=15))

    def chunks(self, batch: RowBatch) -> Iterator[Chunk]:
        """Yield cones, ranges and links in these rows."""
        middles, time_ns = batch.poses[..., :2], batch.time_ns
        if self._arc is not None:
            rays = unit_vectors(batch.poses[..., 2, None] + self._arc)
            apex = middles[:, :, None]
            arc = ray_ends(apex, rays, self._cone_cm, self._population.arena)
            yield line_strips(CONES, time_ns, np.concatenate([apex, arc, apex], axis=2))
        if self._range_cm is not None:
            yield ranges(middles, batch)
        rows, firing, receiving, is_shifted = batch.links.T
        ways = middles[rows, receiving] - middles[rows, firing]
        if self._population.is_cyclic:  # across the edge where that is shorter
            side_cm = self._population.arena.width_cm
            ways -= side_cm * np.rint(ways / side_cm)
        shifts = is_shifted.astype(np.uint16)
        arrows = rr.Arrows2D.columns(origins=middles[rows, firing], vectors=ways, class_ids=shifts)
        yield temporal_chunk(LINKS, time_ns, arrows, np.bincount(rows, minlength=len(time_ns)))


class RobotLayers:
    """Overlays of the arena, sensor readings and wheel speeds of robots."""

    def __init__(self, scenario: EmbodiedScenario, population: Population) -> None:
        """Compile the search for sightings and contacts, before any clock runs."""
        self._scenario, self._population = scenario, population
        counts = [group.count for group in scenario.robots]
        outlines = [_outline(*each) for each in zip(scenario.robots, scenario.group_kinds, strict=True)]
        self._forward_cm, self._longest_cm, self._half_rad, self._circle_cm = np.repeat(outlines, counts, axis=0).T
        self._encircled = np.flatnonzero(self._circle_cm)
        self._step_ns = scenario.timing.step_ms * 1_000_000
        self._minutes = 0  # pictures over time so far
        self._side_by_side = max(1, min(population.size, MAX_COLUMNS // (scenario.camera_pixels + GAP)))
        self._rows = np.empty((0, self._side_by_side, scenario.camera_pixels), np.uint8)  # of the next picture
        self._scene = partial(make_scene, scenario.robots, scenario.group_kinds)  # of an arena
        scene, nowhere = self._scene(population.arena), np.zeros((0, population.size, 3))
        find_sightings(scene, nowhere)
        find_contacts(scene, nowhere)

    def static_chunks(self) -> Iterator[Chunk]:
        """Yield the appearance of overlays, pictures and wheel speeds."""
        sides = [f"{robot} {side}" for robot in robot_names(self._population) for side in ("left", "right")]
        yield static_chunk(WHEELS, rr.SeriesLines(names=sides, **KEEP_EXTREMES))
        yield static_chunk(VIEWS, rr.LineStrips2D.from_fields(colors=FAINT, radii=0.1, draw_order=10))
        if len(self._encircled) > 0:
            yield static_ranges(self._circle_cm[self._encircled], thin_cm=0.1)
        yield static_chunk(SIGHTINGS, SIGHTS)
        yield static_chunk(SIGHTINGS, rr.Arrows2D.from_fields(radii=0.1, show_labels=False, draw_order=5))
        yield static_chunk(CONTACTS, rr.Points2D.from_fields(radii=0.6, colors=YELLOW, draw_order=40))
        robots, pixels = self._population.size, self._scenario.camera_pixels
        minute = self._side_by_side * (pixels + GAP), PICTURE_STEPS
        for entity, size in ((CAMERA, (pixels, robots)), (SPACE_TIME, minute)):
            yield static_chunk(entity, PIXELS)
            yield static_chunk(entity, rr.SegmentationImage.from_fields(format=_format(*size, "U8")))
        ranges_cm = [kind.infrared.range_cm for kind in self._scenario.group_kinds if kind.infrared]
        depths_mm = [0, 10 * max(ranges_cm, default=ProximitySection().range_cm)]
        # from red to blue; distances out of range are as blue as far ones
        colours: dict[str, Any] = {"meter": 1000, "depth_range": depths_mm, "colormap": "spectral"}
        yield static_chunk(INFRARED, rr.DepthImage.from_fields(format=_format(SENSORS, robots, "U16"), **colours))
        for numbers in (CAMERA_NUMBERS, INFRARED_NUMBERS):
            yield static_chunk(numbers, row_numbers(robots))

    def chunks(self, batch: RowBatch) -> Iterator[Chunk]:
        """Yield the drawings of these steps."""
        poses, time_ns = batch.poses, batch.time_ns
        yield scalars(WHEELS, time_ns, batch.wheels_cm_s)
        yield line_strips(VIEWS, time_ns, self._views(batch))
        if len(self._encircled) > 0:
            yield ranges(poses[:, self._encircled, :2], batch)
        yield from self._links(batch)
        rows, distances = batch.camera.reshape(len(poses), -1), batch.distance_mm.reshape(len(poses), -1)
        yield temporal_chunk(CAMERA, time_ns, rr.SegmentationImage.columns(buffer=rows))
        yield temporal_chunk(INFRARED, time_ns, rr.DepthImage.columns(buffer=distances.view(np.uint8)))
        self._rows = np.concatenate([self._rows, batch.camera[:, : self._side_by_side]])
        while len(self._rows) >= PICTURE_STEPS:
            yield from self.final_chunks()

    def final_chunks(self) -> Iterator[Chunk]:
        """Yield the picture of the current minute, robots side by side, if it has any rows, and begin the next."""
        rows, self._rows = np.split(self._rows, [PICTURE_STEPS])
        if len(rows):
            robots, pixels = rows.shape[1:]
            picture = np.full((1, PICTURE_STEPS, robots, pixels + GAP), BETWEEN, np.uint8)
            picture[..., :pixels] = 0
            picture[0, : len(rows), :, :pixels] = rows
            began_ns = np.array([self._minutes * PICTURE_STEPS * self._step_ns])
            self._minutes += 1
            yield temporal_chunk(SPACE_TIME, began_ns, rr.SegmentationImage.columns(buffer=picture.reshape(1, -1)))

    def _views(self, batch: RowBatch) -> FloatArray:
        """Return (steps, robots, 3, 2) cm: left end, apex and right end of each view or cone, within the walls."""
        heading = batch.poses[..., 2]
        eyes = batch.poses[..., :2] + self._forward_cm[:, None] * unit_vectors(heading)
        sides = [unit_vectors(heading + self._half_rad), unit_vectors(heading - self._half_rad)]
        views = np.stack([eyes] * 3, axis=2)
        for steps, arena in _stretches(batch):
            for place, rays in zip((0, 2), sides, strict=True):
                views[steps, :, place] = ray_ends(eyes[steps], rays[steps], self._longest_cm, arena)
        return views

    def _links(self, batch: RowBatch) -> Iterator[Chunk]:
        """Yield arrows to the robots in view, and contacts; a ring is seen as it was commanded a step before."""
        poses, time_ns, seen_parts, touched_parts, points = batch.poses, batch.time_ns, [], [], []
        for first_step, some, arena in _moments(batch):
            scene, first = self._scene(arena), np.array([first_step, 0, 0])
            seen_parts.append(first + find_sightings(scene, some))
            contacts, places = find_contacts(scene, some)
            touched_parts.append(first + contacts)
            points.append(places)
        found = np.concatenate(seen_parts)
        for whom in (1, 2):  # robots parked outside see nobody, and are not seen
            found = found[~np.isnan(poses[found[:, 0], found[:, whom], 0])]
        steps, observers, seen = found.T
        forward_cm = self._forward_cm[observers, None]
        origins = poses[steps, observers, :2] + forward_cm * unit_vectors(poses[steps, observers, 2])
        lit = batch.ring_before[steps, seen].astype(np.uint16)
        arrows = rr.Arrows2D.columns(origins=origins, vectors=poses[steps, seen, :2] - origins, class_ids=lit)
        yield temporal_chunk(SIGHTINGS, time_ns, arrows, np.bincount(steps, minlength=len(poses)))
        steps = np.concatenate(touched_parts)[:, 0]
        dots = rr.Points2D.columns(positions=np.concatenate(points))
        yield temporal_chunk(CONTACTS, time_ns, dots, np.bincount(steps, minlength=len(poses)))


def _format(width: int, height: int, number: Literal["U8", "U16"]) -> rr.components.ImageFormat:
    return rr.components.ImageFormat(width=width, height=height, channel_datatype=number)


def _stretches(batch: RowBatch) -> Iterator[tuple[slice, Arena]]:
    """Yield each stretch of steps with the same walls and obstacles, and its arena."""
    ends = [row for row, _ in batch.arenas[1:]] + [len(batch.poses)]
    for (first, arena), end in zip(batch.arenas, ends, strict=True):
        yield slice(first, end), arena


def _moments(batch: RowBatch) -> Iterator[tuple[int, FloatArray, Arena]]:
    """Yield stretches in which nothing in the arena moves: first step, (steps, robots, 3) poses, and the arena."""
    for steps, arena in _stretches(batch):
        poses = parked(batch.poses[steps])
        if not batch.movables.size:
            yield steps.start, poses, arena
            continue
        for step, places in enumerate(batch.movables[steps]):
            yield steps.start + step, poses[step : step + 1], arena.with_movables_at(places)


def _outline(group: RobotGroup, robot: RobotKind) -> tuple[float, float, float, float]:
    """Return the outline of a group's fields of view, or cones.

    It is their distance ahead of a robot's centre and their length, 0 if they are all around, cm; the angle of their
    edges to straight ahead, rad; and the radius within which signals are received from all around, cm, or 0.
    """
    signal = group.signal
    if isinstance(signal, CameraSignal):
        longest_cm = group.camera.range_cm or UNBOUNDED_VIEW_CM
        return robot.camera_forward_cm, longest_cm, half_view_rad(group.camera), 0.0
    if signal.angle_deg == 360:
        return 0.0, 0.0, math.pi, signal.range_cm or 0.0
    return 0.0, signal.range_cm or UNBOUNDED_VIEW_CM, math.radians(signal.angle_deg / 2), 0.0
