"""ArUco tags on top of robots: their dictionaries and patterns, and where their corners are.

A tag lies flat on top of a robot, its middle above the robot's, the top of its pattern ahead.
"""

import math

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray


def tag_dictionary(name: str) -> cv2.aruco.Dictionary:
    """Return OpenCV's dictionary of a name such as 4X4_50."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))


def tag_count(name: str) -> int:
    """Return the number of tags in a dictionary.

    >>> tag_count("4X4_50")
    50
    """
    return len(tag_dictionary(name).bytesList)


def tag_modules(name: str) -> int:
    """Return the number of modules along the side of a tag with its black border.

    >>> tag_modules("4X4_50")
    6
    """
    return int(tag_dictionary(name).markerSize) + 2


def tag_pattern(name: str, number: int, module_px: int) -> npt.NDArray[np.uint8]:
    """Return the pattern of a tag, 0 or 255, with half a module of white around it; whole, even pixels a module."""
    side_px = tag_modules(name) * module_px
    pattern = cv2.aruco.generateImageMarker(tag_dictionary(name), number, side_px)
    return np.pad(pattern, module_px // 2, constant_values=255)


def tag_corners_cm(pose: FloatArray, side_cm: float, height_cm: float) -> FloatArray:
    """Return (4, 3) cm: corners of a square on a robot, from the one ahead on the left, clockwise from above.

    Args:
        pose: (3,) cm, cm, rad: x, y, heading of the robot.
        side_cm: Side of the square.
        height_cm: Height of the robot.
    """
    ahead = np.array([math.cos(pose[2]), math.sin(pose[2])])
    left = np.array([-ahead[1], ahead[0]])
    signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * side_cm / 2
    corners = pose[:2] + signs[:, :1] * ahead + signs[:, 1:] * left
    return np.column_stack([corners, np.full(4, height_cm)])
