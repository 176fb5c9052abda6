"""What a full recording shows of robots in the arena: fields of view, who sees whom, contacts."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim import epuck
from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.cell_list import CellList, make_cell_list
from epuck_sim.embodied.line_camera import Camera
from epuck_sim.embodied.sensing import build_camera
from epuck_sim.recording.buffers.robots import Columns
from epuck_sim.recording.chunks import moving, still
from epuck_sim.recording.layers.arena import FAINT, ends_of_rays, strip_columns, towards
from epuck_sim.recording.relations.contacts import find_contacts
from epuck_sim.recording.relations.visibility import find_sightings
from epuck_sim.scenario.embodied import EmbodiedScenario

VIEWS = "/arena/views"
"""(robots,) strips at each step, along the outermost rays of the camera's central window."""

SIGHTINGS = "/arena/sightings"
"""Arrows at each step, from a camera to each robot in its view; of class 1 where it sees that robot lit."""

CONTACTS = "/arena/contacts"
"""Points at each step, where robots touch each other, walls and obstacles."""

VIEW_CM = 12.0
"""So far a field of view is drawn, where it has no end."""

YELLOW = (240, 200, 40)
LINKS = rr.AnnotationContext([(0, "in view", (75, 85, 110)), (1, "seen lit", (230, 40, 40))])


class Stage(NamedTuple):
    """What stays as it is during a trial."""

    arena: Arena
    cells: CellList
    eyes: list[tuple[int, int, Camera]]
    """Of each group: the number of its first robot, its robots, and their camera."""


def make_stage(scenario: EmbodiedScenario) -> Stage:
    """Return a scenario's stage."""
    arena = scenario.arena.build()
    eyes, first = [], 0
    for group in scenario.robots:
        eyes.append((first, group.count, build_camera(group.camera)))
        first += group.count
    return Stage(arena, make_cell_list(arena.width_cm, arena.height_cm, scenario.robot_count), eyes)


def warm_up(stage: Stage) -> None:
    """Have compiled what `scene` calls, before any clock runs."""
    alone = np.zeros((1, 1, 3))
    find_sightings(alone, stage.arena, stage.cells, stage.eyes[0][2], 0, 1)
    find_contacts(alone, stage.arena, stage.cells)


def set_scene() -> Iterator[Chunk]:
    """Yield how it looks."""
    yield still(VIEWS, rr.LineStrips2D.from_fields(colors=FAINT, radii=0.1, draw_order=10))
    yield still(SIGHTINGS, LINKS)
    yield still(SIGHTINGS, rr.Arrows2D.from_fields(radii=0.1, show_labels=False, draw_order=5))
    yield still(CONTACTS, rr.Points2D.from_fields(radii=0.6, colors=YELLOW, draw_order=40))


def scene(columns: Columns, stage: Stage) -> Iterator[Chunk]:
    """Yield who sees and touches whom at these steps."""
    poses, time_ns = columns.poses, columns.time_ns
    yield moving(VIEWS, time_ns, *strip_columns(_views(poses, stage)))
    yield _sightings(columns, stage)
    steps, points = find_contacts(poses, stage.arena, stage.cells)
    touching = np.bincount(steps, minlength=len(poses))
    yield moving(CONTACTS, time_ns, *rr.Points2D.columns(positions=points).partition(touching))


def _views(poses: FloatArray, stage: Stage) -> FloatArray:
    """Return (steps, robots, 3, 2) cm: left end, camera and right end of each field of view, within the walls."""
    views = np.empty((*poses.shape[:2], 3, 2))
    for first, robots, camera in stage.eyes:
        x, y, heading = poses[:, first : first + robots].transpose(2, 0, 1)
        eye = np.stack([x, y], axis=-1) + epuck.CAMERA_FORWARD_CM * towards(heading)
        views[:, first : first + robots, 1] = eye
        longest_cm = camera.range_cm if camera.range_cm < math.inf else VIEW_CM
        for place, side in ((0, 1), (2, -1)):
            rays = towards(heading + side * camera.half_view_rad)
            views[:, first : first + robots, place] = ends_of_rays(eye, rays, longest_cm, stage.arena)
    return views


def _sightings(columns: Columns, stage: Stage) -> Chunk:
    """Return the arrows to the robots in view; a ring is seen as it was commanded a step before."""
    poses = columns.poses
    groups = [find_sightings(poses, stage.arena, stage.cells, camera, first, n) for first, n, camera in stage.eyes]
    found = np.concatenate(groups)
    steps, observers, seen = found[np.argsort(found[:, 0], kind="stable")].T
    origins = poses[steps, observers, :2] + epuck.CAMERA_FORWARD_CM * towards(poses[steps, observers, 2])
    lit = columns.ring_before[steps, seen].astype(np.uint16)
    arrows = rr.Arrows2D.columns(origins=origins, vectors=poses[steps, seen, :2] - origins, class_ids=lit)
    return moving(SIGHTINGS, columns.time_ns, *arrows.partition(np.bincount(steps, minlength=len(poses))))
