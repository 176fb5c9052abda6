"""The embodied simulation: sense, control, act, move, one control step after the other (thesis 3.1.4.1).

Within a step everybody senses the same instant, then every controller runs, then rings and wheels take effect, then
bodies move. What a controller commands in one step is seen by the others in the next.
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.camera import Camera, make_camera, see
from epuck_sim.cells import make_cells, sort_into_cells
from epuck_sim.control import Control, RobotError
from epuck_sim.drive import chord_velocities, limit_speeds
from epuck_sim.errors import ControllerError
from epuck_sim.infrared import SENSORS, sense_infrared, to_distances
from epuck_sim.placement import place_robots
from epuck_sim.randomness import robot_streams
from epuck_sim.scenario import RobotGroup, Scenario
from epuck_sim.scenario_file import group_controller, load_scenario
from epuck_sim.world import World

Floats = npt.NDArray[np.float64]


class Step(NamedTuple):
    """One control step of all robots: what they sensed, and what they commanded at that instant.

    The arrays are the simulation's own and hold the next step's values as soon as that is taken: copy what you keep.
    """

    number: int
    """Control steps before this one."""
    time_s: float
    """Simulated time of this instant."""
    poses: Floats
    """(robots, 3) cm, cm, rad: x, y, heading at this instant; headings count full turns."""
    infrared: Floats
    """(robots, 8) counts: readings of the proximity sensors."""
    distance_mm: npt.NDArray[np.int64]
    """(robots, 8) mm: distances that belong to them; `epuck.OUT_OF_RANGE_MM` where nothing is in range."""
    camera: npt.NDArray[np.uint8]
    """(robots, pixels): 1 where a lit ring is seen; index 0 is the left edge. Shorter rows are filled up with 0."""
    wheels_cm_s: Floats
    """(robots, 2) cm/s: left and right wheel as commanded, within the wheels' limit, without noise."""
    ring_on: npt.NDArray[np.bool_]
    """(robots,): whose ring is lit, as commanded."""
    memories: tuple[npt.NDArray[Any], ...]
    """One record array a group of robots: what each remembers."""

    @property
    def phase_ms(self) -> Floats:
        """(robots,) ms: the oscillators' phases; NaN for robots that are none."""
        return np.concatenate([recall(memory, "phase_ms", np.nan) for memory in self.memories])

    @property
    def flash_seen(self) -> npt.NDArray[np.bool_]:
        """(robots,): who sees a flash, by its controller's own judgement, or else by any red pixel."""
        judged = np.concatenate([recall(memory, "flash_seen", np.nan) for memory in self.memories])
        return np.where(np.isnan(judged), self.camera.any(axis=1), judged > 0)


def recall(memory: npt.NDArray[Any], field: str, otherwise: float) -> Floats:
    """Return (robots,) a field of what a group remembers, or `otherwise` where it remembers none."""
    if field in (memory.dtype.names or ()):
        return np.asarray(memory[field], float)
    return np.full(len(memory), otherwise)


class _Team(NamedTuple):
    """A group of robots at work: its controller, and its rows of the simulation's arrays."""

    control: Control
    view: Camera
    by_table: bool
    first: int
    infrared: Floats
    infrared_noise: Floats
    distance_mm: npt.NDArray[np.int64]
    camera: npt.NDArray[np.uint8]
    wheels: Floats
    ring_on: npt.NDArray[np.bool_]
    commanded_wheels: Floats
    commanded_ring: npt.NDArray[np.int64]


class Simulation:
    """A swarm in its arena; iterating takes one control step after the other, without end.

    >>> simulation = Simulation("thesis", seed=1)
    >>> step = next(iter(simulation))
    >>> step.poses.shape, step.camera.shape
    ((10, 3), (10, 60))
    """

    scenario: Scenario
    seed: int
    step_s: float
    """Seconds from one control step to the next."""
    period_ms: Floats
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
        self.scenario = scenario = load_scenario(scenario)
        self.seed = scenario.seed if seed is None else seed
        self.step_s = scenario.timing.step_ms / 1000
        placing, sensing, driving, thinking = np.random.SeedSequence(self.seed).spawn(4)
        self._sensing = np.random.default_rng(sensing)
        self._driving = np.random.default_rng(driving)
        streams = robot_streams(thinking, scenario.robot_count)

        poses = place_robots(scenario, placing)
        arena = self._arena = scenario.arena.build()
        self._world = World(arena, poses, scenario.contact.friction, scenario.timing.physics_hz)
        self._cells = make_cells(arena.width_cm, arena.height_cm, len(poses))

        robots, pixels = len(poses), max(group.camera.pixels for group in scenario.robots)
        self._infrared = np.zeros((robots, SENSORS))
        self._infrared_noise = np.zeros((robots, SENSORS))
        self._distance_mm = np.zeros((robots, SENSORS), np.int64)
        self._camera = np.zeros((robots, pixels), np.uint8)
        self._wheels = np.zeros((robots, 2))
        self._wheel_factors = np.ones((robots, 2))
        self._ring_on = np.zeros(robots, np.bool_)
        self.period_ms = np.full(robots, np.nan)

        self._teams: list[_Team] = []
        self._number = 0
        first = 0
        for group in scenario.robots:
            rows = slice(first, first + group.count)
            self._teams.append(self._make_team(group, rows, streams[rows], interpret))
            first += group.count
        self._memories = tuple(team.control.memory for team in self._teams)

    def _make_team(
        self, group: RobotGroup, rows: slice, streams: npt.NDArray[np.uint64], interpret: bool
    ) -> _Team:
        controller = group_controller(group)
        parameters = np.repeat(controller.parameter_record(group.parameters), group.count)
        if controller.is_oscillator:
            self.period_ms[rows] = parameters["period_s"] * 1000
        try:
            control = Control(controller, parameters, streams, interpret)
        except RobotError as error:
            raise self._blame(error, rows.start) from error
        camera = group.camera
        return _Team(
            control,
            make_camera(
                camera.pixels,
                math.radians(camera.field_of_view_deg),
                camera.central_pixels,
                math.inf if camera.range_cm is None else camera.range_cm,
            ),
            group.infrared.distance == "firmware_table",
            rows.start,
            self._infrared[rows],
            self._infrared_noise[rows],
            self._distance_mm[rows],
            self._camera[rows, : camera.pixels],
            self._wheels[rows],
            self._ring_on[rows],
            _pair(control.actuators),
            control.actuators["ring_on"],
        )

    def __iter__(self) -> Iterator[Step]:
        """Yield each control step once its commands are given; bodies move when the next one is asked for.

        Raises ControllerError where a controller does.
        """
        moves = self.scenario.timing.physics_hz // self.scenario.timing.control_hz
        step_ms = self.scenario.timing.step_ms
        poses = self._world.poses
        arrays = (poses, self._infrared, self._distance_mm, self._camera, self._wheels, self._ring_on, self._memories)
        while True:
            if self._number > 0:
                self._world.advance(moves)
            self._sense()
            self._control()
            self._drive()
            yield Step(self._number, self._number * step_ms / 1000, *arrays)
            self._number += 1

    def _sense(self) -> None:
        """Everybody senses the bodies as they stand and the rings as they were commanded in the step before."""
        arena, cells, poses = self._arena, self._cells, self._world.poses
        sort_into_cells(poses, cells)
        sense_infrared(poses, arena.width_cm, arena.height_cm, arena.circles, arena.edges, cells, self._infrared)
        if self.scenario.noise.infrared_counts > 0:
            self._sensing.standard_normal(out=self._infrared_noise)
            self._infrared_noise *= self.scenario.noise.infrared_counts
        for team in self._teams:
            to_distances(team.infrared, team.infrared_noise, team.by_table, team.distance_mm)
            see(poses, self._ring_on, arena.circles, arena.edges, cells, team.view, team.first, team.camera)

    def _control(self) -> None:
        step_ms = self.scenario.timing.step_ms
        for team in self._teams:
            try:
                team.control.step(step_ms, team.infrared, team.distance_mm, team.camera)
            except RobotError as error:
                raise self._blame(error, team.first) from error
        for team in self._teams:
            team.wheels[:] = team.commanded_wheels
            team.ring_on[:] = team.commanded_ring

    def _drive(self) -> None:
        """Hand the bodies the velocities that the wheels give them."""
        unfit = limit_speeds(self._wheels)
        if unfit >= 0:
            raise ControllerError(f"{self._place(unfit)}: its controller sets a wheel speed that is not a number")
        slip = self.scenario.noise.wheel_speed
        if slip > 0:
            self._driving.random(out=self._wheel_factors)
            self._wheel_factors *= 2 * slip
            self._wheel_factors += 1 - slip
        chord_velocities(
            self._world.poses, self._wheels, self._wheel_factors, self.step_s, self._world.velocities
        )

    def _place(self, robot: int) -> str:
        return (
            f"{self.scenario.name}: robot {robot}, step {self._number} ({self._number * self.step_s:g} s), "
            f"seed {self.seed}"
        )

    def _blame(self, error: RobotError, first: int) -> ControllerError:
        return ControllerError(f"{self._place(first + error.robot)}: {error}")


def _pair(actuators: npt.NDArray[np.void]) -> Floats:
    """Return (robots, 2), the wheel speeds within the actuators' records."""
    plain = np.asarray(actuators)
    return np.lib.stride_tricks.as_strided(
        plain["left_cm_s"], (len(plain), 2), (plain.dtype.itemsize, plain.dtype.fields["right_cm_s"][1])  # type: ignore[index]
    )
