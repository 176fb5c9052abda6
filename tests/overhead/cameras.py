"""An arena with a camera above it, and what tests ask of its pictures."""

from typing import Any

import numpy as np

from epuck_sim import epuck
from epuck_sim.arena import Arena, make_arena
from epuck_sim.arrays import FloatArray
from epuck_sim.geometry import box_corners
from epuck_sim.overhead.camera import CameraModel, Picture, overhead_camera
from epuck_sim.overhead.render import ExposureSample, Renderer
from epuck_sim.scenario.overhead import OverheadSection

CLEAN = {"noise_levels": 0, "vignetting": 0, "bloom": 0, "blur_px": 0}
"""Settings of a camera that is a pinhole with a radial distortion, and no more."""

ARENA = make_arena(60, 60, [(45, 45, 4)], [box_corners(15, 45, 8, 5, 0.4)])


def make_renderer(arena: Arena = ARENA, seed: int = 0, **settings: Any) -> tuple[CameraModel, Renderer]:
    """Place a camera with these settings above an arena."""
    section = OverheadSection(**settings)
    camera = overhead_camera(section, arena.width_cm, arena.height_cm)
    return camera, Renderer(section, camera, arena, seed)


def standing(*poses: tuple[float, float, float], lit: bool = True) -> list[ExposureSample]:
    """Return the one instant of an exposure in which robots stand still, with all rings on or off."""
    return [ExposureSample(np.array(poses, float).reshape(-1, 3), np.full(len(poses), lit))]


def shot(
    *poses: tuple[float, float, float], arena: Arena = ARENA, room: bool = False, lit: bool = True, **settings: Any
) -> tuple[CameraModel, Picture]:
    """Return a camera without faults but those given, and its picture of robots, in the dark or in a lit room."""
    camera, renderer = make_renderer(arena, **CLEAN | settings)
    return camera, renderer.render(standing(*poses, lit=lit), room_is_lit=room)


def pixel_at(camera: CameraModel, x_cm: float, y_cm: float, z_cm: float = 0.0) -> tuple[int, int]:
    """Return row and column of the pixel that shows a point."""
    column, row = np.rint(camera.project(np.array([[x_cm, y_cm, z_cm]]))[0]).astype(int)
    return int(row), int(column)


def ring_centroid(picture: Picture, camera: CameraModel) -> FloatArray:
    """Return (2,) cm: the middle of what is red in a picture, as if it lay at the height of the rings."""
    rows, columns = np.nonzero(picture[..., 0])
    red = picture[rows, columns, 0].astype(float)
    places = camera.back_project(np.column_stack([columns, rows]).astype(float), epuck.RING_HEIGHT_CM)
    centroid: FloatArray = red @ places / red.sum()
    return centroid
