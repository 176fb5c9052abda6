"""The embodied simulation: sense, control, act, move, one control step after the other (thesis 3.1.4.1).

Within a step everybody senses the same instant, then every controller runs, then rings and wheels take effect, then
bodies move. What a controller commands in one step is seen by the others in the next.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.control.interface import ACTUATORS
from epuck_sim.control.runner import RobotError, SensorArrays
from epuck_sim.embodied.cell_list import make_cell_list
from epuck_sim.embodied.differential_drive import apply_commands
from epuck_sim.embodied.group import NOISE_STEPS, RobotGroupState, SwarmArrays, start_group
from epuck_sim.embodied.infrared import SENSORS
from epuck_sim.embodied.placement import place_robots
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.embodied.sensing import sense
from epuck_sim.embodied.step import Step
from epuck_sim.embodied.variation import RobotClocks, Stoppages, draw_variation
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import Scenario, require_model
from epuck_sim.util.seeds import robot_streams


class Simulation:
    """A swarm in its arena; iterating takes one control step after the other, without end.

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
    """(robots,) ms: the oscillators' periods; NaN for robots that are none."""

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any],
        seed: int | None = None,
        *,
        interpret: bool = False,
    ) -> None:
        """Place the robots and start their controllers.

        scenario: a Scenario, or what `load_scenario` takes; seed: the scenario's own if None; interpret: run
        controllers as plain Python, with the same outcome.
        Raises ScenarioError where robots do not fit, ControllerError where a controller cannot start.
        """
        scenario = require_model(load_scenario(scenario), EmbodiedScenario, "a Simulation needs model: embodied")
        self.scenario = scenario
        if scenario.sweep is not None:
            raise ScenarioError(
                f"{scenario.name}: is a sweep; simulate one of its points: `points(scenario)[0].scenario`"
            )
        self.seed = scenario.seed if seed is None else seed
        if self.seed < 0:
            raise ScenarioError(f"{scenario.name}: seed is {self.seed}; allowed: whole numbers from 0")
        self.step_s = scenario.timing.step_ms / 1000
        placing, sensing, driving, *own = np.random.SeedSequence(self.seed).spawn(6)
        self._sensing = np.random.Generator(np.random.SFC64(sensing))
        self._driving = np.random.Generator(np.random.SFC64(driving))
        thinking, ageing, filming = (robot_streams(sequence, scenario.robot_count) for sequence in own)

        poses = place_robots(scenario, placing)
        arena = scenario.arena.build()
        self._world = World(arena, poses, scenario.contact.friction, scenario.timing.physics_hz)

        robots, pixels = len(poses), scenario.camera_pixels
        senses = SensorArrays(
            np.full(robots, scenario.timing.step_ms),
            np.zeros((robots, SENSORS)),
            np.zeros((robots, SENSORS), np.int64),
            np.zeros((robots, pixels), np.int64),
            np.ones(robots, np.bool_),
        )
        self._infrared_noise = np.zeros((NOISE_STEPS, robots, SENSORS))
        self._actuators = np.zeros(robots, ACTUATORS)
        self._wheels = np.zeros((robots, 2))
        self._wheel_noise = np.zeros((NOISE_STEPS, robots, 2))
        self._ring_on = np.zeros(robots, np.bool_)
        self._number = -1  # of the last step taken
        self._step_ms = scenario.timing.step_ms
        self._moves = scenario.timing.physics_hz // scenario.timing.control_hz
        traits = draw_variation(scenario.spread, ageing)
        self._ticks: list[Callable[[int], None]] = []
        if scenario.spread.clock_rate > 0:
            self._ticks.append(RobotClocks(traits.clock_rate, self._step_ms, senses.step_ms).tick)
        if scenario.stuck.per_hour > 0:
            self._ticks.append(Stoppages(scenario.stuck, self.step_s, ageing, traits.wheel_gain).tick)

        everybody = SwarmArrays(
            poses=self._world.poses,
            ring_on=self._ring_on,
            arena=arena,
            cells=make_cell_list(arena.width_cm, arena.height_cm, robots),
            senses=senses,
            infrared_noise=self._infrared_noise,
            infrared_gain=traits.infrared_gain,
            actuators=self._actuators,
            thinking=thinking,
            filming=filming,
        )
        self._teams = list(self._make_teams(everybody, interpret))
        self._ticks += [tick for team in self._teams for tick in team.ticks]
        self.period_ms = np.concatenate([np.full(len(team.control.memory), team.period_ms) for team in self._teams])
        arrays = (self._world.poses, *senses[1:4], self._wheels, self._ring_on)
        self._shown: tuple[Any, ...] = (
            *(_read_only(array) for array in arrays),
            tuple(_read_only(team.control.memory) for team in self._teams),
        )
        self._acting = [
            (
                *(self._actuators, self._wheels, self._ring_on, self._world.poses),
                *(traits.wheel_gain, noise, scenario.noise.wheel_speed, self.step_s, self._world.velocities),
            )
            for noise in self._wheel_noise
        ]
        self._warm_up()

    def _make_teams(self, everybody: SwarmArrays, interpret: bool) -> Iterator[RobotGroupState]:
        first = 0
        for group in self.scenario.robots:
            try:
                yield start_group(self.scenario, group, first, everybody, interpret=interpret)
            except RobotError as error:
                raise self._blame(error, first) from error
            first += group.count

    def _warm_up(self) -> None:
        """Have compiled what the steps call, before any clock runs; there is no noise and no command yet."""
        for team in self._teams:
            sense(*team.sensing[0])
        for tick in self._ticks:
            tick(-1)
        apply_commands(*self._acting[0])

    @property
    def steps(self) -> int:
        """Control steps taken so far."""
        return self._number + 1

    def __iter__(self) -> Iterator[Step]:
        """Go on from where the simulation stands."""
        return self

    def __next__(self) -> Step:
        """Move the bodies, unless this is the first step; let everybody sense, and command; return the step.

        Raises ControllerError where a controller does.
        """
        self._number += 1
        now = self._number % NOISE_STEPS
        noise = self.scenario.noise
        if self._number > 0:
            self._world.advance(self._moves)
        if now == 0 and noise.infrared_counts > 0:
            self._sensing.standard_normal(out=self._infrared_noise)
        if now == 0 and noise.wheel_speed > 0:
            self._driving.random(out=self._wheel_noise)
        for team in self._teams:
            sense(*team.sensing[now])
        for tick in self._ticks:
            tick(self._number)
        for team in self._teams:
            try:
                team.control.step()
            except RobotError as error:
                raise self._blame(error, team.first) from error
        unfit = apply_commands(*self._acting[now])
        if unfit >= 0:
            raise ControllerError(f"{self._place(unfit)}: its controller sets a wheel speed that is not a number")
        return Step(self._number, self._number * self._step_ms / 1000, *self._shown)

    def _place(self, robot: int) -> str:
        return f"{self.scenario.name}: robot {robot}, step {max(self._number, 0)}, seed {self.seed}"

    def _blame(self, error: RobotError, first: int) -> ControllerError:
        return ControllerError(f"{self._place(first + error.robot)}: {error}")


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    view = array.view()
    view.flags.writeable = False
    return view
