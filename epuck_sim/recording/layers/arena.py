"""The arena as a recording shows it, whatever its model: floor, lamps, walls, obstacles, movables, robots or agents.

Everything lies under `/arena`, in cm. In rerun's pictures y points down; a transform there flips them, so that data
keep the coordinates of the simulation.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arena import Arena, floor_levels
from epuck_sim.arrays import FloatArray
from epuck_sim.recording.chunks import static_chunk, temporal_chunk
from epuck_sim.recording.population import Population
from epuck_sim.recording.rows import RowBatch

ARENA = "/arena"
"""Entity with the transform."""

WALLS = "/arena/walls"
"""Entity with the arena's outline."""

OBSTACLES = "/arena/obstacles"
"""Entity with the outlines of obstacles."""

MOVABLES = "/arena/movables"
"""Entity with a disc for each movable in each row."""

FLOOR = "/arena/floor"
"""Entity with a grey picture of a floor that is not white."""

LAMPS = "/arena/lamps"
"""Entity with a point for each lamp."""

ROBOTS = "/arena/robots"
"""Entity with (count,) discs in each row, robots or agents, of class 1 while the ring is lit or the flash is shown."""

HEADINGS = "/arena/headings"
"""Entity with (count,) arrows in each row, from the middle to the front of the disc."""

RANGES = "/arena/ranges"
"""Entity with circles in each row, as far as flashes or pulses are received from all around."""

UNLABELLED = 50
"""Swarms of this size or larger are drawn without number labels."""

CIRCLE_CORNERS = 64
"""Corners of a round obstacle's outline."""

FLOOR_PX = 1024
"""Longer side of the picture of a floor, in pixels."""

GREY = (150, 150, 150)
FAINT = (90, 90, 100)
WHITE = (255, 255, 255)
LIT = (255, 80, 60)
DARK = (75, 80, 92)
YELLOW = (255, 200, 0)
RINGS = rr.AnnotationContext([(0, "dark", DARK), (1, "lit", LIT)])
"""Rings differ in brightness, too, for those who do not tell red from green."""

NUMBERS = (0, 125, 225)
"""Colour of numbers: as far in brightness from the viewer's dark theme as from its light one."""

ARROW_RADIUS = 0.25 / 3.7
"""Half-thickness of a heading arrow, relative to the disc's radius."""


def static_arena_entities(population: Population) -> Iterator[Chunk]:
    """Yield floor, lamps, walls and obstacles that stay, and the appearance of movables and of robots or agents."""
    arena = population.arena
    width, height = population.largest_cm
    yield static_chunk(ARENA, rr.Transform3D(translation=[0, height, 0], mat3x3=np.diag([1, -1, 1])))
    yield from _floor_and_lamps(replace(arena, width_cm=width, height_cm=height))
    if population.arena_changes:
        for entity in (WALLS, OBSTACLES):
            yield static_chunk(entity, rr.LineStrips2D.from_fields(colors=GREY))
    else:
        outlines = _obstacle_outlines(arena)
        yield static_chunk(WALLS, rr.LineStrips2D([_wall_outline(arena)], colors=GREY))
        if outlines:
            yield static_chunk(OBSTACLES, rr.LineStrips2D(outlines, colors=GREY))
    if len(arena.movables):
        radii = arena.circles[arena.first_movable :, 2]
        yield static_chunk(MOVABLES, rr.Points2D.from_fields(radii=radii, colors=GREY, draw_order=15))
    labels = [str(number) for number in range(population.size)] if population.size < UNLABELLED else None
    yield static_chunk(ROBOTS, RINGS)
    discs = rr.Points2D.from_fields(
        radii=population.radii_cm, labels=labels, show_labels=labels is not None, draw_order=20
    )
    yield static_chunk(ROBOTS, discs)
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


def changing_walls(batch: RowBatch) -> Iterator[Chunk]:
    """Yield walls and obstacles in these rows."""
    time_ns = batch.time_ns[[row for row, _ in batch.arenas]]
    arenas = [arena for _, arena in batch.arenas]
    obstacles = [_obstacle_outlines(arena) for arena in arenas]
    everything = [outline for outlines in obstacles for outline in outlines]
    for entity, strips, counts in (
        (WALLS, list(map(_wall_outline, arenas)), [1] * len(arenas)),
        (OBSTACLES, everything, list(map(len, obstacles))),
    ):
        yield temporal_chunk(entity, time_ns, *rr.LineStrips2D.columns(strips=strips).partition(counts))


def _wall_outline(arena: Arena) -> FloatArray:
    """Return (5, 2) cm: the corners of the floor, and the first one again."""
    width, height = arena.width_cm, arena.height_cm
    return np.array([(0, 0), (width, 0), (width, height), (0, height), (0, 0)])


def _obstacle_outlines(arena: Arena) -> list[FloatArray]:
    """Return the outline of each obstacle, (corners, 2) cm, whose last corner is its first one."""
    angles = np.linspace(0, 2 * math.pi, CIRCLE_CORNERS + 1)
    rounds = [(x + r * np.cos(angles), y + r * np.sin(angles)) for x, y, r in arena.circles[: arena.first_movable]]
    return [np.column_stack(each) for each in rounds] + [
        np.vstack([corners, corners[:1]]) for corners in arena.polygons
    ]


def arena_entities(batch: RowBatch, radii_cm: FloatArray) -> Iterator[Chunk]:
    """Yield positions, headings and rings in these rows, and movables; (robots,) `radii_cm` are of the discs."""
    poses, time_ns = batch.poses, batch.time_ns
    each = np.full(len(poses), poses.shape[1])
    middles = poses[..., :2].reshape(-1, 2)
    ahead = (radii_cm[:, None] * unit_vectors(poses[..., 2])).reshape(-1, 2)
    rings = batch.ring_on.ravel().astype(np.uint16)
    discs = rr.Points2D.columns(positions=middles, class_ids=rings)
    yield temporal_chunk(ROBOTS, time_ns, *discs.partition(each))
    arrows = rr.Arrows2D.columns(origins=middles, vectors=ahead)
    yield temporal_chunk(HEADINGS, time_ns, *arrows.partition(each))
    if len(batch.movables):
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


def ray_ends(origins: FloatArray, rays: FloatArray, longest_cm: float, arena: Arena) -> FloatArray:
    """Return (..., 2) cm: where rays end that reach `longest_cm`, or the arena's outer walls if those are nearer.

    Args:
        origins: (..., 2) cm, within the walls.
        rays: (..., 2) unit vectors.
        longest_cm: Longest ray, cm.
        arena: Its obstacles stop no rays.
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
