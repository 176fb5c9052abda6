"""The camera that took a film, where the floor is in its pictures, and how well both are known."""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.film.frame import Picture

OUTLINE_POINTS = 16
"""Number of points on each side of the floor's outline; distortion bows it."""


class Geometry(NamedTuple):
    """The camera that took a film."""

    camera: CameraModel
    floor_cm: tuple[float, float]
    """Width and height, along y, of the floor."""
    calibration: str
    """What the camera was determined from."""
    knows_floor: bool
    """Whether the floor's place in the picture is known, so that rings outside of it are left out."""
    error_cm: float = 0.0
    """Standard error of positions, as far as the film tells; 0 if it does not."""
    tilt_deg: float = 0.0
    """Angle between the camera's axis and straight down."""
    background: Picture | None = None
    """Constant light: picture of the dark scene without rings."""
    ring_light: float = 0.0
    """Levels by which rings in the dark are usually brighter than their inside; 0 if it is not known."""

    def is_on_floor(self, x_cm: float, y_cm: float) -> bool:
        """Return whether a ring may be a robot's: a robot at a wall is its radius inside, its image as far outside."""
        width_cm, height_cm = self.floor_cm
        return not self.knows_floor or (0 <= x_cm <= width_cm and 0 <= y_cm <= height_cm)

    def floor_outline_px(self) -> FloatArray:
        """Return (n, 2) px: the outline of the floor, in order."""
        share = np.arange(OUTLINE_POINTS) / OUTLINE_POINTS
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * self.floor_cm
        sides = [
            start + share[:, None] * (end - start) for start, end in zip(corners, np.roll(corners, -1, 0), strict=True)
        ]
        outline = np.vstack(sides)
        return self.camera.project(np.column_stack([outline, np.zeros(len(outline))]))
