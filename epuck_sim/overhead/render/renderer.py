"""Renders one exposure of the overhead camera: lit rings in the dark, or everything in a lit room (thesis 4.3.1)."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.render.bounding_boxes import bounding_boxes
from epuck_sim.overhead.render.imperfections import add_points, mirror_images
from epuck_sim.overhead.render.ring_light import COLOUR_LEVELS, NOMINAL_EXPOSURE_MS, add_rings, reach_cm
from epuck_sim.overhead.render.room import draw_bodies, draw_circle, farthest_first, render_room
from epuck_sim.overhead.render.tags import draw_tags
from epuck_sim.scenario.overhead import OverheadSection
from epuck_sim.scenario.robot_kind import EPUCK, RobotKind

NOISE_OFFSETS = 2**20
"""Number of different places in the noise table at which the noise of a picture may begin."""


class ExposureSample(NamedTuple):
    """The robots at one moment of an exposure."""

    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading."""
    ring_on: BoolArray
    """(robots,) which rings are on."""
    movables: FloatArray = np.empty((0, 2))
    """(movables, 2) cm: where the arena's movables are."""
    arena: Arena | None = None
    """Walls and obstacles; by default those that the renderer was made with."""


class Renderer:
    """Renders pictures of one arena; the same pictures in the same order with the same seed are equal."""

    def __init__(
        self, section: OverheadSection, camera: CameraModel, arena: Arena, seed: int, robot: RobotKind = EPUCK
    ) -> None:
        """Prepare what all pictures share.

        Args:
            section: The section `overhead` of a scenario: light and optics.
            camera: Geometry of the camera.
            arena: The arena below it.
            seed: Seed of the noise.
            robot: What kind of robots are in it.
        """
        self._camera = camera
        self._body_cm = float(robot.radius_cm), float(robot.height_cm)
        self._ring_cm = float(robot.ring_radius_cm), float(robot.ring_height_cm)
        self._light = section.gain * section.exposure_ms / NOMINAL_EXPOSURE_MS
        self._led_points = section.led_points
        self._gloss = section.gloss
        self._ambient = section.ambient
        self._bloom = section.bloom
        self._tags = section.tags
        self._tag_cm = float(section.tag_cm)
        self._blur_px = section.blur_px
        self._floor_cm = camera.plane_map(0.0)
        self._dimming = dimming(camera.width_px, camera.height_px, section.vignetting)
        self._movable_cm = arena.circles[arena.first_movable :, 2]
        self._room = render_room(self._floor_cm, camera.position_cm, arena)
        self._arena = self._first_arena = arena
        self._random = np.random.default_rng(seed)
        self._noise = np.zeros(3 * camera.width_px * camera.height_px + NOISE_OFFSETS, np.int16)
        if section.noise_levels > 0:
            drawn = self._random.standard_normal(len(self._noise), np.float32)
            self._noise[:] = np.rint(section.noise_levels * drawn)

    def render(self, samples: Sequence[ExposureSample], *, room_is_lit: bool) -> Picture:
        """Return the picture of one exposure, to which all samples contribute equally.

        A lit room is as bright in a long exposure as in a short one, as if its lamps were dimmed; rings are not.
        """
        if room_is_lit:
            light, grey = self._through_lens(self._rings(samples)), self._through_lens(self._scene(samples))
            return self._develop([grey + levels * light for levels in COLOUR_LEVELS])
        if self._ambient or any(sample.ring_on.any() for sample in samples):
            light = self._through_lens(self._rings(samples))
            channels = [levels * light for levels in COLOUR_LEVELS]
            if self._ambient:
                grey = np.float32(self._ambient) * self._through_lens(self._scene(samples))
                channels = [grey + channel for channel in channels]
            return self._develop(channels)
        return np.clip(self._next_noise(), 0, 255).astype(np.uint8)

    def _rings(self, samples: Sequence[ExposureSample]) -> Float32Array:
        """Return (rows, columns) the light of all rings."""
        image = np.zeros(self._room.shape, np.float32)
        lit = _in_arena(np.concatenate([sample.poses[sample.ring_on] for sample in samples]))
        light = self._light / len(samples)
        self._add_rings(image, lit, light)
        if self._gloss:
            self._add_rings(image, mirror_images(lit, samples[0].arena or self._first_arena), self._gloss * light)
        return image

    def _add_rings(self, image: Float32Array, poses: FloatArray, light: float) -> None:
        """Add the light of rings at (n, 3) poses to an image, in place."""
        if self._led_points:
            add_points(image, self._camera, poses, light, self._ring_cm)
            return
        reach = reach_cm(self._light, self._bloom)
        radius_cm, height_cm = self._ring_cm
        boxes = bounding_boxes(self._camera, poses[:, :2], radius_cm + reach, (height_cm,))
        eye_cm = self._camera.position_cm
        add_rings(image, self._floor_cm, eye_cm, poses, boxes, light, self._bloom, reach, self._ring_cm)

    def _scene(self, samples: Sequence[ExposureSample]) -> Float32Array:
        """Return (rows, columns) the levels of the lit room with the robots in it."""
        camera = self._camera
        scene = np.zeros(self._room.shape, np.float32)
        for sample in samples:
            self._enter_room(sample.arena or self._first_arena)
            image = self._room.copy()
            for place, radius in zip(sample.movables, self._movable_cm, strict=True):
                draw_circle(image, self._floor_cm, place, radius)
            poses = farthest_first(_in_arena(sample.poses), camera.position_cm)
            radius_cm, height_cm = self._body_cm
            boxes = bounding_boxes(camera, poses[:, :2], radius_cm, (0.0, height_cm))
            draw_bodies(image, self._floor_cm, camera.position_cm, poses, boxes, self._body_cm)
            if self._tags is not None:
                draw_tags(image, camera, sample.poses, self._tags, self._tag_cm, height_cm)
            scene += image
        scene /= len(samples)
        return scene

    def _enter_room(self, arena: Arena) -> None:
        """Have the room be the one around an arena."""
        if arena is not self._arena:
            self._arena, self._room = arena, render_room(self._floor_cm, self._camera.position_cm, arena)

    def _through_lens(self, image: Float32Array) -> Float32Array:
        """Return (rows, columns) an image blurred and dimmed by the lens."""
        if self._blur_px > 0:
            blurred = cv2.GaussianBlur(image, (0, 0), self._blur_px, borderType=cv2.BORDER_REPLICATE)
            image = np.asarray(blurred, np.float32)
        return self._dimming * image

    def _develop(self, channels: list[Float32Array]) -> Picture:
        """Return the noisy picture from (rows, columns) levels of red, green and blue."""
        noisy = cv2.add(cv2.merge(channels), self._next_noise(), dtype=cv2.CV_8U)  # rounds, and clips to 0..255
        return np.asarray(noisy, np.uint8)

    def _next_noise(self) -> npt.NDArray[np.int16]:
        """Return (rows, columns, 3) levels: the noise table from a random place on.

        Drawing new numbers for each picture would take longer than all the rest.
        """
        rows, columns = self._room.shape
        first = self._random.integers(NOISE_OFFSETS)
        return self._noise[first : first + rows * columns * 3].reshape(rows, columns, 3)


def _in_arena(poses: FloatArray) -> FloatArray:
    """Return those of (n, 3) poses that are not NaN."""
    return poses[~np.isnan(poses[:, 0])]


def dimming(width_px: int, height_px: int, vignetting: float) -> Float32Array:
    """Return (height_px, width_px) the fraction of light that the lens passes: 1 - `vignetting` in the corners."""
    across = np.linspace(-1, 1, width_px) * width_px
    down = np.linspace(-1, 1, height_px) * height_px
    square = (across**2 + down[:, None] ** 2) / (width_px**2 + height_px**2)
    return (1 - vignetting * square).astype(np.float32)
