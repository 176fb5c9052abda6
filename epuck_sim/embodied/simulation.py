"""The embodied simulation: sense, control, act, move, one control step after the other (thesis 3.1.4.1).

Within a step all robots sense the same instant, then every controller runs, then rings and wheels take effect, then
bodies move. What a controller commands in one step is seen by the other robots in the next.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray, StreamArray
from epuck_sim.control.runner import RobotError
from epuck_sim.embodied.control_loop import CompiledLoop, interpreted_loop, make_control_loop
from epuck_sim.embodied.group import NOISE_STEPS, RobotGroupState, make_swarm_arrays, start_group
from epuck_sim.embodied.placement import place_robots
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.embodied.step import Step, shown_arrays
from epuck_sim.embodied.variation import RobotVariation, draw_variation
from epuck_sim.errors import ControllerError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import Scenario, require_model, seed_of_trial
from epuck_sim.util.seeds import robot_streams


class Simulation:
    """A swarm of e-pucks in its arena, an endless iterator over control steps.

    The first step shows the robots where they were placed; each further one first moves the bodies for one control
    interval (0.1 s by default). Then all robots sense that instant, and their controllers command rings and wheels.
    The simulation never ends by itself: `run_trial` decides when a trial is terminated (synchronised) or censored (its
    limit of cycles or of time is reached), and stops asking for steps.

    The outcome depends on the scenario and the seed alone, to the bit.

    >>> simulation = Simulation("thesis", seed=1)
    >>> step = next(iter(simulation))
    >>> step.poses.shape, step.camera.shape
    ((10, 3), (10, 60))
    """

    scenario: EmbodiedScenario
    seed: int
    step_s: float
    """Seconds from one control step to the next."""
    period_ms: FloatArray
    """(robots,) ms: the oscillators' periods; NaN for robots without an oscillator."""

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any],
        seed: int | None = None,
        *,
        interpret: bool = False,
    ) -> None:
        """Place the robots and start their controllers.

        Args:
            scenario: A scenario of model `embodied` without a sweep, or what `load_scenario` takes.
            seed: The trial's seed, 0 or more; the scenario's own if None.
            interpret: Run controllers as plain Python instead of compiled, with the same outcome.

        Raises:
            ScenarioError: The scenario or the seed is not allowed, or the robots do not fit into the arena.
            ControllerError: A controller cannot be compiled, or raises at its start.
        """
        self.scenario = scenario = require_model(
            load_scenario(scenario), EmbodiedScenario, "a Simulation needs model: embodied; use ParticleSimulation"
        )
        self.seed = seed_of_trial(scenario, seed)
        self.step_s = scenario.timing.step_ms / 1000
        self._step_ms = scenario.timing.step_ms
        for_placement, for_infrared, for_wheels, *for_robots = np.random.SeedSequence(self.seed).spawn(6)
        self._infrared_random = np.random.Generator(np.random.SFC64(for_infrared))
        self._wheel_random = np.random.Generator(np.random.SFC64(for_wheels))
        controller_streams, variation_streams, camera_streams = (
            robot_streams(sequence, scenario.robot_count) for sequence in for_robots
        )

        arena = scenario.arena.build()
        poses = place_robots(scenario, for_placement)
        self._world = World(arena, poses, scenario.contact.friction, scenario.timing.physics_hz)
        self._swarm = make_swarm_arrays(scenario, arena, self._world)
        variation = draw_variation(scenario.spread, variation_streams)
        self._step = np.full(1, -1)  # the number of the last step taken
        self._groups = self._start_groups(variation, controller_streams, camera_streams, interpret)
        self.period_ms = np.concatenate([np.full(len(group.runner.memory), group.period_ms) for group in self._groups])
        loop = make_control_loop(scenario, self._step, self._world.bodies, self._swarm, variation, variation_streams)
        start_loop = interpreted_loop if interpret else CompiledLoop
        self._take_steps = start_loop(loop, self._groups)
        self._step_arrays: tuple[Any, ...] = shown_arrays(self._swarm, [group.runner.memory for group in self._groups])
        self._short_rows = self._find_short_rows()

    def _start_groups(
        self,
        variation: RobotVariation,
        controller_streams: StreamArray,
        camera_streams: StreamArray,
        interpret: bool,
    ) -> list[RobotGroupState]:
        """Return all groups with their controllers started; a controller that raises is named with its robot."""
        groups: list[RobotGroupState] = []
        first_robot = 0
        for section in self.scenario.robots:
            try:
                group = start_group(
                    self.scenario,
                    section,
                    first_robot,
                    self._swarm,
                    infrared_gain=variation.infrared_gain,
                    controller_streams=controller_streams,
                    camera_streams=camera_streams,
                    interpret=interpret,
                )
            except RobotError as error:
                raise self._located(error, first_robot) from error
            groups.append(group)
            first_robot += section.count
        return groups

    def _find_short_rows(self) -> list[tuple[IntArray, IntArray]]:
        """Return, for each group with fewer pixels than others, the rows that are shown and those of its cameras."""
        shown, short_rows = self._swarm.sensors.camera, []
        for group in self._groups:
            camera = group.runner.arrays.senses.camera
            robots, pixels = camera.shape
            if pixels < shown.shape[1]:
                short_rows.append((shown[group.first_robot : group.first_robot + robots, :pixels], camera))
        return short_rows

    @property
    def steps(self) -> int:
        """Control steps taken so far."""
        return int(self._step[0]) + 1

    def __iter__(self) -> Self:
        """Return the simulation itself: a further loop continues where the last one stopped."""
        return self

    def __next__(self) -> Step:
        """Take one control step and return it.

        Bodies move, unless this is the first step; then all robots sense, and their controllers command.

        Returns:
            The step; its arrays are overwritten by the next one.

        Raises:
            ControllerError: A controller raises, or sets a wheel speed that is not a number.
        """
        return self.advance(1)

    def advance(self, steps: int, until_lit: int | None = None) -> Step:
        """Take several control steps, faster than one by one, and return the last of them.

        Args:
            steps: Number of steps to take, at least 1.
            until_lit: Number of a robot; a step in which its ring is lit is the last one.

        Returns:
            The last step; its arrays are overwritten by the next one.

        Raises:
            ValueError: There is no step to take, or no such robot.
            ControllerError: See `__next__`.
        """
        if steps < 1:
            raise ValueError(f"steps is {steps}; allowed: 1 and above")
        if until_lit is not None and not 0 <= until_lit < len(self.period_ms):
            raise ValueError(f"until_lit is {until_lit}; allowed: 0 to {len(self.period_ms) - 1}")
        end = self.steps + steps
        while True:
            noise_step = self.steps % NOISE_STEPS
            if noise_step == 0:
                self._draw_noise()
            self._run(min(end - self.steps, NOISE_STEPS - noise_step), -1 if until_lit is None else until_lit)
            if self.steps == end or (until_lit is not None and self._swarm.ring_on[until_lit]):
                return self._last_step()

    def _last_step(self) -> Step:
        """Return the step that was taken last."""
        for shown, camera in self._short_rows:
            shown[:] = camera
        number = int(self._step[0])
        return Step(number, number * self._step_ms / 1000, *self._step_arrays)

    def _run(self, steps: int, until_lit: int) -> None:
        """Take control steps for which noise is drawn; a robot whose controller fails is named."""
        try:
            invalid = self._take_steps(steps, until_lit)
        except (Exception, SystemExit) as error:  # whatever a user's controller may raise
            for group in self._groups:
                if fault := group.runner.fault(error):
                    raise self._located(fault, group.first_robot) from error
            raise
        if invalid >= 0:
            raise ControllerError(f"{self._location(invalid)}: its controller sets a wheel speed that is not a number")

    def _repr_html_(self) -> str:
        """Return the arena with the robots as they are now, for notebooks."""
        from epuck_sim.embodied.notebook import show_simulation  # noqa: PLC0415 is for notebooks alone

        return show_simulation(self.scenario, self.seed, self._last_step())

    def _draw_noise(self) -> None:
        """Draw the noise of the next `NOISE_STEPS` steps."""
        if self.scenario.noise.infrared_counts > 0:
            self._infrared_random.standard_normal(out=self._swarm.infrared_noise)
        if self.scenario.noise.wheel_speed > 0:
            self._wheel_random.random(out=self._swarm.wheel_noise)

    def _location(self, robot: int) -> str:
        """Return where a controller failed, for an error."""
        return f"{self.scenario.name}: robot {robot}, step {max(self.steps - 1, 0)}, seed {self.seed}"

    def _located(self, error: RobotError, first_robot: int) -> ControllerError:
        """Return the error of a controller of the group that begins with `first_robot`, with its location."""
        return ControllerError(f"{self._location(first_robot + error.robot)}: {error}")
