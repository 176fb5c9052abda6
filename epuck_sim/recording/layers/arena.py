"""What a recording shows in the arena, whatever its model: walls, obstacles, and who moves there.

Everything lies under `/arena`, in cm. Rerun's pictures have y down; a transform there turns them, so that data keep the
coordinates of the simulation.
"""

import math
from collections.abc import Iterator

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray
from epuck_sim.recording.buffers.robots import Columns
from epuck_sim.recording.chunks import moving, still
from epuck_sim.recording.population import Population

ARENA = "/arena"
WALLS = "/arena/walls"
OBSTACLES = "/arena/obstacles"

ROBOTS = "/arena/robots"
"""(count,) discs in each row, robots or agents, of class 1 while the ring is lit, or the flash is seen."""

HEADINGS = "/arena/headings"
"""(count,) arrows in each row, from the middle to the front of the disc."""

MANY = 50
"""Of so many, none has its number drawn beside it."""

CORNERS = 64
"""Of a round obstacle's outline."""

GREY = (150, 150, 150)
FAINT = (90, 90, 100)
WHITE = (255, 255, 255)
RINGS = rr.AnnotationContext([(0, "dark", (120, 125, 135)), (1, "lit", (230, 40, 40))])

SHAFT = 0.25 / 3.7
"""Half as thick is an arrow that shows a heading, if the disc has radius 1."""


def set_ground(subject: Population) -> Iterator[Chunk]:
    """Yield what does not move, and how it looks."""
    width, height = subject.arena.width_cm, subject.arena.height_cm
    yield still(ARENA, rr.Transform3D(translation=[0, height, 0], mat3x3=np.diag([1, -1, 1])))
    yield still(WALLS, rr.LineStrips2D([[(0, 0), (width, 0), (width, height), (0, height), (0, 0)]], colors=GREY))
    angles = np.linspace(0, 2 * math.pi, CORNERS + 1)
    rounds = [(x + r * np.cos(angles), y + r * np.sin(angles)) for x, y, r in subject.arena.circles]
    outlines = [np.column_stack(each) for each in rounds] + [
        np.vstack([corners, corners[:1]]) for corners in subject.arena.polygons
    ]
    if outlines:
        yield still(OBSTACLES, rr.LineStrips2D(outlines, colors=GREY))
    labels = [str(number) for number in range(subject.size)] if subject.size < MANY else None
    yield still(ROBOTS, RINGS)
    body = rr.Points2D.from_fields(
        radii=subject.radius_cm, labels=labels, show_labels=labels is not None, draw_order=20
    )
    yield still(ROBOTS, body)
    yield still(HEADINGS, rr.Arrows2D.from_fields(colors=WHITE, radii=SHAFT * subject.radius_cm, draw_order=30))


def ground(columns: Columns, radius_cm: float) -> Iterator[Chunk]:
    """Yield who is where in these rows, and lit; radius_cm: of the discs."""
    poses, time_ns = columns.poses, columns.time_ns
    each = np.full(len(poses), poses.shape[1])
    middles = poses[..., :2].reshape(-1, 2)
    ahead = radius_cm * towards(poses[..., 2]).reshape(-1, 2)
    rings = columns.ring_on.ravel().astype(np.uint16)
    yield moving(ROBOTS, time_ns, *rr.Points2D.columns(positions=middles, class_ids=rings).partition(each))
    yield moving(HEADINGS, time_ns, *rr.Arrows2D.columns(origins=middles, vectors=ahead).partition(each))


def towards(angle: FloatArray) -> FloatArray:
    """Return (..., 2) the unit vectors of (...) angles, rad."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def ends_of_rays(origins: FloatArray, rays: FloatArray, longest_cm: float, arena: Arena) -> FloatArray:
    """Return (..., 2) cm where rays end that go as far as `longest_cm`, or to the arena's outer walls.

    origins: (..., 2) cm, within the walls; rays: (..., 2) unit vectors.
    """
    walls = np.array([arena.width_cm, arena.height_cm])
    ahead = np.where(rays > 0, walls - origins, origins)  # how far the next wall is, along each axis
    to_walls = (ahead / np.maximum(np.abs(rays), 1e-9)).min(axis=-1)
    ends: FloatArray = origins + np.clip(to_walls, 0, longest_cm)[..., None] * rays
    return ends


def strip_columns(strips: FloatArray) -> rr.ComponentColumnList:
    """Return (rows, strips, k, 2) points as strips of k, a row each: rerun's own conversion takes them one by one."""
    rows, count, corners, _ = strips.shape
    flat = pa.FixedSizeListArray.from_arrays(pa.array(strips.astype(np.float32).ravel()), 2)
    offsets = pa.array(np.arange(rows * count + 1, dtype=np.int32) * corners)
    array = pa.ListArray.from_arrays(offsets, flat).cast(rr.components.LineStrip2DBatch._ARROW_DATATYPE)
    return rr.LineStrips2D.columns(strips=array).partition(np.full(rows, count))
