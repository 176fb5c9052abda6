"""What real films have and good ones do not: rings seen as eight points, and mirror images in the walls."""

import math

import cv2
import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.render.ring_light import WIDTH_CM

LEDS = 8
"""Number of LEDs on the ring of an e-puck."""

_ANGLES = np.arange(LEDS) * math.tau / LEDS


def mirror_images(poses: FloatArray, arena: Arena) -> FloatArray:
    """Return (4 n, 3) cm, cm, rad: the mirror images in the four walls of robots at (n, 3) poses."""
    x, y, heading = poses.T
    return np.concatenate([
        np.column_stack([-x, y, math.pi - heading]),
        np.column_stack([2 * arena.width_cm - x, y, math.pi - heading]),
        np.column_stack([x, -y, -heading]),
        np.column_stack([x, 2 * arena.height_cm - y, -heading]),
    ])  # fmt: skip


def add_points(
    image: Float32Array, camera: CameraModel, poses: FloatArray, light: float, ring_cm: tuple[float, float]
) -> None:
    """Add to an image the LEDs of robots at (n, 3) poses as points of light, as wide as a ring is thick.

    Args:
        image: (rows, columns) light, changed in place.
        camera: The camera that sees them.
        poses: (n, 3) cm, cm, rad: x, y, heading.
        light: Light of an LED.
        ring_cm: Radius and height of the ring of LEDs.
    """
    if not len(poses):
        return
    radius_cm, height_cm = ring_cm
    angles = poses[:, 2:] + _ANGLES
    x = poses[:, :1] + radius_cm * np.cos(angles)
    y = poses[:, 1:2] + radius_cm * np.sin(angles)
    pixels = camera.project(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height_cm)]))
    width_px = WIDTH_CM * camera.lens.focal_px / (camera.position_cm[2] - height_cm)
    points = np.zeros_like(image)
    rows, columns = image.shape
    whole = np.floor(pixels).astype(int)
    part = pixels - whole
    for right, below in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = whole[:, 0] + right, whole[:, 1] + below
        share = np.abs(1 - right - part[:, 0]) * np.abs(1 - below - part[:, 1])
        is_in = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
        np.add.at(points, (row[is_in], column[is_in]), share[is_in])
    image += light * math.tau * width_px**2 * cv2.GaussianBlur(points, (0, 0), width_px)
