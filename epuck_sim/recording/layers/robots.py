"""What a full recording shows of robots: fields of view, who sees whom, contacts, wheels, and sensors as pictures."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray, IntArray
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
from epuck_sim.recording.layers.series import static_wheel_series, wheel_series
from epuck_sim.recording.rows import Population, RowBatch
from epuck_sim.recording.rrd_file import static_chunk, temporal_chunk
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robot_kind import ProximitySection, RobotKind
from epuck_sim.scenario.robots import CameraSignal, RobotGroup

CAMERA = "/camera/rows"
"""Entity with a picture at each step: a row for each robot, of class 1 where a lit ring is seen."""

SPACE_TIME = "/camera/space_time"
"""Entity with a picture for each minute at 10 Hz (`PICTURE_STEPS` control steps).

Time runs down, a row for each step; robots are side by side, separated by columns of class 2.
"""

INFRARED = "/infrared"
"""Entity with a picture at each step: a row for each robot, a column for each sensor; mm, 65535 if out of range."""

CAMERA_NUMBERS = "/camera/rows/numbers"
"""Entity with the number of the robot beside each row of the camera's picture."""

INFRARED_NUMBERS = "/infrared/numbers"
"""Entity with the number of the robot beside each row of infrared distances."""

BETWEEN = 2
"""Class of the columns between two robots."""

GAP = 4
"""Number of columns between two robots."""

MAX_COLUMNS = 4096
"""Most columns of the picture over time; robots that find no room are left out."""

PICTURE_STEPS = 600
"""Control steps in a picture over time."""

COLOURS = rr.AnnotationContext([(0, "dark", (30, 30, 34)), (1, "red", (225, 40, 40)), (BETWEEN, "", (90, 90, 96))])


def static_image_entities(scenario: EmbodiedScenario) -> Iterator[Chunk]:
    """Yield the formats and colours of the pictures."""
    robots, pixels = scenario.robot_count, scenario.camera_pixels
    for camera in (CAMERA, SPACE_TIME):
        yield static_chunk(camera, COLOURS)
    yield static_chunk(CAMERA, rr.SegmentationImage.from_fields(format=_format(pixels, robots, rr.ChannelDatatype.U8)))
    minute = _format(_columns_side_by_side(scenario), PICTURE_STEPS, rr.ChannelDatatype.U8)
    yield static_chunk(SPACE_TIME, rr.SegmentationImage.from_fields(format=minute))
    ranges_cm = [kind.infrared.range_cm for kind in scenario.group_kinds if kind.infrared]
    infrared = rr.DepthImage.from_fields(
        format=_format(SENSORS, robots, rr.ChannelDatatype.U16),
        meter=1000,
        depth_range=[0, 10 * max(ranges_cm, default=ProximitySection().range_cm)],
        colormap="spectral",  # from red to blue; what is out of range is as blue as what is far
    )
    yield static_chunk(INFRARED, infrared)
    for numbers in (CAMERA_NUMBERS, INFRARED_NUMBERS):
        yield static_chunk(numbers, row_numbers(robots))


def image_entities(batch: RowBatch) -> Iterator[Chunk]:
    """Yield the camera rows and the infrared distances at these steps."""
    steps = len(batch.time_ns)
    rows, distances = batch.camera.reshape(steps, -1), batch.distance_mm.reshape(steps, -1).view(np.uint8)
    yield temporal_chunk(CAMERA, batch.time_ns, *rr.SegmentationImage.columns(buffer=rows))
    yield temporal_chunk(INFRARED, batch.time_ns, *rr.DepthImage.columns(buffer=distances))


class SpaceTime:
    """The picture of the current minute: camera rows over time, robots side by side."""

    def __init__(self, scenario: EmbodiedScenario) -> None:
        self._pixels = pixels = scenario.camera_pixels
        robots = _columns_side_by_side(scenario) // (pixels + GAP)
        self._blank = np.full((PICTURE_STEPS, robots, pixels + GAP), BETWEEN, np.uint8)
        self._blank[:, :, :pixels] = 0
        self._picture = self._blank.copy()
        self._filled = 0
        self._began_ns = 0

    def chunks(self, batch: RowBatch) -> Iterator[Chunk]:
        """Yield the pictures that these steps complete, each at the time of its first row."""
        camera = batch.camera[:, : self._blank.shape[1]]
        step = 0
        while step < len(camera):
            if self._filled == 0:
                self._began_ns = batch.time_ns[step]
            rows = camera[step : step + PICTURE_STEPS - self._filled]
            self._picture[self._filled : self._filled + len(rows), :, : self._pixels] = rows
            self._filled += len(rows)
            step += len(rows)
            if self._filled == PICTURE_STEPS:
                yield from self.final_chunks()

    def final_chunks(self) -> Iterator[Chunk]:
        """Yield the current picture, if it has any rows, and begin the next."""
        if self._filled:
            buffer = self._picture.reshape(1, -1)
            yield temporal_chunk(SPACE_TIME, np.array([self._began_ns]), *rr.SegmentationImage.columns(buffer=buffer))
            self._picture = self._blank.copy()
            self._filled = 0


def _columns_side_by_side(scenario: EmbodiedScenario) -> int:
    """Return the number of columns of a picture over time: a gap follows the pixels of each robot."""
    columns = scenario.camera_pixels + GAP
    return columns * max(1, min(scenario.robot_count, MAX_COLUMNS // columns))


def _format(width: int, height: int, number: rr.ChannelDatatype) -> rr.components.ImageFormat:
    """Return the format of a picture with one number per pixel."""
    return rr.components.ImageFormat(width=width, height=height, channel_datatype=number)


VIEWS = "/arena/views"
"""Entity with (robots,) strips at each step, along the edges of the camera's central window, or of a cone."""

SIGHTINGS = "/arena/sightings"
"""Entity with arrows at each step, from a camera to each robot in its view; of class 1 if it sees that robot lit."""

CONTACTS = "/arena/contacts"
"""Entity with points at each step, where robots touch each other, walls and obstacles."""

UNBOUNDED_VIEW_CM = 12.0
"""Drawn length of a field of view of unlimited range, cm."""

YELLOW = (240, 200, 40)
SIGHTS = rr.AnnotationContext([(0, "in view", (75, 85, 110)), (1, "seen lit", LIT)])


class Outline(NamedTuple):
    """The edges of a field of view or cone."""

    forward_cm: float
    """How far ahead of a robot's centre they begin."""
    longest_cm: float
    """Their length."""
    half_angle_rad: float
    """Angle between each and straight ahead."""


class RobotLayers:
    """Overlays of the arena, sensor readings and wheel speeds of robots."""

    def __init__(self, scenario: EmbodiedScenario, population: Population) -> None:
        """Compile what finds sightings and contacts, before any clock runs."""
        self._scenario, self._population = scenario, population
        self._groups: list[tuple[int, int, Outline]] = []
        """For each group: number of its first robot, number of its robots, and the outline of its view."""
        first = 0
        for group, kind in zip(scenario.robots, scenario.group_kinds, strict=True):
            self._groups.append((first, group.count, _outline(group, kind)))
            first += group.count
        counts = [group.count for group in scenario.robots]
        self._forward_cm = np.repeat([outline.forward_cm for *_, outline in self._groups], counts)
        self._circles_cm = np.repeat([_circle_cm(group) for group in scenario.robots], counts)
        self._encircled = np.flatnonzero(self._circles_cm)
        self._space_time = SpaceTime(scenario)
        scene, nowhere = self._scene(population.arena), np.zeros((0, population.size, 3))
        find_sightings(scene, nowhere)
        find_contacts(scene, nowhere)

    def _scene(self, arena: Arena) -> Scene:
        return make_scene(self._scenario.robots, self._scenario.group_kinds, arena)

    def static_chunks(self) -> Iterator[Chunk]:
        """Yield the appearance of overlays, pictures and wheel speeds."""
        yield from static_wheel_series(self._population)
        yield static_chunk(VIEWS, rr.LineStrips2D.from_fields(colors=FAINT, radii=0.1, draw_order=10))
        if len(self._encircled) > 0:
            yield static_ranges(self._circles_cm[self._encircled], thin_cm=0.1)
        yield static_chunk(SIGHTINGS, SIGHTS)
        yield static_chunk(SIGHTINGS, rr.Arrows2D.from_fields(radii=0.1, show_labels=False, draw_order=5))
        yield static_chunk(CONTACTS, rr.Points2D.from_fields(radii=0.6, colors=YELLOW, draw_order=40))
        yield from static_image_entities(self._scenario)

    def chunks(self, batch: RowBatch) -> Iterator[Chunk]:
        """Yield what these steps show."""
        yield from wheel_series(batch)
        yield from self._overlays(batch)
        yield from image_entities(batch)
        yield from self._space_time.chunks(batch)

    def final_chunks(self) -> Iterator[Chunk]:
        """Yield the camera rows of the last minute."""
        return self._space_time.final_chunks()

    def _overlays(self, batch: RowBatch) -> Iterator[Chunk]:
        """Yield fields of view, sightings and contacts at these steps."""
        poses, time_ns = batch.poses, batch.time_ns
        yield temporal_chunk(VIEWS, time_ns, *strip_columns(self._views(batch)))
        if len(self._encircled) > 0:
            yield ranges(poses[:, self._encircled, :2], batch)
        yield self._sightings(batch)
        found, points = self._contacts(batch)
        touching = np.bincount(found[:, 0], minlength=len(poses))
        yield temporal_chunk(CONTACTS, time_ns, *rr.Points2D.columns(positions=points).partition(touching))

    def _moments(self, batch: RowBatch) -> Iterator[tuple[int, FloatArray, Arena]]:
        """Yield the first of some steps, their (steps, robots, 3) poses, and the arena, in which nothing moves then."""
        for steps, arena in _stretches(batch):
            poses = parked(batch.poses[steps])
            if not len(batch.movables):
                yield steps.start, poses, arena
            for step, places in enumerate(batch.movables[steps]):
                yield steps.start + step, poses[step : step + 1], arena.with_movables_at(places)

    def _contacts(self, batch: RowBatch) -> tuple[IntArray, FloatArray]:
        """Return the contacts at these steps as `find_contacts` does."""
        found, points = [], []
        for first_step, poses, arena in self._moments(batch):
            contacts, places = find_contacts(self._scene(arena), poses)
            contacts[:, 0] += first_step
            found.append(contacts)
            points.append(places)
        return np.concatenate(found), np.concatenate(points)

    def _views(self, batch: RowBatch) -> FloatArray:
        """Return (steps, robots, 3, 2) cm: left end, apex and right end of each view or cone, within the walls."""
        return np.concatenate([self._views_in(arena, batch.poses[steps]) for steps, arena in _stretches(batch)])

    def _views_in(self, arena: Arena, poses: FloatArray) -> FloatArray:
        """Return `_views` of (steps, robots, 3) poses in one arena."""
        views = np.empty((*poses.shape[:2], 3, 2))
        for first, robots, (forward_cm, longest_cm, half_angle_rad) in self._groups:
            x, y, heading = poses[:, first : first + robots].transpose(2, 0, 1)
            eye = np.stack([x, y], axis=-1) + forward_cm * unit_vectors(heading)
            views[:, first : first + robots, 1] = eye
            for place, side in ((0, 1), (2, -1)):
                rays = unit_vectors(heading + side * half_angle_rad)
                views[:, first : first + robots, place] = ray_ends(eye, rays, longest_cm, arena)
        return views

    def _sightings(self, batch: RowBatch) -> Chunk:
        """Return the arrows to the robots in view; a ring is seen as it was commanded a step before."""
        poses = batch.poses
        groups = []
        for first_step, some, arena in self._moments(batch):
            scene = self._scene(arena)
            for group in range(len(self._groups)):
                groups.append(find_sightings(scene, some, group))
                groups[-1][:, 0] += first_step
        found = np.concatenate(groups)
        found = found[~np.isnan(poses[found[:, 0], found[:, 1], 0])]  # who is parked outside sees nobody
        found = found[~np.isnan(poses[found[:, 0], found[:, 2], 0])]
        steps, observers, seen = found[np.argsort(found[:, 0], kind="stable")].T
        forward_cm = self._forward_cm[observers, None]
        origins = poses[steps, observers, :2] + forward_cm * unit_vectors(poses[steps, observers, 2])
        lit = batch.ring_before[steps, seen].astype(np.uint16)
        arrows = rr.Arrows2D.columns(origins=origins, vectors=poses[steps, seen, :2] - origins, class_ids=lit)
        return temporal_chunk(SIGHTINGS, batch.time_ns, *arrows.partition(np.bincount(steps, minlength=len(poses))))


def _stretches(batch: RowBatch) -> Iterator[tuple[slice, Arena]]:
    """Yield the steps in which the same walls and obstacles stand, and an arena with them."""
    ends = [row for row, _ in batch.arenas[1:]] + [len(batch.poses)]
    for (first, arena), end in zip(batch.arenas, ends, strict=True):
        yield slice(first, end), arena


def _outline(group: RobotGroup, robot: RobotKind) -> Outline:
    """Return the outline of the fields of view, or cones, of a group of some kind of robot; of no length all around."""
    signal = group.signal
    if isinstance(signal, CameraSignal):
        return Outline(robot.camera_forward_cm, _longest(group.camera.range_cm), half_view_rad(group.camera))
    longest_cm = 0.0 if signal.angle_deg == 360 else _longest(signal.range_cm)
    return Outline(0.0, longest_cm, math.radians(signal.angle_deg / 2))


def _longest(range_cm: float | None) -> float:
    """Return the drawn length of a range, cm."""
    return range_cm or UNBOUNDED_VIEW_CM


def _circle_cm(group: RobotGroup) -> float:
    """Return the radius in cm within which a group's robots receive signals from all around; 0 if there is none."""
    signal = group.signal
    if isinstance(signal, CameraSignal) or signal.angle_deg < 360:
        return 0.0
    return signal.range_cm or 0.0
