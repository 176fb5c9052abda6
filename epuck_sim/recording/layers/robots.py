"""What a full recording shows of robots: fields of view, who sees whom, contacts, wheels, and sensors as pictures."""

import math
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray
from epuck_sim.control.interface import SENSORS
from epuck_sim.embodied.changes.attendance import parked
from epuck_sim.embodied.observers import Scene, find_contacts, find_sightings, make_scene
from epuck_sim.embodied.sensors.camera import half_view_rad
from epuck_sim.recording.layers.arena import (
    FAINT,
    LIT,
    ranges,
    ray_ends,
    row_numbers,
    static_ranges,
    strip_columns,
    unit_vectors,
)
from epuck_sim.recording.layers.series import KEEP_EXTREMES, WHEELS, robot_names, scalar_columns
from epuck_sim.recording.rows import Population, RowBatch
from epuck_sim.recording.rrd_file import static_chunk, temporal_chunk
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robot_kind import ProximitySection, RobotKind
from epuck_sim.scenario.robots import CameraSignal, RobotGroup

CAMERA = "/camera/rows"
CAMERA_NUMBERS = "/camera/rows/numbers"
SPACE_TIME = "/camera/space_time"
INFRARED = "/infrared"
INFRARED_NUMBERS = "/infrared/numbers"
VIEWS = "/arena/views"
SIGHTINGS = "/arena/sightings"
CONTACTS = "/arena/contacts"

PICTURE_STEPS = 600  # control steps in a picture over time, a row each; robots are side by side
MAX_COLUMNS = 4096  # of that picture; robots that find no room are left out
GAP, BETWEEN = 4, 2  # columns between two robots, and their class
UNBOUNDED_VIEW_CM = 12.0  # drawn length of a field of view of unlimited range

YELLOW = (240, 200, 40)
SIGHTS = rr.AnnotationContext([(0, "in view", (75, 85, 110)), (1, "seen lit", LIT)])
COLOURS = rr.AnnotationContext([(0, "dark", (30, 30, 34)), (1, "red", (225, 40, 40)), (BETWEEN, "", (90, 90, 96))])


def _format(width: int, height: int, number: Literal["U8", "U16"]) -> rr.components.ImageFormat:
    """Return the format of a picture with one number per pixel."""
    return rr.components.ImageFormat(width=width, height=height, channel_datatype=number)


class RobotLayers:
    """Overlays of the arena, sensor readings and wheel speeds of robots."""

    def __init__(self, scenario: EmbodiedScenario, population: Population) -> None:
        """Compile what finds sightings and contacts, before any clock runs."""
        self._scenario, self._population = scenario, population
        counts = [group.count for group in scenario.robots]
        outlines = [_outline(*each) for each in zip(scenario.robots, scenario.group_kinds, strict=True)]
        self._forward_cm, self._longest_cm, self._half_rad, self._circle_cm = np.repeat(outlines, counts, axis=0).T
        self._encircled = np.flatnonzero(self._circle_cm)
        self._step_ns = scenario.timing.step_ms * 1_000_000
        self._minutes = 0  # pictures over time so far
        self._side_by_side = max(1, min(population.size, MAX_COLUMNS // (scenario.camera_pixels + GAP)))
        self._rows = np.empty((0, self._side_by_side, scenario.camera_pixels), np.uint8)  # of the next picture
        scene, nowhere = self._scene(population.arena), np.zeros((0, population.size, 3))
        find_sightings(scene, nowhere)
        find_contacts(scene, nowhere)

    def _scene(self, arena: Arena) -> Scene:
        return make_scene(self._scenario.robots, self._scenario.group_kinds, arena)

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
        yield from self._static_pictures()

    def _static_pictures(self) -> Iterator[Chunk]:
        robots, pixels = self._population.size, self._scenario.camera_pixels
        minute = self._side_by_side * (pixels + GAP), PICTURE_STEPS
        for entity, size in ((CAMERA, (pixels, robots)), (SPACE_TIME, minute)):
            yield static_chunk(entity, COLOURS)
            yield static_chunk(entity, rr.SegmentationImage.from_fields(format=_format(*size, "U8")))
        ranges_cm = [kind.infrared.range_cm for kind in self._scenario.group_kinds if kind.infrared]
        depths_mm = [0, 10 * max(ranges_cm, default=ProximitySection().range_cm)]
        # from red to blue; what is out of range is as blue as what is far
        colours: dict[str, Any] = {"meter": 1000, "depth_range": depths_mm, "colormap": "spectral"}
        yield static_chunk(INFRARED, rr.DepthImage.from_fields(format=_format(SENSORS, robots, "U16"), **colours))
        for numbers in (CAMERA_NUMBERS, INFRARED_NUMBERS):
            yield static_chunk(numbers, row_numbers(robots))

    def chunks(self, batch: RowBatch) -> Iterator[Chunk]:
        """Yield what these steps show."""
        poses, time_ns = batch.poses, batch.time_ns
        yield temporal_chunk(WHEELS, time_ns, *scalar_columns(batch.wheels_cm_s))
        yield temporal_chunk(VIEWS, time_ns, *strip_columns(self._views(batch)))
        if len(self._encircled) > 0:
            yield ranges(poses[:, self._encircled, :2], batch)
        yield from self._links(batch)
        rows, distances = batch.camera.reshape(len(poses), -1), batch.distance_mm.reshape(len(poses), -1)
        yield temporal_chunk(CAMERA, time_ns, *rr.SegmentationImage.columns(buffer=rows))
        yield temporal_chunk(INFRARED, time_ns, *rr.DepthImage.columns(buffer=distances.view(np.uint8)))
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
            buffer = rr.SegmentationImage.columns(buffer=picture.reshape(1, -1))
            yield temporal_chunk(SPACE_TIME, began_ns, *buffer)

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
            seen_parts += [first + find_sightings(scene, some, group) for group in range(len(self._scenario.robots))]
            contacts, places = find_contacts(scene, some)
            touched_parts.append(first + contacts)
            points.append(places)
        found = np.concatenate(seen_parts)
        for whom in (1, 2):  # who is parked outside sees nobody, and is not seen
            found = found[~np.isnan(poses[found[:, 0], found[:, whom], 0])]
        steps, observers, seen = found[np.argsort(found[:, 0], kind="stable")].T
        forward_cm = self._forward_cm[observers, None]
        origins = poses[steps, observers, :2] + forward_cm * unit_vectors(poses[steps, observers, 2])
        lit = batch.ring_before[steps, seen].astype(np.uint16)
        arrows = rr.Arrows2D.columns(origins=origins, vectors=poses[steps, seen, :2] - origins, class_ids=lit)
        yield temporal_chunk(SIGHTINGS, time_ns, *arrows.partition(np.bincount(steps, minlength=len(poses))))
        steps = np.concatenate(touched_parts)[:, 0]
        dots = rr.Points2D.columns(positions=np.concatenate(points))
        yield temporal_chunk(CONTACTS, time_ns, *dots.partition(np.bincount(steps, minlength=len(poses))))


def _stretches(batch: RowBatch) -> Iterator[tuple[slice, Arena]]:
    """Yield the steps in which the same walls and obstacles stand, and an arena with them."""
    ends = [row for row, _ in batch.arenas[1:]] + [len(batch.poses)]
    for (first, arena), end in zip(batch.arenas, ends, strict=True):
        yield slice(first, end), arena


def _moments(batch: RowBatch) -> Iterator[tuple[int, FloatArray, Arena]]:
    """Yield the first of some steps, their (steps, robots, 3) poses, and the arena, in which nothing moves then."""
    for steps, arena in _stretches(batch):
        poses = parked(batch.poses[steps])
        if not batch.movables.size:
            yield steps.start, poses, arena
            continue
        for step, places in enumerate(batch.movables[steps]):
            yield steps.start + step, poses[step : step + 1], arena.with_movables_at(places)


def _outline(group: RobotGroup, robot: RobotKind) -> tuple[float, float, float, float]:
    """Return how a group's fields of view, or cones, are drawn.

    That is how far ahead of a robot's centre they begin, and their length, 0 all around, cm; the angle of their edges
    to straight ahead, rad; and the radius within which signals are received from all around, cm, or 0.
    """
    signal = group.signal
    if isinstance(signal, CameraSignal):
        longest_cm = group.camera.range_cm or UNBOUNDED_VIEW_CM
        return robot.camera_forward_cm, longest_cm, half_view_rad(group.camera), 0.0
    if signal.angle_deg == 360:
        return 0.0, 0.0, math.pi, signal.range_cm or 0.0
    return 0.0, signal.range_cm or UNBOUNDED_VIEW_CM, math.radians(signal.angle_deg / 2), 0.0
