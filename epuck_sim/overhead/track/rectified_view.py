"""The horizontal plane of the rings seen straight from above, without perspective and distortion (bird's-eye view).

A matched filter on a coarse grid finds where rings may be.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import Float32Array, FloatArray
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.track.light import Light

COARSE_PER_CM = 2
"""Cells per cm of the coarse grid in which rings are searched; a ring is 14 cells wide."""

MAX_CANDIDATES = 200
"""Largest number of candidates that are examined in a picture, the brightest ones."""

FILTER_WIDTH_CM = 0.45
"""Standard deviation of the matched filter across the ring, which is about 1 cm thick when overexposed."""

DARK_RADIUS_CM = 2.3
"""Radius of the dark inside of a ring in the matched filter."""

MAX_FINE_CELLS = 3
"""Largest number of fine cells along a coarse one: 6 cells per cm locate a ring to a tenth of a millimetre."""

MAX_REACH_HEIGHTS = 2.0
"""Reach of the view from the point below the camera, in camera heights; without it a visible horizon has no end."""

MAX_CELLS_PER_PIXEL = 4
"""Largest number of fine cells per pixel, unless the coarse grid has more; an oblique picture shows much of the plane
in few pixels."""

STRAY_CM = 0.5
"""Largest error of projecting a point and back; beyond the fold of a strong distortion it is larger."""


def _ring_filter() -> Float32Array:
    """Return the matched filter on the coarse grid: mean light on the circle minus mean light inside."""
    half = round((epuck.RING_RADIUS_CM + 2 * FILTER_WIDTH_CM) * COARSE_PER_CM)
    offsets = np.arange(-half, half + 1) / COARSE_PER_CM
    radius = np.hypot(offsets[:, None], offsets)
    ring = np.exp(-(((radius - epuck.RING_RADIUS_CM) / FILTER_WIDTH_CM) ** 2) / 2)
    inner = (radius <= DARK_RADIUS_CM).astype(float)
    return np.asarray(ring / ring.sum() - inner / inner.sum(), np.float32)


_RING_FILTER = _ring_filter()


class RectifiedView(NamedTuple):
    """A grid of square cells on the plane of the rings, with the arena's axes; row 0 is the lowest."""

    origin_cm: FloatArray
    """(2,) middle of the cell in row 0, column 0."""
    cells_per_cm: int
    """Resolution; a multiple of `COARSE_PER_CM`."""
    pixels: npt.NDArray[np.int16]
    """(rows, columns, 2) whole pixels of OpenCV's fixed-point map from cells to the picture."""
    fractions: npt.NDArray[np.uint16]
    """(rows, columns) fractions of a pixel of that map."""

    def sample(self, light: Light) -> Light:
        """Return (rows, columns) the view of one channel of a picture, (height_px, width_px)."""
        return np.asarray(cv2.remap(light, self.pixels, self.fractions, cv2.INTER_LINEAR), np.uint8)

    def match(self, view: Light) -> Float32Array:
        """Return how much a ring seems to be around each cell of the coarse grid: light on it less light inside."""
        cells = self.cells_per_cm // COARSE_PER_CM
        rows, columns = view.shape
        coarse = cv2.resize(view, (columns // cells, rows // cells), interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.filter2D(coarse, cv2.CV_32F, _RING_FILTER), np.float32)

    def candidates(self, response: Float32Array, least: float) -> FloatArray:
        """Return (n, 2) columns and rows of cells whose response is highest within 1 cm, in descending order."""
        size = 2 * COARSE_PER_CM + 1
        highest = np.asarray(cv2.dilate(response, np.ones((size, size), np.uint8)))
        rows, columns = np.nonzero((response >= highest) & (response >= least))
        order = np.argsort(-response[rows, columns], kind="stable")[:MAX_CANDIDATES]
        cells = self.cells_per_cm // COARSE_PER_CM
        return np.asarray(np.column_stack([columns[order], rows[order]]) * cells + (cells - 1) / 2, np.float64)

    def close_gaps(self, view: Light, width_cm: float) -> Light:
        """Return a view in which dark gaps and dots up to `width_cm` wide are filled (morphological closing)."""
        size = round(width_cm * self.cells_per_cm) // 2 * 2 + 1
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
        return np.asarray(cv2.morphologyEx(view, cv2.MORPH_CLOSE, disc), np.uint8)

    def position_cm(self, column: float, row: float) -> tuple[float, float]:
        """Return x and y of the middle of a cell in the arena's frame."""
        return float(self.origin_cm[0] + column / self.cells_per_cm), float(self.origin_cm[1] + row / self.cells_per_cm)


def rectified_view(camera: CameraModel) -> RectifiedView:
    """Return the view of the plane `epuck.RING_HEIGHT_CM` above the floor, as far as the camera sees it."""
    above_cm = camera.position_cm[2] - epuck.RING_HEIGHT_CM
    low, high = _extent_cm(camera, above_cm)
    densest = math.sqrt(MAX_CELLS_PER_PIXEL * camera.width_px * camera.height_px / np.prod(high - low))
    cells = min(max(round(min(camera.lens.focal_px / above_cm, densest) / COARSE_PER_CM), 1), MAX_FINE_CELLS)
    columns, rows = np.ceil((high - low) * COARSE_PER_CM).astype(int) * cells
    per_cm = cells * COARSE_PER_CM
    x, y = np.meshgrid(low[0] + np.arange(columns) / per_cm, low[1] + np.arange(rows) / per_cm)
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, epuck.RING_HEIGHT_CM)])
    pixels = camera.project(points)
    strays = np.abs(camera.back_project(pixels, epuck.RING_HEIGHT_CM) - points[:, :2]).max(axis=1) > STRAY_CM
    pixels[strays] = -10  # outside of the picture, where there is no light
    at_column, at_row = pixels.T.astype(np.float32).reshape(2, int(rows), int(columns))
    whole, fractions = cv2.convertMaps(at_column, at_row, cv2.CV_16SC2)
    return RectifiedView(low, per_cm, np.asarray(whole, np.int16), np.asarray(fractions, np.uint16))


def _extent_cm(camera: CameraModel, above_cm: float) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest x and y of the plane that the picture shows."""
    edge = np.linspace(0, 1, 33)
    border = np.concatenate([np.column_stack([edge, np.full(33, end)]) for end in (0.0, 1.0)])
    border = np.concatenate([border, border[:, ::-1]]) * (camera.width_px - 1, camera.height_px - 1)
    below = camera.position_cm[:2]
    shown = camera.back_project(border, epuck.RING_HEIGHT_CM)
    reach = MAX_REACH_HEIGHTS * above_cm
    low, high = np.clip([shown.min(axis=0), shown.max(axis=0)], below - reach, below + reach)
    return low, high
