"""What the overhead camera sees in one exposure: lit rings in the dark, or everything in the light (thesis 4.3.1)."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray
from epuck_sim.overhead.camera_model import Lens
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.render.bounding_boxes import find_patches
from epuck_sim.overhead.render.ring_light import COLOUR_LEVELS, NOMINAL_EXPOSURE_MS, add_rings, reach_cm
from epuck_sim.overhead.render.room import draw_bodies, far_first, render_room
from epuck_sim.scenario.overhead import OverheadSection

SPARE_NOISE = 2**20
"""The table of noise is longer than a picture by so many numbers: as many ways to read from it."""


class Instant(NamedTuple):
    """Where the robots are at a moment of an exposure."""

    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading."""
    ring_on: BoolArray
    """(robots,)"""


class Painter:
    """Paints pictures of one arena; of the same pictures in the same order with the same seed, all are the same."""

    def __init__(self, section: OverheadSection, lens: Lens, arena: Arena, seed: int) -> None:
        self._lens = lens
        self._light = section.exposure_ms / NOMINAL_EXPOSURE_MS
        self._bloom = section.bloom
        self._blur_px = section.blur_px
        self._floor_cm = lens.plane_map(0.0)
        self._dimming = dimming(lens.width_px, lens.height_px, section.vignetting)
        self._room = render_room(self._floor_cm, lens.position_cm, arena)
        self._random = np.random.default_rng(seed)
        self._noise = np.zeros(3 * lens.width_px * lens.height_px + SPARE_NOISE, np.int16)
        if section.noise_levels > 0:
            drawn = self._random.standard_normal(len(self._noise), np.float32)
            self._noise[:] = np.rint(section.noise_levels * drawn)

    def paint(self, instants: Sequence[Instant], *, is_lit_room: bool) -> Picture:
        """Return the picture to which all instants contribute the same share.

        A lit room is as bright in a long exposure as in a short one, as if its lamps were dimmed; rings are not.
        """
        if is_lit_room:
            light, grey = self._through_lens(self._rings(instants)), self._through_lens(self._scene(instants))
            return self._develop([grey + levels * light for levels in COLOUR_LEVELS])
        if any(instant.ring_on.any() for instant in instants):
            light = self._through_lens(self._rings(instants))
            return self._develop([levels * light for levels in COLOUR_LEVELS])
        return np.clip(self._next_noise(), 0, 255).astype(np.uint8)

    def _rings(self, instants: Sequence[Instant]) -> Float32Array:
        """Return (rows, columns) the light of all rings."""
        image = np.zeros(self._room.shape, np.float32)
        lit = np.concatenate([instant.poses[instant.ring_on] for instant in instants])
        reach = reach_cm(self._light, self._bloom)
        patches = find_patches(self._lens, lit[:, :2], epuck.RING_RADIUS_CM + reach, (epuck.RING_HEIGHT_CM,))
        light = self._light / len(instants)
        add_rings(image, self._floor_cm, self._lens.position_cm, lit, patches, light, self._bloom, reach)
        return image

    def _scene(self, instants: Sequence[Instant]) -> Float32Array:
        """Return (rows, columns) the levels of the room with robots in it."""
        lens = self._lens
        scene = np.zeros(self._room.shape, np.float32)
        for instant in instants:
            image = self._room.copy()
            poses = far_first(instant.poses, lens.position_cm)
            patches = find_patches(lens, poses[:, :2], epuck.RADIUS_CM, (0.0, epuck.HEIGHT_CM))
            draw_bodies(image, self._floor_cm, lens.position_cm, poses, patches)
            scene += image
        scene /= len(instants)
        return scene

    def _through_lens(self, image: Float32Array) -> Float32Array:
        """Return (rows, columns) what is left of an image behind the lens."""
        if self._blur_px > 0:
            blurred = cv2.GaussianBlur(image, (0, 0), self._blur_px, borderType=cv2.BORDER_REPLICATE)
            image = np.asarray(blurred, np.float32)
        return self._dimming * image

    def _develop(self, colours: list[Float32Array]) -> Picture:
        """Return the picture of (rows, columns) levels of red, green and blue."""
        noisy = cv2.add(cv2.merge(colours), self._next_noise(), dtype=cv2.CV_8U)  # rounds, and keeps to 0 to 255
        return np.asarray(noisy, np.uint8)

    def _next_noise(self) -> npt.NDArray[np.int16]:
        """Return (rows, columns, 3) levels, read from a place of the table that is drawn for each picture.

        To draw every number anew would take longer than all the rest.
        """
        rows, columns = self._room.shape
        first = self._random.integers(SPARE_NOISE)
        return self._noise[first : first + rows * columns * 3].reshape(rows, columns, 3)


def dimming(width_px: int, height_px: int, vignetting: float) -> Float32Array:
    """Return (height_px, width_px) the share of the light that a lens lets through: 1 - `vignetting` in the corners."""
    across = np.linspace(-1, 1, width_px) * width_px
    down = np.linspace(-1, 1, height_px) * height_px
    square = (across**2 + down[:, None] ** 2) / (width_px**2 + height_px**2)
    return (1 - vignetting * square).astype(np.float32)
