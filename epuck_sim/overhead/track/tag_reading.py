"""Reads the ArUco tags on top of robots in the frames of a film, in the light or by infrared light."""

from array import array
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.film.frame import Frame, Picture
from epuck_sim.overhead.tags import tag_dictionary, tag_modules
from epuck_sim.overhead.track.light import Light

BRIGHT = 200.0
"""Level to which the paper of tags is brightened: OpenCV's thresholds are those of well lit pictures."""

MAX_GAIN = 10.0
"""Largest factor by which pictures are brightened: more would show noise alone."""

PAPER_SHARE = 0.98
"""Share of the pixels that are darker than the paper of tags."""

WINDOWS_CM = (1.9, 3.4)
"""Sides of the squares around a pixel whose mean decides whether it is black or white. Of tags of 4 cm in dim light
the first finds 99.8 % of what both find, in half the time."""

LEAST_MODULE_PX = 1.5
"""Side of a tag's modules below which nothing is read."""

LARGEST_TAG_CM = 4 * epuck.RADIUS_CM
"""Side of the largest square that is taken for a tag, with a margin for cameras that hang askew."""

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
        self._quick, self._thorough = (
            cv2.aruco.ArucoDetector(tag_dictionary(dictionary), _parameters(camera, dictionary, windows_cm))
            for windows_cm in (WINDOWS_CM[:1], WINDOWS_CM)
        )
        self._most = 0  # tags that a picture had so far

    def read(self, picture: Picture) -> list[Tag]:
        """Return the tags in a picture, (height_px, width_px, 3) levels, by their numbers."""
        bright = _brightened(picture)
        corners, numbers, _ = self._quick.detectMarkers(bright)
        if len(corners) < self._most:  # some are gone, or hard to see
            corners, numbers, _ = self._thorough.detectMarkers(bright)
        self._most = max(self._most, len(corners))
        if not len(corners):
            return []
        pixels = np.reshape(corners, (-1, 2)).astype(float)
        corners_cm = self._camera.back_project(pixels, epuck.HEIGHT_CM).reshape(-1, 4, 2)
        ahead = corners_cm[:, :2].mean(axis=1) - corners_cm[:, 2:].mean(axis=1)
        headings = np.arctan2(ahead[:, 1], ahead[:, 0])
        rows = zip(np.ravel(numbers).tolist(), *corners_cm.mean(axis=1).T.tolist(), headings.tolist(), strict=True)
        return sorted(Tag(int(number), x, y, heading) for number, x, y, heading in rows)


def _parameters(camera: CameraModel, dictionary: str, windows_cm: Sequence[float]) -> cv2.aruco.DetectorParameters:
    """Return how a detector looks for tags: no smaller than can be read, no larger than robots, with these windows."""
    x_px, y_px = camera.width_px / 2, camera.height_px / 2
    ends_cm = camera.back_project(np.array([[x_px, y_px], [x_px + 1, y_px]]), epuck.HEIGHT_CM)
    px_per_cm = 1 / float(np.linalg.norm(ends_cm[1] - ends_cm[0]))
    windows_px = [max(3, round(window_cm * px_per_cm) // 2 * 2 + 1) for window_cm in windows_cm]
    longer_px = max(camera.width_px, camera.height_px)
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax = windows_px[0], windows_px[-1]
    parameters.adaptiveThreshWinSizeStep = max(1, windows_px[-1] - windows_px[0])
    parameters.minMarkerPerimeterRate = 4 * tag_modules(dictionary) * LEAST_MODULE_PX / longer_px
    parameters.maxMarkerPerimeterRate = 4 * LARGEST_TAG_CM * px_per_cm / longer_px
    return parameters


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
