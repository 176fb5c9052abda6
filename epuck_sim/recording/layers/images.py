"""What a recording shows as pictures: camera rows, their course over time, and infrared distances."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim import epuck
from epuck_sim.embodied.infrared import SENSORS
from epuck_sim.recording.buffers.robots import Columns
from epuck_sim.recording.chunks import moving, still
from epuck_sim.scenario.embodied import EmbodiedScenario

Pixels = npt.NDArray[np.uint8]

CAMERA = "/camera/rows"
"""A picture at each step: a row a robot, of class 1 where a lit ring is seen."""

SPACE_TIME = "/camera/space_time"
"""A picture for each minute: time runs down, a row a step; robot beside robot, with columns of class 2 between two.

A minute at 10 Hz, that is: `PICTURE_STEPS` control steps.
"""

INFRARED = "/infrared"
"""A picture at each step: a row a robot, a column a sensor, in mm; 65535 where nothing is in range."""

BETWEEN = 2
GAP = 4
"""The class and the number of the columns between two robots."""

MAX_COLUMNS = 4096
"""Of the picture over time, which shows but the first of more robots."""

PICTURE_STEPS = 600

COLOURS = rr.AnnotationContext([(0, "dark", (30, 30, 34)), (1, "red", (225, 40, 40)), (BETWEEN, "", (90, 90, 96))])


def set_pictures(scenario: EmbodiedScenario) -> Iterator[Chunk]:
    """Yield the formats of the pictures, and how they look."""
    robots, pixels = scenario.robot_count, scenario.camera_pixels
    for camera in (CAMERA, SPACE_TIME):
        yield still(camera, COLOURS)
    yield still(CAMERA, rr.SegmentationImage.from_fields(format=_format(pixels, robots, rr.ChannelDatatype.U8)))
    minute = _format(_side_by_side(scenario), PICTURE_STEPS, rr.ChannelDatatype.U8)
    yield still(SPACE_TIME, rr.SegmentationImage.from_fields(format=minute))
    infrared = rr.DepthImage.from_fields(
        format=_format(SENSORS, robots, rr.ChannelDatatype.U16),
        meter=1000,
        depth_range=[10 * epuck.INFRARED_RANGE_CM, 0],
        colormap="turbo",
    )
    yield still(INFRARED, infrared)


def pictures(columns: Columns) -> Iterator[Chunk]:
    """Yield the camera rows and the infrared distances at these steps."""
    steps = len(columns.time_ns)
    rows, distances = columns.camera.reshape(steps, -1), columns.distance_mm.reshape(steps, -1).view(np.uint8)
    yield moving(CAMERA, columns.time_ns, *rr.SegmentationImage.columns(buffer=rows))
    yield moving(INFRARED, columns.time_ns, *rr.DepthImage.columns(buffer=distances))


class SpaceTime:
    """The running minute of camera rows, robot beside robot."""

    def __init__(self, scenario: EmbodiedScenario) -> None:
        self._pixels = pixels = scenario.camera_pixels
        robots = _side_by_side(scenario) // (pixels + GAP)
        self._blank = np.full((PICTURE_STEPS, robots, pixels + GAP), BETWEEN, np.uint8)
        self._blank[:, :, :pixels] = 0
        self._picture = self._blank.copy()
        self._filled = 0
        self._began_ns = 0

    def pictures(self, columns: Columns) -> Iterator[Chunk]:
        """Yield the pictures that these steps complete, each at the time when it began."""
        camera = columns.camera[:, : self._blank.shape[1]]
        step = 0
        while step < len(camera):
            if self._filled == 0:
                self._began_ns = columns.time_ns[step]
            rows = camera[step : step + PICTURE_STEPS - self._filled]
            self._picture[self._filled : self._filled + len(rows), :, : self._pixels] = rows
            self._filled += len(rows)
            step += len(rows)
            if self._filled == PICTURE_STEPS:
                yield from self.rest()

    def rest(self) -> Iterator[Chunk]:
        """Yield the running picture, if there is anything in it, and begin the next."""
        if self._filled:
            buffer = self._picture.reshape(1, -1)
            yield moving(SPACE_TIME, np.array([self._began_ns]), *rr.SegmentationImage.columns(buffer=buffer))
            self._picture = self._blank.copy()
            self._filled = 0


def _side_by_side(scenario: EmbodiedScenario) -> int:
    """Return the columns that the rows of as many robots take as find room, with a gap after each."""
    columns = scenario.camera_pixels + GAP
    return columns * max(1, min(scenario.robot_count, MAX_COLUMNS // columns))


def _format(width: int, height: int, number: rr.ChannelDatatype) -> rr.components.ImageFormat:
    """Return the format of a picture with one number a pixel."""
    return rr.components.ImageFormat(width=width, height=height, channel_datatype=number)
