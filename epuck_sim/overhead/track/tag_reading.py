"""Reads the ArUco tags on top of robots in the frames of a film, in the light or by infrared light."""

from array import array
from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.film.frame import Frame, Picture
from epuck_sim.overhead.tags import tag_dictionary
from epuck_sim.overhead.track.light import Light

BRIGHT = 200.0
"""Level to which the paper of tags is brightened: OpenCV's thresholds are those of well lit pictures."""

MAX_GAIN = 10.0
"""Largest factor by which pictures are brightened: more would show noise alone."""

PAPER_SHARE = 0.98
"""Share of the pixels that are darker than the paper of tags."""

SAMPLED_PX = 4
"""Distance of the pixels from which the brightness is known."""


class Tag(NamedTuple):
    """A tag that was read."""

    number: int
    x_cm: float
    """Place of its middle in the arena's frame."""
    y_cm: float
    heading_rad: float
    """Direction of the top of its pattern, from -pi to pi."""


class Readings(NamedTuple):
    """The tags that were read in a film, as columns in order of time."""

    time_s: FloatArray
    number: IntArray
    poses: FloatArray
    """(readings, 3) cm, cm, rad: x, y, heading."""

    def of(self, keep: Iterable[bool]) -> "Readings":
        """Return some of them."""
        kept = np.asarray(keep, bool)
        return Readings(*(column[kept] for column in self))


class TagReader:
    """Reads tags in the pictures of one camera."""

    def __init__(self, camera: CameraModel, dictionary: str) -> None:
        self._camera = camera
        self._detector = cv2.aruco.ArucoDetector(tag_dictionary(dictionary))

    def read(self, picture: Picture) -> list[Tag]:
        """Return the tags in a picture, (height_px, width_px, 3) levels, by their numbers."""
        corners, numbers, _ = self._detector.detectMarkers(_brightened(picture))
        if numbers is None:
            return []
        pixels = np.reshape(corners, (-1, 2)).astype(float)
        corners_cm = self._camera.back_project(pixels, epuck.HEIGHT_CM).reshape(-1, 4, 2)
        ahead = corners_cm[:, :2].mean(axis=1) - corners_cm[:, 2:].mean(axis=1)
        headings = np.arctan2(ahead[:, 1], ahead[:, 0])
        rows = zip(np.ravel(numbers).tolist(), *corners_cm.mean(axis=1).T.tolist(), headings.tolist(), strict=True)
        return sorted(Tag(int(number), x, y, heading) for number, x, y, heading in rows)


def _brightened(picture: Picture) -> Light:
    """Return the least of the colours, in which lit rings are dim, made as bright as in a well lit room."""
    red, green, blue = cv2.split(picture)
    least = np.asarray(cv2.min(cv2.min(red, green), blue), np.uint8)
    paper = float(np.quantile(least[::SAMPLED_PX, ::SAMPLED_PX], PAPER_SHARE))
    gain = min(max(BRIGHT / max(paper, 1.0), 1.0), MAX_GAIN)
    return np.asarray(cv2.convertScaleAbs(least, alpha=gain), np.uint8)


def read_tags(frames: Iterable[Frame], reader: TagReader) -> Readings:
    """Return all tags that are read in frames."""
    times, numbers, poses = array("d"), array("q"), array("d")
    for frame in frames:
        for tag in reader.read(frame.picture):
            times.append(frame.time_s)
            numbers.append(tag.number)
            poses.extend(tag[1:])
    return Readings(np.array(times), np.array(numbers, np.int64), np.array(poses).reshape(-1, 3))
