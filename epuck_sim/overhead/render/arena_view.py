"""The arena from above as a picture for people: what the overhead camera sees in a lit room, without its faults."""

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.overhead.camera_model import overhead_camera
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.render.renderer import ExposureSample, Renderer
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario

PERFECT = {"blur_px": 0.0, "vignetting": 0.0, "distortion": 0.0, "noise_levels": 0.0, "light": "lit"}
"""Values of the section `overhead` of a camera without faults in a lit room."""


class ArenaView:
    """Draws the robots of one scenario in their arena.

    >>> from epuck_sim import ArenaView, Simulation
    >>> simulation = Simulation("thesis", seed=1)
    >>> view = ArenaView(simulation.scenario, width_px=240, height_px=240)
    >>> step = next(simulation)
    >>> view.draw(step.poses, step.ring_on).shape
    (240, 240, 3)
    """

    def __init__(self, scenario: EmbodiedScenario, width_px: int | None = None, height_px: int | None = None) -> None:
        """Place the camera.

        Args:
            scenario: The scenario, with its arena and the section `overhead`: where the camera hangs.
            width_px: Width of pictures, an even number; the scenario's by default.
            height_px: Height of pictures, an even number; the scenario's by default.

        Raises:
            ScenarioError: The size is not allowed.
            EpuckSimError: The camera would hang between the walls.
        """
        sides = {"width_px": width_px, "height_px": height_px}
        changes = {**PERFECT, **{name: side for name, side in sides.items() if side is not None}}
        section = load_scenario(scenario, [f"overhead.{key}={value}" for key, value in changes.items()]).overhead
        camera = overhead_camera(section, scenario.arena.width_cm, scenario.arena.height_cm)
        arena = scenario.arena.build()
        self._movables = arena.circles[arena.first_movable :, :2]
        self._renderer = Renderer(section, camera, arena, seed=0)

    def draw(
        self,
        poses: FloatArray,
        ring_on: BoolArray,
        movables: FloatArray | None = None,
        arena: Arena | None = None,
    ) -> Picture:
        """Return (height, width, 3) the picture of robots in red, green and blue from 0 to 255.

        Args:
            poses: (robots, 3) cm, cm, rad: x, y, heading.
            ring_on: (robots,) whether each ring is lit.
            movables: (movables, 2) cm: where the arena's movables are, as steps have it; by default where they begin.
            arena: Walls and obstacles, as steps have it; by default those of the start.
        """
        places = self._movables if movables is None else np.asarray(movables)
        sample = ExposureSample(np.asarray(poses), np.asarray(ring_on), places, arena)
        return self._renderer.render([sample], room_is_lit=True)
