"""Reads ArUco tags on top of robots in a film, in the light or by infrared light.

A tag lies flat on top of a robot, its middle above the robot's, the top of its pattern ahead.
"""

from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.overhead.camera import CameraModel, Frame

BRIGHT = 200.0  # level to which the paper of tags is brightened: OpenCV's thresholds are meant for well lit pictures
MAX_GAIN = 10.0  # largest factor by which pictures are brightened: more would show noise alone
PAPER_SHARE = 0.98  # share of the pixels that are darker than the paper of tags
SAMPLED_PX = 4  # distance of the pixels whose brightness is sampled
WINDOWS_CM = (1.9, 3.4)
"""Sides of the squares around a pixel whose mean decides whether it is black or white. In dim light, the first alone
finds 99.8 % of the 4 cm tags that both find, in half the time."""
LEAST_MODULE_PX = 1.5  # least side of the modules of a tag that is read
LARGEST_TAG_CM = 4 * epuck.RADIUS_CM  # largest side of a square that may be a tag, with a margin for tilted cameras


def tag_dictionary(name: str) -> cv2.aruco.Dictionary:
    """Return OpenCV's dictionary of a name such as 4X4_50."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))


def tag_modules(name: str) -> int:
    """Return the number of modules along the side of a tag with its black border."""
    return int(tag_dictionary(name).markerSize) + 2


class Readings(NamedTuple):
    """The tags that were read in a film, as columns in order of time and number."""

    time_s: FloatArray
    number: IntArray
    poses: FloatArray
    """(readings, 3) cm, cm, rad: x and y of the middle, and direction of the pattern's top, from -pi to pi."""

    def of(self, keep: BoolArray) -> "Readings":
        """Return the readings for which `keep` is true."""
        return Readings(self.time_s[keep], self.number[keep], self.poses[keep])


class TagReader:
    """Reads tags in the pictures of one camera, and keeps the readings."""

    def __init__(self, camera: CameraModel, dictionary: str) -> None:
        self._camera = camera
        x_px, y_px, longer_px = camera.width_px / 2, camera.height_px / 2, max(camera.width_px, camera.height_px)
        ends_cm = camera.back_project(np.array([[x_px, y_px], [x_px + 1, y_px]]), epuck.HEIGHT_CM)
        px_per_cm = 1 / float(np.linalg.norm(ends_cm[1] - ends_cm[0]))
        first_px, last_px = (max(3, round(window_cm * px_per_cm) // 2 * 2 + 1) for window_cm in WINDOWS_CM)
        parameters = cv2.aruco.DetectorParameters()
        parameters.adaptiveThreshWinSizeStep = max(1, last_px - first_px)
        parameters.minMarkerPerimeterRate = 4 * tag_modules(dictionary) * LEAST_MODULE_PX / longer_px
        parameters.maxMarkerPerimeterRate = 4 * LARGEST_TAG_CM * px_per_cm / longer_px
        parameters.adaptiveThreshWinSizeMin = parameters.adaptiveThreshWinSizeMax = first_px
        self._quick = cv2.aruco.ArucoDetector(tag_dictionary(dictionary), parameters)
        parameters.adaptiveThreshWinSizeMax = last_px
        self._thorough = cv2.aruco.ArucoDetector(tag_dictionary(dictionary), parameters)
        self._most = 0  # largest number of tags in a picture so far
        self._rows: list[tuple[float, ...]] = []

    def readings(self, start_s: float) -> Readings:
        """Return all tags that were read from a time on."""
        rows = np.array(self._rows).reshape(-1, 5)
        rows = rows[rows[:, 0] >= start_s]
        return Readings(rows[:, 0], rows[:, 1].astype(np.int64), rows[:, 2:])

    def read(self, frame: Frame) -> None:
        """Read and keep the tags in the next frame."""
        red, green, blue = frame.colours  # in their minimum, lit rings are dim
        least = np.asarray(cv2.min(cv2.min(red, green), blue), np.uint8)
        paper = float(np.quantile(least[::SAMPLED_PX, ::SAMPLED_PX], PAPER_SHARE))
        bright = cv2.convertScaleAbs(least, alpha=min(max(BRIGHT / max(paper, 1.0), 1.0), MAX_GAIN))
        corners, numbers, _ = self._quick.detectMarkers(bright)
        if len(corners) < self._most:  # some are gone, or hard to see
            corners, numbers, _ = self._thorough.detectMarkers(bright)
        self._most = max(self._most, len(corners))
        if not len(corners):
            return
        pixels = np.reshape(corners, (-1, 2)).astype(float)
        corners_cm = self._camera.back_project(pixels, epuck.HEIGHT_CM).reshape(-1, 4, 2)
        ahead = corners_cm[:, :2].mean(axis=1) - corners_cm[:, 2:].mean(axis=1)
        tags = np.column_stack([np.ravel(numbers), corners_cm.mean(axis=1), np.arctan2(ahead[:, 1], ahead[:, 0])])
        self._rows += [(frame.time_s, *tag) for tag in sorted(tags.tolist())]
