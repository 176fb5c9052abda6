"""What a recording shows in the arena: walls, robots, fields of view, who sees whom, contacts.

Everything lies under `/arena`, in cm. Rerun's pictures have y down; a transform there turns them, so that data keep the
coordinates of the simulation.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim import epuck
from epuck_sim.arena import Arena
from epuck_sim.camera import Camera
from epuck_sim.cells import Cells, make_cells
from epuck_sim.embodied import EmbodiedScenario
from epuck_sim.recording.chunks import moving, still
from epuck_sim.recording.contacts import find_contacts
from epuck_sim.recording.level import Level
from epuck_sim.recording.sight import find_sightings
from epuck_sim.recording.window import Columns
from epuck_sim.sensing import build_camera

Floats = npt.NDArray[np.float64]

ARENA = "/arena"
WALLS = "/arena/walls"
OBSTACLES = "/arena/obstacles"

ROBOTS = "/arena/robots"
"""(robots,) discs at each step, of class 1 while the ring is lit."""

HEADINGS = "/arena/headings"
"""(robots,) arrows at each step, from the middle to the front of the body."""

VIEWS = "/arena/views"
"""(robots,) strips at each step, along the outermost rays of the camera's central window."""

SIGHTINGS = "/arena/sightings"
"""Arrows at each step, from a camera to each robot in its view; of class 1 where it sees that robot lit."""

CONTACTS = "/arena/contacts"
"""Points at each step, where robots touch each other, walls and obstacles."""

VIEW_CM = 12.0
"""So far a field of view is drawn, where it has no end."""

MANY = 50
"""Of so many robots, none has its number drawn beside it."""

CORNERS = 64
"""Of a round obstacle's outline."""

GREY = (150, 150, 150)
FAINT = (90, 90, 100)
WHITE = (255, 255, 255)
YELLOW = (240, 200, 40)
RINGS = rr.AnnotationContext([(0, "dark", (120, 125, 135)), (1, "lit", (230, 40, 40))])
LINKS = rr.AnnotationContext([(0, "in view", (75, 85, 110)), (1, "seen lit", (230, 40, 40))])


class Stage(NamedTuple):
    """What stays as it is during a trial."""

    arena: Arena
    cells: Cells
    eyes: list[tuple[int, int, Camera]]
    """Of each group: the number of its first robot, its robots, and their camera."""


def make_stage(scenario: EmbodiedScenario) -> Stage:
    """Return a scenario's stage."""
    arena = scenario.arena.build()
    eyes, first = [], 0
    for group in scenario.robots:
        eyes.append((first, group.count, build_camera(group.camera)))
        first += group.count
    return Stage(arena, make_cells(arena.width_cm, arena.height_cm, scenario.robot_count), eyes)


def warm_up(stage: Stage) -> None:
    """Have compiled what `scene` calls, before any clock runs."""
    alone = np.zeros((1, 1, 3))
    find_sightings(alone, stage.arena, stage.cells, stage.eyes[0][2], 0, 1)
    find_contacts(alone, stage.arena, stage.cells)


def set_scene(stage: Stage, robots: int, level: Level) -> Iterator[Chunk]:
    """Yield what does not move, and how it looks."""
    width, height = stage.arena.width_cm, stage.arena.height_cm
    yield still(ARENA, rr.Transform3D(translation=[0, height, 0], mat3x3=np.diag([1, -1, 1])))
    yield still(WALLS, rr.LineStrips2D([[(0, 0), (width, 0), (width, height), (0, height), (0, 0)]], colors=GREY))
    angles = np.linspace(0, 2 * math.pi, CORNERS + 1)
    rounds = [(x + r * np.cos(angles), y + r * np.sin(angles)) for x, y, r in stage.arena.circles]
    outlines = [np.column_stack(each) for each in rounds] + [
        np.vstack([corners, corners[:1]]) for corners in stage.arena.polygons
    ]
    if outlines:
        yield still(OBSTACLES, rr.LineStrips2D(outlines, colors=GREY))
    labels = [str(robot) for robot in range(robots)] if robots < MANY else None
    yield still(ROBOTS, RINGS)
    body = rr.Points2D.from_fields(radii=epuck.RADIUS_CM, labels=labels, show_labels=labels is not None, draw_order=20)
    yield still(ROBOTS, body)
    yield still(HEADINGS, rr.Arrows2D.from_fields(colors=WHITE, radii=0.25, draw_order=30))
    if level is Level.FULL:
        yield still(VIEWS, rr.LineStrips2D.from_fields(colors=FAINT, radii=0.1, draw_order=10))
        yield still(SIGHTINGS, LINKS)
        yield still(SIGHTINGS, rr.Arrows2D.from_fields(radii=0.1, show_labels=False, draw_order=5))
        yield still(CONTACTS, rr.Points2D.from_fields(radii=0.6, colors=YELLOW, draw_order=40))


def scene(columns: Columns, stage: Stage, level: Level) -> Iterator[Chunk]:
    """Yield what the arena shows at these steps."""
    poses, time_ns = columns.poses, columns.time_ns
    each = np.full(len(poses), poses.shape[1])
    middles = poses[..., :2].reshape(-1, 2)
    ahead = epuck.RADIUS_CM * _towards(poses[..., 2]).reshape(-1, 2)
    rings = columns.ring_on.ravel().astype(np.uint16)
    yield moving(ROBOTS, time_ns, *rr.Points2D.columns(positions=middles, class_ids=rings).partition(each))
    yield moving(HEADINGS, time_ns, *rr.Arrows2D.columns(origins=middles, vectors=ahead).partition(each))
    if level is Level.FULL:
        yield moving(VIEWS, time_ns, *rr.LineStrips2D.columns(strips=_strips(_views(poses, stage))).partition(each))
        yield _sightings(columns, stage)
        steps, points = find_contacts(poses, stage.arena, stage.cells)
        touching = np.bincount(steps, minlength=len(poses))
        yield moving(CONTACTS, time_ns, *rr.Points2D.columns(positions=points).partition(touching))


def _views(poses: Floats, stage: Stage) -> Floats:
    """Return (steps, robots, 3, 2) cm: left end, camera and right end of each field of view, within the walls."""
    walls = np.array([stage.arena.width_cm, stage.arena.height_cm])
    views = np.empty((*poses.shape[:2], 3, 2))
    for first, robots, camera in stage.eyes:
        x, y, heading = poses[:, first : first + robots].transpose(2, 0, 1)
        eye = np.stack([x, y], axis=-1) + epuck.CAMERA_FORWARD_CM * _towards(heading)
        views[:, first : first + robots, 1] = eye
        for place, side in ((0, 1), (2, -1)):
            ray = _towards(heading + side * camera.half_view_rad)
            ahead = np.where(ray > 0, walls - eye, eye)  # how far the next wall is, along each axis
            to_walls = (ahead / np.maximum(np.abs(ray), 1e-9)).min(axis=-1)
            length = np.clip(to_walls, 0, camera.range_cm if camera.range_cm < math.inf else VIEW_CM)
            views[:, first : first + robots, place] = eye + length[..., None] * ray
    return views


def _towards(angle: Floats) -> Floats:
    """Return (..., 2) the unit vectors of (...) angles."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _strips(points: Floats) -> pa.ListArray:
    """Return (..., k, 2) points as strips of k: rerun's own conversion takes them one by one."""
    strips = points.reshape(-1, *points.shape[-2:])
    flat = pa.FixedSizeListArray.from_arrays(pa.array(strips.astype(np.float32).ravel()), 2)
    offsets = pa.array(np.arange(len(strips) + 1, dtype=np.int32) * strips.shape[1])
    return pa.ListArray.from_arrays(offsets, flat).cast(rr.components.LineStrip2DBatch._ARROW_DATATYPE)


def _sightings(columns: Columns, stage: Stage) -> Chunk:
    """Return the arrows to the robots in view; a ring is seen as it was commanded a step before."""
    poses = columns.poses
    groups = [find_sightings(poses, stage.arena, stage.cells, camera, first, n) for first, n, camera in stage.eyes]
    found = np.concatenate(groups)
    steps, observers, seen = found[np.argsort(found[:, 0], kind="stable")].T
    origins = poses[steps, observers, :2] + epuck.CAMERA_FORWARD_CM * _towards(poses[steps, observers, 2])
    lit = columns.ring_before[steps, seen].astype(np.uint16)
    arrows = rr.Arrows2D.columns(origins=origins, vectors=poses[steps, seen, :2] - origins, class_ids=lit)
    return moving(SIGHTINGS, columns.time_ns, *arrows.partition(np.bincount(steps, minlength=len(poses))))
