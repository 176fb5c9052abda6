"""The plane in which the rings shine, seen straight from above: pictures without perspective and distortion."""

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray
from epuck_sim.overhead.camera_model import Lens

Light = npt.NDArray[np.uint8]
"""One channel of a picture, or of the plane."""

COARSE_PER_CM = 2
"""Cells of the coarse grid in which rings are looked for: a ring is 14 of them wide, a robot never moves that far."""

FINEST = 3
"""Cells of the fine grid along one of the coarse: 6 a centimetre place a ring to a tenth of a millimetre."""

FARTHEST = 2.0
"""Points of the plane are looked at up to so many times the camera's height away from below it: a horizon is not."""

MOST = 4
"""Fine cells for each pixel, at most, unless the coarse grid has more: a picture taken askew shows much of the plane in
few pixels."""

STRAY_CM = 0.5
"""A point that a pixel shows must be seen in that pixel: beyond a strong distortion's fold it is not."""


class RingPlane(NamedTuple):
    """A grid of square cells on the plane of the rings, axes as the arena's; row 0 is the lowest."""

    origin_cm: FloatArray
    """(2,) of the middle of the cell in row 0, column 0."""
    cells_per_cm: int
    """A multiple of `COARSE_PER_CM`."""
    where: npt.NDArray[np.int16]
    """(rows, columns, 2) whole pixels of the picture, and ..."""
    fraction: npt.NDArray[np.uint16]
    """(rows, columns) ... fractions: OpenCV's fixed-point maps."""

    def seen(self, light: Light) -> Light:
        """Return (rows, columns): what one channel (height_px, width_px) of a picture shows of the plane."""
        return np.asarray(cv2.remap(light, self.where, self.fraction, cv2.INTER_LINEAR), np.uint8)

    def coarse(self, plane: Light) -> Light:
        """Return means over the coarse cells of what is seen, (rows, columns) over cells a coarse one."""
        cells = self.cells_per_cm // COARSE_PER_CM
        rows, columns = plane.shape
        return np.asarray(cv2.resize(plane, (columns // cells, rows // cells), interpolation=cv2.INTER_AREA), np.uint8)

    def closed(self, plane: Light, width_cm: float) -> Light:
        """Return what is seen without dark gaps and dots that are up to `width_cm` wide."""
        size = round(width_cm * self.cells_per_cm) // 2 * 2 + 1
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
        return np.asarray(cv2.morphologyEx(plane, cv2.MORPH_CLOSE, disc), np.uint8)

    def position_cm(self, column: float, row: float) -> tuple[float, float]:
        """Return the point of the arena in the middle of a cell."""
        return float(self.origin_cm[0] + column / self.cells_per_cm), float(self.origin_cm[1] + row / self.cells_per_cm)


def ring_plane(lens: Lens) -> RingPlane:
    """Return the plane `epuck.RING_HEIGHT_CM` above the floor as far as it is in the picture."""
    above_cm = lens.position_cm[2] - epuck.RING_HEIGHT_CM
    low, high = _extent_cm(lens, above_cm)
    densest = math.sqrt(MOST * lens.width_px * lens.height_px / np.prod(high - low))
    cells = min(max(round(min(lens.focal_px / above_cm, densest) / COARSE_PER_CM), 1), FINEST)
    columns, rows = np.ceil((high - low) * COARSE_PER_CM).astype(int) * cells
    per_cm = cells * COARSE_PER_CM
    x, y = np.meshgrid(low[0] + np.arange(columns) / per_cm, low[1] + np.arange(rows) / per_cm)
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, epuck.RING_HEIGHT_CM)])
    pixels = lens.pixels(points)
    strays = np.abs(lens.on_plane(pixels, epuck.RING_HEIGHT_CM) - points[:, :2]).max(axis=1) > STRAY_CM
    pixels[strays] = -10  # outside of the picture, where there is no light
    at_column, at_row = pixels.T.astype(np.float32).reshape(2, int(rows), int(columns))
    where, fraction = cv2.convertMaps(at_column, at_row, cv2.CV_16SC2)
    return RingPlane(low, per_cm, np.asarray(where, np.int16), np.asarray(fraction, np.uint16))


def _extent_cm(lens: Lens, above_cm: float) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest x and y of the plane that the picture shows."""
    edge = np.linspace(0, 1, 33)
    border = np.concatenate([np.column_stack([edge, np.full(33, end)]) for end in (0.0, 1.0)])
    border = np.concatenate([border, border[:, ::-1]]) * (lens.width_px - 1, lens.height_px - 1)
    below = lens.position_cm[:2]
    shown = lens.on_plane(border, epuck.RING_HEIGHT_CM)
    reach = FARTHEST * above_cm
    low, high = np.clip([shown.min(axis=0), shown.max(axis=0)], below - reach, below + reach)
    return low, high
