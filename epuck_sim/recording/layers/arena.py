"""The arena as a recording shows it, whatever its model, and what surrounds and links point-like agents.

Everything lies under `/arena`, in cm. In rerun's pictures y points down; a transform there flips them, so that data
keep the coordinates of the simulation. What each entity holds is in docs/recordings.md.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arena import Arena, floor_levels
from epuck_sim.arrays import FloatArray
from epuck_sim.recording import Level
from epuck_sim.recording.rows import Population, RowBatch
from epuck_sim.recording.rrd_file import static_chunk, temporal_chunk
from epuck_sim.scenario.particles import Cone, ParticleScenario, Range

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
LEGEND = "/legend"

UNLABELLED = 50  # swarms of this size or larger are drawn without number labels

CIRCLE_CORNERS = 64  # of a round obstacle's outline
FLOOR_PX = 1024  # longer side of the picture of a floor
ARROW_RADIUS = 0.25 / 3.7  # half-thickness of a heading arrow, in radii of the disc
UNBOUNDED_SHARE = 1 / 8  # drawn length of a cone of unlimited range, as a share of the side
ARC_STEP_RAD = math.radians(12)  # largest angle between two corners of an arc
NOWHERE_CM = -1e5  # where numbers are whose robots are not in the arena, on both axes

GREY = (150, 150, 150)
FAINT = (90, 90, 100)
WHITE = (255, 255, 255)
LIT = (220, 40, 30)
DARK = (62, 67, 78)
YELLOW = (255, 200, 0)
NIGHT = (13, 16, 17)  # background of pictures, whatever the viewer's theme
RINGS = rr.AnnotationContext([(0, "dark", DARK), (1, "lit", LIT)])
"""Rings differ in brightness, too, for those who do not tell red from green. White numbers have a contrast of 4.8 on
lit ones and of 10 on dark ones."""

PULSES = rr.AnnotationContext([(0, "receives", (95, 105, 135)), (1, "is shifted", (240, 200, 40))])

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
"""What lines and arrows mean, of robots and of agents: in every recording, and besides in a full one."""

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
"""Width of a digit, which is twice as high, distance from one to the next, and thickness of lines; in rows."""


def row_numbers(rows: int) -> rr.LineStrips2D:
    """Return the numbers of the rows of a picture, to its left, right-aligned."""
    strips = [strip for row in range(rows) for strip in number_strips(row, -PITCH, row + 0.5 - SCALE)]
    return rr.LineStrips2D(strips, radii=THICKNESS / 2, colors=WHITE)


def number_width(rows: int) -> float:
    """Return how far the numbers of rows of a picture reach to its left, with a margin, in rows."""
    return SCALE + PITCH * len(str(rows - 1)) + 0.3


def number_strips(number: int, right: float, top: float) -> list[FloatArray]:
    """Return a strip, (corners, 2), for each digit of a number; `right` and `top` are those of its last digit."""
    lefts = right - SCALE - PITCH * np.arange(len(str(number)))[::-1]
    digits = zip(lefts, map(int, str(number)), strict=True)
    return [(left, top) + SCALE * np.array(_STROKES[digit], float) for left, digit in digits]


LEGIBLE_SHARE = 1 / 15  # smallest diameter of a disc that has room for a number, as a share of the arena's longer side

ON_DISC, BESIDE_DISC = (1.1, 0.4), (1.8, 1.9)
"""Size of numbers, as a share of those beside rows of a height of the disc's radius, and their distance from the middle
of their disc, away from the heading, in radii."""


def static_arena_entities(population: Population, level: Level) -> Iterator[Chunk]:
    """Yield floor, lamps, walls and obstacles that stay, and the appearance of movables and of robots or agents."""
    arena = population.arena
    drawn = MEANINGS[population.noun][: 1 if level is Level.POSES else None]
    yield static_chunk(LEGEND, rr.TextDocument(" ".join(drawn)))
    width, height = population.largest_cm
    yield static_chunk(ARENA, rr.Transform3D(translation=[0, height, 0], mat3x3=np.diag([1, -1, 1])))
    yield from _floor_and_lamps(replace(arena, width_cm=width, height_cm=height))
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
    if population.size < UNLABELLED:
        size, _ = number_style(population)
        for number, radius_cm in enumerate(population.radii_cm):
            digits = number_strips(number, 0.0, 0.0)
            middle = (np.vstack(digits).min(axis=0) + np.vstack(digits).max(axis=0)) / 2
            strips = [size * radius_cm * (digit - middle) * (1, -1) for digit in digits]
            thin = size * radius_cm * THICKNESS / 2
            yield static_chunk(f"{NUMBERS}/{number}", rr.LineStrips2D(strips, radii=thin, colors=WHITE, draw_order=35))
    arrows = rr.Arrows2D.from_fields(colors=WHITE, radii=ARROW_RADIUS * population.radii_cm, draw_order=30)
    yield static_chunk(HEADINGS, arrows)


def _floor_and_lamps(arena: Arena) -> Iterator[Chunk]:
    if not arena.floor.is_white:
        levels = floor_levels(arena, FLOOR_PX)
        rows, columns = levels.shape
        pixel_cm = np.diag([arena.width_cm / columns, -arena.height_cm / rows, 1])  # rows count downwards
        yield static_chunk(FLOOR, rr.Transform3D(translation=[0, arena.height_cm, 0], mat3x3=pixel_cm))
        yield static_chunk(FLOOR, rr.Image(levels, color_model="L", draw_order=-10))
    if len(arena.lamps):
        labels = [f"{height:g} cm, strength {strength:g}" for _, _, height, strength in arena.lamps]
        lamps = rr.Points2D(arena.lamps[:, :2], radii=arena.lamp_cm, colors=YELLOW, labels=labels, draw_order=10)
        yield static_chunk(LAMPS, lamps)


def _changing_walls(batch: RowBatch) -> Iterator[Chunk]:
    """Yield walls and obstacles in these rows."""
    rows, arenas = zip(*batch.arenas, strict=True)
    for entity, outlines_of in ((WALLS, _wall_outlines), (OBSTACLES, _obstacle_outlines)):
        outlines = [outlines_of(arena) for arena in arenas]
        strips = rr.LineStrips2D.columns(strips=[*chain.from_iterable(outlines)])
        yield temporal_chunk(entity, batch.time_ns[[*rows]], *strips.partition([*map(len, outlines)]))


def _wall_outlines(arena: Arena) -> list[FloatArray]:
    """Return the corners of the floor, and the first one again, (5, 2) cm, as a list of one outline."""
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
        yield from _changing_walls(batch)
    poses, time_ns = batch.poses, batch.time_ns
    each = np.full(len(poses), poses.shape[1])
    middles = poses[..., :2].reshape(-1, 2)
    ahead = (population.radii_cm[:, None] * unit_vectors(poses[..., 2])).reshape(-1, 2)
    rings = batch.ring_on.ravel().astype(np.uint16)
    discs = rr.Points2D.columns(positions=middles, class_ids=rings)
    yield temporal_chunk(ROBOTS, time_ns, *discs.partition(each))
    arrows = rr.Arrows2D.columns(origins=middles, vectors=ahead)
    yield temporal_chunk(HEADINGS, time_ns, *arrows.partition(each))
    if poses.shape[1] < UNLABELLED:
        behind = middles.reshape(each.size, -1, 2) - number_style(population)[1] * ahead.reshape(each.size, -1, 2)
        places = np.nan_to_num(np.pad(behind, ((0, 0), (0, 0), (0, 1))), nan=NOWHERE_CM)
        for number in range(poses.shape[1]):
            moved = rr.Transform3D.columns(translation=places[:, number])
            yield temporal_chunk(f"{NUMBERS}/{number}", time_ns, *moved)
    if batch.movables.size:
        pushed = rr.Points2D.columns(positions=batch.movables.reshape(-1, 2))
        yield temporal_chunk(MOVABLES, time_ns, *pushed.partition(np.full(len(poses), batch.movables.shape[1])))


def static_ranges(ranges_cm: FloatArray, thin_cm: float) -> Chunk:
    """Return the appearance of circles of (circles,) radii; `thin_cm` is half the thickness of a line."""
    sizes = np.column_stack([ranges_cm, ranges_cm])
    return static_chunk(RANGES, rr.Ellipses2D.from_fields(half_sizes=sizes, colors=FAINT, line_radii=thin_cm))


def ranges(middles: FloatArray, batch: RowBatch) -> Chunk:
    """Return the circles in these rows, about (rows, circles, 2) cm."""
    circles = rr.Ellipses2D.columns(centers=middles.reshape(-1, 2))
    return temporal_chunk(RANGES, batch.time_ns, *circles.partition(np.full(len(middles), middles.shape[1])))


def unit_vectors(angle: FloatArray) -> FloatArray:
    """Return (..., 2) the unit vectors of angles, (...) rad."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def ray_ends(origins: FloatArray, rays: FloatArray, longest_cm: FloatArray | float, arena: Arena) -> FloatArray:
    """Return (..., 2) cm where rays from within the walls end: so far off, or at the outer walls if those are nearer.

    Origins are (..., 2) cm, rays (..., 2) unit vectors, and (...) their lengths; obstacles stop none.
    """
    walls = np.array([arena.width_cm, arena.height_cm])
    ahead = np.where(rays > 0, walls - origins, origins)  # distance to the next wall, along each axis
    to_walls = (ahead / np.maximum(np.abs(rays), 1e-9)).min(axis=-1)
    ends: FloatArray = origins + np.clip(to_walls, 0, longest_cm)[..., None] * rays
    return ends


def strip_columns(strips: FloatArray) -> rr.ComponentColumnList:
    """Return strips of k points, (rows, strips, k, 2), as columns: rerun's own conversion is a loop over strips."""
    rows, count, corners, _ = strips.shape
    flat = pa.FixedSizeListArray.from_arrays(pa.array(strips.astype(np.float32).ravel()), 2)
    offsets = pa.array(np.arange(rows * count + 1, dtype=np.int32) * corners)
    array = pa.ListArray.from_arrays(offsets, flat).cast(rr.components.LineStrip2DBatch._ARROW_DATATYPE)
    return rr.LineStrips2D.columns(strips=array).partition(np.full(rows, count))


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
            yield temporal_chunk(CONES, time_ns, *strip_columns(np.concatenate([apex, arc, apex], axis=2)))
        if self._range_cm is not None:
            yield ranges(middles, batch)
        rows, firing, receiving, is_shifted = batch.links.T
        ways = middles[rows, receiving] - middles[rows, firing]
        if self._population.is_cyclic:  # across the edge where that is shorter
            side_cm = self._population.arena.width_cm
            ways -= side_cm * np.rint(ways / side_cm)
        shifts = is_shifted.astype(np.uint16)
        arrows = rr.Arrows2D.columns(origins=middles[rows, firing], vectors=ways, class_ids=shifts)
        yield temporal_chunk(LINKS, time_ns, *arrows.partition(np.bincount(rows, minlength=len(time_ns))))
