"""The embodied simulation: sense, control, act, move, one control step after the other (thesis 3.1.4.1).

Within a step all robots sense the same instant, then every controller runs, then rings and wheels take effect, then
bodies move. What a controller commands in one step is seen by the other robots in the next.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray, StreamArray
from epuck_sim.control.runner import RobotError, SensorArrays
from epuck_sim.embodied.control_loop import (
    CompiledLoop,
    ControlLoop,
    Drive,
    GroupSensing,
    interpreted_loop,
)
from epuck_sim.embodied.group import NOISE_STEPS, RobotGroupState, make_swarm_arrays, start_group
from epuck_sim.embodied.placement import place_robots
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.embodied.step import Step
from epuck_sim.embodied.variation import RobotClocks, RobotVariation, begin_stoppages, draw_variation
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
        loop = self._control_loop(variation, variation_streams)
        make_loop = interpreted_loop if interpret else CompiledLoop
        groups = [GroupSensing(self._step, group.sensing, group.camera_clock) for group in self._groups]
        self._take_steps = make_loop(loop, groups, [group.runner for group in self._groups])
        self._step_arrays: tuple[Any, ...] = self._show(self._swarm.sensors)[2:]

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

    def _control_loop(self, variation: RobotVariation, variation_streams: StreamArray) -> ControlLoop:
        """Return the arrays that change in each control step."""
        swarm, clock_rate = self._swarm, variation.clock_rate
        rates = clock_rate if self.scenario.spread.clock_rate > 0 else clock_rate[:0]
        return ControlLoop(
            step=self._step,
            physics_steps=self.scenario.timing.physics_hz // self.scenario.timing.control_hz,
            bodies=self._world.bodies,
            calls=np.zeros((2 * len(self._groups), 2), np.int64),
            clocks=RobotClocks(self._step_ms * rates, swarm.sensors.step_ms),
            stoppages=begin_stoppages(self.scenario.stuck, variation_streams, variation.wheel_gain),
            drive=Drive(
                actuators=swarm.actuators,
                wheels_cm_s=swarm.wheels_cm_s,
                ring_on=swarm.ring_on,
                wheel_gain=variation.wheel_gain,
                slip=self.scenario.noise.wheel_speed,
                step_s=self.step_s,
                wheel_noise=swarm.wheel_noise,
            ),
        )

    def _show(self, sensors: SensorArrays) -> Step:
        """Return a step that has no number yet, and the arrays of every step."""
        return Step(
            number=-1,
            time_s=0.0,
            poses=_read_only(self._swarm.poses),
            infrared=_read_only(sensors.infrared),
            distance_mm=_read_only(sensors.distance_mm),
            camera=_read_only(sensors.camera),
            wheels_cm_s=_read_only(self._swarm.wheels_cm_s),
            ring_on=_read_only(self._swarm.ring_on),
            memories=tuple(_read_only(group.runner.memory) for group in self._groups),
        )

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
        """Take several control steps, many times faster than one by one, and return the last of them.

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
        for group in self._groups:
            camera = group.runner.arrays.senses.camera
            shown = self._swarm.sensors.camera
            if camera.shape[1] != shown.shape[1]:
                shown[group.first_robot : group.first_robot + len(camera), : camera.shape[1]] = camera
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


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return a view of an array that refuses to be written to."""
    view = array.view()
    view.flags.writeable = False
    return view
