"""Rows of a trial, gathered in memory until they are written as chunks: control steps, or moments of agents.

Moments of agents are the instants at which some fire, and regular moments in between. Between two events, agents move
straight on and phases rise evenly, so that the state at one event determines all moments until the next.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena, make_arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.control.interface import SENSORS
from epuck_sim.embodied.step import Step, field_values
from epuck_sim.errors import RecordingError
from epuck_sim.order_parameter import METRICS, from_reference
from epuck_sim.particles.simulation import GLOW, SIDE_IN_RADII, Event, ParticleSimulation
from epuck_sim.recording import Level
from epuck_sim.scenario.embodied import EmbodiedScenario, arena_entries, largest_cm
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.trial.model import simulate

ROWS_PER_PERIOD = 20  # regular rows of agents; there is a further row whenever some fire
PATH_S = 10.0  # length of the drawn paths of robots
PATH_CYCLES = 3  # length of the drawn paths of agents, nominal periods
SHORTEST_S, LATEST_S = 1e-6, 9e9  # shortest period and latest time: recordings store whole nanoseconds in 64 bits


class Population(NamedTuple):
    """The robots, or point-like agents, of a scenario."""

    noun: str  # what one is called: robot or agent
    moment: str  # what a row is called: step or moment
    size: int
    radii_cm: FloatArray  # (size,) radius of the disc that is drawn for each
    arena: Arena  # at the start; for agents their square, the base of their cube, or a segment of height 0
    largest_cm: tuple[float, float]  # largest width and height that the arena has
    period_ms: FloatArray  # (size,) nominal periods; NaN for a robot that is no oscillator
    reference: int
    rows_per_s: float  # fewest rows of a simulated second
    path_s: float  # length of the drawn paths
    arena_changes: bool = False  # whether walls or obstacles may change
    is_cyclic: bool = False
    is_cube: bool = False  # whether the space has a third dimension, along which it is seen


def population_of(scenario: Scenario) -> Population:
    """Return a scenario's population; raise RecordingError if its model, or its period, cannot be recorded."""
    if isinstance(scenario, ParticleScenario):
        count, side_cm, period_s = scenario.agents.count, scenario.space.side_cm, scenario.clocks.period_s
        if period_s < SHORTEST_S:
            why = "which is too short for a recording, whose times are whole nanoseconds"
            said = f"clocks.period_s is {period_s:g}, {why}; allowed: {SHORTEST_S:g} or longer"
            raise RecordingError(f"{scenario.name}: {said}")
        height_cm = side_cm if scenario.space.dimensions > 1 else 0.0
        return Population(
            noun="agent",
            moment="moment",
            size=count,
            radii_cm=np.full(count, side_cm / SIDE_IN_RADII),
            arena=make_arena(side_cm, height_cm, (), ()),
            largest_cm=(side_cm, height_cm),
            period_ms=np.full(count, 1000 * period_s),
            reference=scenario.stop.reference,
            rows_per_s=ROWS_PER_PERIOD / period_s,
            path_s=PATH_CYCLES * period_s,
            is_cyclic=scenario.space.boundary == "cyclic",
            is_cube=scenario.space.dimensions == 3,
        )
    if not isinstance(scenario, EmbodiedScenario):
        allowed = "allowed: embodied, particles"
        raise RecordingError(f"{scenario.name}: model: {scenario.model} cannot be recorded; {allowed}")
    periods = [1000 * group.parameters.get("period_s", math.nan) for group in scenario.robots]
    return Population(
        noun="robot",
        moment="step",
        size=scenario.population,
        radii_cm=np.array([kind.radius_cm for kind in scenario.robot_kinds]),
        arena=scenario.arena.build(),
        largest_cm=largest_cm(scenario),
        period_ms=np.repeat(periods, [group.count for group in scenario.robots]),
        reference=scenario.stop.reference_robot,
        rows_per_s=scenario.timing.control_hz,
        path_s=PATH_S,
        arena_changes=bool(arena_entries(scenario)),
    )


class RowBatch(NamedTuple):
    """Consecutive rows of `count` robots or agents; arrays that the level or the model leaves out have no rows."""

    time_ns: IntArray  # (rows,) simulated time
    ring_on: BoolArray  # (rows, count) whether the ring is lit; for agents, whether they fired just before
    phase_ms: FloatArray  # (rows, count)
    order_parameter: FloatArray  # (rows,) of all oscillators
    flashes: IntArray  # (flashes, 3) row, robot or agent, number of the flash among its own, from 1
    firings: IntArray  # (firings,) rows in which the reference fires
    firing_order: FloatArray  # (firings,) order parameter that the trial measured there
    poses: FloatArray = np.empty((0, 0, 3))  # (rows, count, 3) cm, cm, rad: x, y, heading
    ring_before: BoolArray = np.empty((0, 0), np.bool_)  # (rows, robots) of the step before: what other robots see
    camera: npt.NDArray[np.uint8] = np.empty((0, 0, 0), np.uint8)  # (rows, robots, pixels) 1 where a lit ring is seen
    distance_mm: npt.NDArray[np.uint16] = np.empty((0, 0, SENSORS), np.uint16)  # (rows, robots, 8) infrared
    wheels_cm_s: FloatArray = np.empty((0, 0, 2))  # (rows, robots, 2) left and right wheel, as commanded
    movables: FloatArray = np.empty((0, 0, 2))  # (rows, movables, 2) cm
    memory: Sequence[tuple[str, FloatArray]] = ()  # name and (rows, robots) values of fields and readings
    arenas: Sequence[tuple[int, Arena]] = ()  # for robots: first row, from 0, and arena, with the movables of that row
    links: IntArray = np.empty((0, 4), np.int64)  # (links, 4) row, firing agent, receiving agent, 1 if its phase shifts


_OF_STEPS: dict[Level, dict[str, type]] = {
    Level.SUMMARY: {"ring_on": np.bool_, "phase_ms": np.float64},
    Level.POSES: {"poses": np.float64, "movables": np.float64},
    Level.FULL: {"camera": np.uint8, "distance_mm": np.uint16, "wheels_cm_s": np.float64},
}
"""Arrays of steps that each level keeps in addition to the one before, with the type of their numbers."""


class RobotBuffer:
    """Gathers steps of robots, a row each."""

    def __init__(self, scenario: EmbodiedScenario, level: Level, capacity: int, memory: Sequence[str]) -> None:
        """Prepare for at most `capacity` rows; memory: fields and readings to keep."""
        levels = list(Level)
        kept = levels[: levels.index(level) + 1]
        self._kinds = {name: kind for each in kept for name, kind in _OF_STEPS[each].items()}
        self._fields, self._capacity = memory, capacity
        self._step_ns = scenario.timing.step_ms * 1_000_000
        self._next_step = 0
        self._cycles = 0  # of the reference
        self._ring_before = np.zeros((1, scenario.population), np.bool_)
        self._phase_before = np.full((1, scenario.population), np.nan)
        self._flashes = np.zeros(scenario.population, np.int64)  # of each robot, before the first row
        self.row_count = 0

    def append(self, step: Step, watch: SynchronyWatch) -> None:
        """Add a step."""
        row, self._watch = self.row_count, watch
        if not row:  # new arrays, as those that were returned must not change
            kinds, rows = self._kinds.items(), self._capacity
            self._arrays = {name: np.empty((rows, *getattr(step, name).shape), kind) for name, kind in kinds}
            self._firings: list[tuple[int, float]] = []
            self._arenas: list[tuple[int, Arena]] = []
            self._arena: Arena | None = None
            self._memory: list[list[FloatArray]] = []
        for name, array in self._arrays.items():
            array[row] = getattr(step, name)
        if step.arena is not self._arena:  # its circles are in the swarm's memory
            self._arena = step.arena
            self._arenas.append((row, step.arena.with_movables_at(step.movables)))
        self._memory.append([field_values(step, field) for field in self._fields])
        if watch.cycles > self._cycles:
            self._cycles = watch.cycles
            if watch.order_parameter is not None:
                self._firings.append((row, watch.order_parameter))
        self.row_count += 1

    def flush(self) -> RowBatch:
        """Return the rows, at least one, and remove them."""
        arrays = {name: array[: self.row_count] for name, array in self._arrays.items()}
        ring_on, phase_ms = arrays["ring_on"], arrays["phase_ms"]
        ring_before = np.concatenate([self._ring_before, ring_on[:-1]])
        phase_before = np.concatenate([self._phase_before, phase_ms[:-1]])
        fires = ring_on & (~ring_before | (phase_ms < phase_before))  # by the rule of `embodied.loop.fires`
        rows, robots = np.nonzero(fires)
        counts = self._flashes + np.cumsum(fires, axis=0)
        batch = RowBatch(
            time_ns=(self._next_step + np.arange(self.row_count)) * self._step_ns,
            ring_before=ring_before,
            order_parameter=self._watch.measure(phase_ms),
            flashes=np.column_stack([rows, robots, counts[rows, robots]]),
            memory=tuple(zip(self._fields, np.array(self._memory).swapaxes(0, 1), strict=True)),
            arenas=tuple(self._arenas),
            **_firing_columns(self._firings),
            **arrays,
        )
        self._next_step += self.row_count
        self._ring_before, self._phase_before, self._flashes = ring_on[-1:].copy(), phase_ms[-1:].copy(), counts[-1]
        self.row_count = 0
        return batch


class AgentBuffer:
    """Gathers moments of point-like agents, a row each."""

    def __init__(
        self, scenario: ParticleScenario, seed: int, level: Level, rows_per_period: float = ROWS_PER_PERIOD
    ) -> None:
        fresh = simulate(scenario, seed)  # observers see no swarm before its first event
        assert isinstance(fresh, ParticleSimulation), "its scenario has agents"
        self._remember(fresh)
        self._periods_s = fresh.periods_s
        self._rows_per_period = rows_per_period
        self._stop = scenario.stop
        self._period_s = scenario.clocks.period_s
        self._has_links = level is Level.FULL
        self._regular_row = 0  # number of the next regular row
        self._flashes = np.zeros(scenario.agents.count, np.int64)  # of each agent so far
        self._flashed_s = np.full(scenario.agents.count, -np.inf)  # time of each agent's last flash
        self._clear()

    def _clear(self) -> None:
        self.row_count = 0
        self._rows: list[tuple[npt.NDArray[Any], ...]] = []  # times, poses, phases, rings
        self._flash_rows = [np.empty((0, 3), np.int64)]
        self._firings: list[tuple[int, float]] = []
        self._links = [np.empty((0, 4), np.int64)]

    def append(self, event: Event, swarm: ParticleSimulation) -> None:
        """Add an event and the regular rows before it; raise RecordingError if its time is too late to be recorded."""
        if event.time_s > LATEST_S:
            raise RecordingError(f"{swarm.scenario.name}: lasts more than {LATEST_S:g} s, and cannot be recorded")
        self.catch_up(event.time_s)
        self._remember(swarm)
        if not len(event.fired):
            return
        time_ns, fired = round(event.time_s * 1e9), np.sort(event.fired)
        if self._has_links:
            links = swarm.pulse_links()
            self._links.append(np.column_stack([np.full(len(links), self.row_count), links]))
        self._flashes[fired] += 1
        self._flashed_s[fired] = event.time_s
        self._flash_rows.append(np.column_stack([np.full(len(fired), self.row_count), fired, self._flashes[fired]]))
        if self._stop.reference in fired and swarm.order_parameter is not None:
            self._firings.append((self.row_count, swarm.order_parameter))
        self._add_rows(np.array([time_ns]), self._positions[None], self._phases[None])
        self._regular_row += self._regular_ns(self._regular_row) == time_ns

    def _remember(self, swarm: ParticleSimulation) -> None:
        """Keep the state of a swarm just after an event."""
        self._time_s, self._speeds_cm_s, self._phases = swarm.time_s, swarm.speeds_cm_s, swarm.phases()
        self._positions, self._headings = swarm.positions(), swarm.headings()

    def catch_up(self, time_s: float) -> None:
        """Add the regular rows before a time at which nothing has happened since the last event."""
        until_ns, times = round(time_s * 1e9), []
        while self._regular_ns(self._regular_row) < until_ns:
            times.append(self._regular_ns(self._regular_row))
            self._regular_row += 1
        if times:
            time_ns = np.array(times)
            elapsed_s = (time_ns / 1e9 - self._time_s)[:, None]
            moved = (elapsed_s * self._speeds_cm_s)[..., None] * self._headings
            self._add_rows(time_ns, self._positions + moved, self._phases + elapsed_s / self._periods_s)

    def end(self, time_s: float) -> None:
        """Add the regular rows up to a trial's end, which may be a time at which nothing happens."""
        self.catch_up(time_s + 1e-9)

    def _regular_ns(self, number: int) -> int:
        return round(number * self._period_s * 1e9 / self._rows_per_period)

    def _add_rows(self, time_ns: IntArray, positions: FloatArray, phases: FloatArray) -> None:
        """Add rows: (rows,) ns, (rows, agents, dimensions) cm and (rows, agents) shares of a period."""
        ahead = _from_above(self._headings)
        angles = np.broadcast_to(np.arctan2(ahead[:, 1], ahead[:, 0]), phases.shape)
        poses = np.concatenate([_from_above(positions), angles[..., None]], axis=-1)
        is_lit = time_ns[:, None] / 1e9 - self._flashed_s < GLOW * self._period_s
        self._rows.append((time_ns, poses, 1000 * self._period_s * phases, is_lit))
        self.row_count += len(time_ns)

    def flush(self) -> RowBatch:
        """Return the rows, at least one, and remove them."""
        time_ns, poses, phase_ms, ring_on = map(np.concatenate, zip(*self._rows, strict=True))
        periods_ms, is_relative = np.full(phase_ms.shape[1], 1000 * self._period_s), self._stop.metric == "reference"
        relative = from_reference(phase_ms, periods_ms, self._stop.reference) if is_relative else phase_ms
        batch = RowBatch(
            time_ns=time_ns,
            poses=poses,
            phase_ms=phase_ms,
            ring_on=ring_on,
            order_parameter=METRICS[self._stop.metric](relative, periods_ms),
            flashes=np.concatenate(self._flash_rows),
            links=np.concatenate(self._links),
            **_firing_columns(self._firings),
        )
        self._clear()
        return batch


def _firing_columns(firings: Sequence[tuple[int, float]]) -> dict[str, Any]:
    rows, order = np.array(firings, float).reshape(-1, 2).T
    return {"firings": rows.astype(np.int64), "firing_order": order}


def _from_above(vectors: FloatArray) -> FloatArray:
    """Return x and y of vectors, (..., dimensions): a third dimension is dropped, and y of a segment is 0."""
    return np.concatenate([vectors, np.zeros((*vectors.shape[:-1], 1))], axis=-1)[..., :2]
