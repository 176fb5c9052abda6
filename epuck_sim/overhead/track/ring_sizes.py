"""Measures rings of unknown size in pictures of an unknown camera: where, how large and how flat they look."""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple, Self

import cv2
import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray
from epuck_sim.overhead.camera_model import LOOKING_DOWN, CameraModel, simple_lens
from epuck_sim.overhead.film.frame import Frame, Picture
from epuck_sim.overhead.track.light import LEAST_LIGHT, Background, is_lit, ring_light, ring_light_of
from epuck_sim.overhead.track.ring_detection import RingFinder

MIN_RADIUS_PX = 5.0
"""Radius of the smallest ring that is searched; the hollow of smaller ones is lost."""

MAX_RADIUS = 0.2
"""Radius of the largest ring that is searched, as a fraction of the picture's shorter side."""

STEP = 1.18
"""Ratio of one radius that is searched to the next; a ring is found from 0.8 to 1.2 times a radius."""

APART_S = 0.2
"""Time between pictures that are examined, unless more light comes on: a flash is seen in one or two of them."""

SURVEYED = 6
"""Number of pictures with rings in which all sizes are searched; later only those that were found."""

ENOUGH_PICTURES = 30
"""Number of pictures with rings that are examined."""

ENOUGH_RINGS = 60
"""Number of rings that is enough to determine a camera."""

USUAL_SIZES = (0.5, 1.6)
"""Bounds of a ring's radius, relative to the median of all; others are not rings."""

USUAL_LIGHT = 0.3
"""Light of a ring, relative to that of bright ones, below which it is none."""

VIEW_HEIGHT_CM = 100.0
"""Height of the imagined camera in whose view rings are searched; only the scale that it gives matters."""


class SeenRings(NamedTuple):
    """How rings look in pictures."""

    places_px: FloatArray
    """(n, 2) column and row of their middles."""
    radius_px: FloatArray
    """(n,) mean radii."""
    flattening: FloatArray
    """(n, 2) cosine and sine amplitudes of the radius along twice the angle, relative to the radius."""
    light: float = 0.0
    """Median levels by which they are brighter than their inside."""

    @property
    def number(self) -> int:
        """Number of rings."""
        return len(self.radius_px)

    @classmethod
    def from_moments(cls, places_px: FloatArray, squares: FloatArray) -> Self:
        """Return rings from (n, 2, 2) second moments of their rims."""
        across, down, mixed = squares[:, 0, 0], squares[:, 1, 1], squares[:, 0, 1]
        total = across + down
        flattening = np.column_stack([(across - down) / 2, mixed]) / total[:, None]
        return cls(places_px, np.sqrt(total), flattening)


def search_camera(width_px: int, height_px: int, radius_px: float) -> CameraModel:
    """Return a camera that looks straight down and sees rings of this radius."""
    focal_px = radius_px / epuck.RING_RADIUS_CM * (VIEW_HEIGHT_CM - epuck.RING_HEIGHT_CM)
    lens = simple_lens(width_px, height_px, focal_px)
    return CameraModel(width_px, height_px, lens, LOOKING_DOWN, np.array([0.0, 0.0, VIEW_HEIGHT_CM]))


def measure_rings(frames: Iterable[Frame], background: Background, most_frames: int) -> SeenRings:
    """Measure rings in the dark frames of a film; reading ends when there are enough.

    Args:
        frames: Frames of the film in their order.
        background: Learns from them.
        most_frames: Number of frames after which reading ends, counted from the first one with a ring.
    """
    survey = _Survey()
    first: Picture | None = None
    last_s, last_lit_px, since = -math.inf, 0, 0
    for frame in frames:
        if first is None and not is_lit(frame.picture):
            first = frame.picture
            background.picture = first if background.picture is None else background.picture
        since += bool(survey.found)
        without = background.update(frame)
        if without is None:
            continue
        light = ring_light(np.asarray(cv2.subtract(frame.picture, without), np.uint8), False)
        lit_px = int(np.count_nonzero(light >= LEAST_LIGHT))
        if lit_px and (frame.time_s - last_s >= APART_S or lit_px > last_lit_px):
            last_s, last_lit_px = frame.time_s, lit_px
            survey.examine(frame.picture, without)
        if survey.is_enough or since >= most_frames:
            break
    if first is not None and not survey.found:  # what shone in the first picture never went off
        background.picture = None
        survey.examine(first, np.zeros_like(first))
    return _seen_rings(survey.found)


class _Survey:
    """Searches rings of all sizes in picture after picture, and later only of the sizes that were found."""

    def __init__(self) -> None:
        self.found: list[_SeenRing] = []
        self._finders: list[RingFinder] = []
        self._useful: list[int] = []
        self._pictures = 0

    @property
    def is_enough(self) -> bool:
        """Whether no more pictures are needed."""
        return len(self.found) >= ENOUGH_RINGS or self._pictures >= ENOUGH_PICTURES

    def examine(self, picture: Picture, background: Picture) -> None:
        """Search rings in a dark picture."""
        if not self._finders:
            self._finders = [RingFinder(camera) for camera in _search_cameras(*picture.shape[1::-1])]
            self._useful = [0] * len(self._finders)
        seen = []
        for index, finder in enumerate(self._finders):
            if self._pictures < SURVEYED or self._useful[index]:
                rings = _seen_by(finder, picture, background)
                self._useful[index] += len(rings)
                seen += rings
        self.found += _without_overlap(seen)
        self._pictures += bool(seen)


def _search_cameras(width_px: int, height_px: int) -> Iterator[CameraModel]:
    radius_px = MIN_RADIUS_PX
    while radius_px <= MAX_RADIUS * min(width_px, height_px):
        yield search_camera(width_px, height_px, radius_px)
        radius_px *= STEP


class _SeenRing(NamedTuple):
    x_px: float
    y_px: float
    radius_px: float
    flattening: tuple[float, float]
    misfit: float
    """Distance of the light's edge from the fitted shape, relative to the radius."""
    light: float
    """Levels above those of its inside."""


def _seen_by(finder: RingFinder, picture: Picture, background: Picture) -> list[_SeenRing]:
    """Return the rings that a finder with a search camera sees; rows of its view count upwards."""
    fits = finder.fits(ring_light_of(picture, background))
    if not fits:
        return []
    camera, view = finder.camera, finder.view
    px_per_cm = camera.lens.focal_px / (VIEW_HEIGHT_CM - epuck.RING_HEIGHT_CM)
    centres = np.array([(*view.position_cm(fit.column, fit.row), epuck.RING_HEIGHT_CM) for fit in fits])
    return [
        _SeenRing(
            float(x_px),
            float(y_px),
            fit.radius_cm * px_per_cm,
            (fit.flattening[0], -fit.flattening[1]),
            fit.misfit_cm / fit.radius_cm,
            fit.light,
        )
        for (x_px, y_px), fit in zip(camera.project(centres), fits, strict=True)
    ]


def _without_overlap(rings: list[_SeenRing]) -> list[_SeenRing]:
    """Return the rings that fit best where several were found at one place at different scales."""
    kept: list[_SeenRing] = []
    for ring in sorted(rings, key=lambda each: each.misfit):
        if all(math.dist(ring[:2], other[:2]) > max(ring.radius_px, other.radius_px) for other in kept):
            kept.append(ring)
    return kept


def _seen_rings(rings: list[_SeenRing]) -> SeenRings:
    """Return the rings that are bright and of about one size."""
    table = np.array([(*ring[:3], *ring.flattening, ring.light) for ring in rings]).reshape(-1, 6)
    if len(table):
        table = table[table[:, 5] >= USUAL_LIGHT * np.quantile(table[:, 5], 0.9)]
        relative = table[:, 2] / np.median(table[:, 2])
        table = table[(relative >= USUAL_SIZES[0]) & (relative <= USUAL_SIZES[1])]
    light = float(np.median(table[:, 5])) if len(table) else 0.0
    return SeenRings(table[:, :2], table[:, 2], table[:, 3:5], light)
