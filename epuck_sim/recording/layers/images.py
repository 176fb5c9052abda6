"""Pictures in a recording: camera rows, their course over time, and infrared distances."""

from collections.abc import Iterator

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.control.interface import SENSORS
from epuck_sim.recording.buffers.row_batch import RowBatch
from epuck_sim.recording.chunks import static_chunk, temporal_chunk
from epuck_sim.recording.layers.numerals import row_numbers
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robot_kind import ProximitySection

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
