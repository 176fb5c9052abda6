"""The control loop with Python between its parts, against which the compiled one is measured.

Every robot takes every physics step, pymunk's own methods move the bodies, and each kernel is called from Python.
"""

from functools import partial
from typing import Any

import numpy as np
import pymunk.batch
from pymunk.batch import BodyFields

from epuck_sim.embodied.cell_list import sort_into_cells
from epuck_sim.embodied.differential_drive import apply_commands
from epuck_sim.embodied.sensing import sense
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.swarm_arrays import NOISE_STEPS
from epuck_sim.util.addresses import compile_at
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import kernel_digest

POSES = BodyFields.POSITION | BodyFields.ANGLE
VELOCITIES = BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY


def _sense_at(address: int, noise_step: int) -> None:
    sense(value_at(address), noise_step)  # noqa: F821 `compile_at` provides it


class PythonSteps:
    """A simulation of robots of one group, without spread and stoppages."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        world, group, swarm = simulation._world, simulation._groups[0], simulation._swarm
        self._space, self._poses = world._space, world.poses
        for (body, disc), (x, y, heading) in zip(world._discs, world.poses.tolist(), strict=True):
            body.position, body.angle = (x, y), heading
            self._space.add(body, disc)
        self._found = pymunk.batch.Buffer()
        pymunk.batch.get_space_bodies(self._space, POSES, self._found)
        commands = np.zeros_like(np.frombuffer(self._found.float_buf()).reshape(-1, 3))
        self._velocities = commands[: len(world.poses)]
        self._commands = pymunk.batch.Buffer()
        self._commands.set_float_buf(commands)
        self._owner, address = hold(group.sensing)
        sense_at: Any = compile_at(_sense_at, group.sensing, kernel_digest(), careful=False)
        self._sense = partial(sense_at, address)
        self._step_controllers = group.runner.step
        gain = np.ones((len(world.poses), 2))
        slip, step_s = simulation.scenario.noise.wheel_speed, simulation.step_s
        self._apply = partial(
            apply_commands,
            *(swarm.actuators, swarm.wheels_cm_s, swarm.ring_on, swarm.turns_rad, world.poses, gain, slip, step_s),
            *(self._velocities, swarm.wheel_noise),
        )
        self._steps = 0

    def advance(self, steps: int) -> None:
        """Take control steps."""
        bodies = self._simulation._world.bodies
        for _ in range(steps):
            noise_step = self._steps % NOISE_STEPS
            if self._steps > 0:
                pymunk.batch.set_space_bodies(self._space, VELOCITIES, self._commands)
                for _ in range(10):
                    self._space.step(bodies.step_s)
                self._found.clear()
                pymunk.batch.get_space_bodies(self._space, POSES, self._found)
                self._poses[:] = np.frombuffer(self._found.float_buf()).reshape(-1, 3)[: len(self._poses)]
                sort_into_cells(bodies.poses, bodies.cells)
            if noise_step == 0:
                self._simulation._randomness.draw_noise(self._simulation._swarm)
            self._sense(noise_step)
            self._step_controllers()
            self._apply(noise_step, self._simulation.scenario.robot.wheels)
            self._steps += 1
