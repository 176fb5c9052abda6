"""Rows of a trial, gathered in memory until they are written as chunks: control steps, or moments of agents.

Of agents these are the instants at which some fire, and regular moments in between. The swarm need not be asked
anything between two events: agents move straight on and phases rise evenly, so that its state at one event determines
all moments until the next.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena, make_arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.control.interface import SENSORS
from epuck_sim.embodied.step import Step
from epuck_sim.errors import RecordingError
from epuck_sim.order_parameter import METRICS
from epuck_sim.particles.simulation import Event, ParticleSimulation
from epuck_sim.recording import Level
from epuck_sim.scenario.embodied import EmbodiedScenario, arena_entries, largest_cm
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.embodied import SynchronyWatch

ROWS_PER_PERIOD = 20
"""Regular rows in a nominal period of point-like agents; there are further rows at the instants at which some fire."""

PATH_S = 10.0
"""Length of the drawn paths of robots in seconds."""

PATH_CYCLES = 3
"""Length of the drawn paths of agents in nominal periods."""

SIDE_IN_RADII = 60
"""Side of the space of agents, in radii of the disc that is drawn for each."""

SHORTEST_S = 1e-6
"""Shortest period that can be recorded, in seconds: recordings store whole nanoseconds."""


class Population(NamedTuple):
    """The robots, or point-like agents, of a scenario."""

    noun: str
    """What one of them is called: robot or agent."""
    moment: str
    """What a row is called: step or moment."""
    size: int
    """Number of robots or agents."""
    radii_cm: FloatArray
    """(size,) radius of the disc that is drawn for each, cm."""
    arena: Arena
    """Arena of the robots at the start; for agents their square, the base of their cube, or a segment of height 0."""
    largest_cm: tuple[float, float]
    """Largest width and height that the arena has."""
    arena_changes: bool
    """Whether its walls or obstacles may change."""
    is_cyclic: bool
    """Whether the space is cyclic."""
    period_ms: FloatArray
    """(size,) nominal periods of the oscillators, ms; NaN for a robot that is none."""
    reference: int
    """Number of the reference robot or agent."""
    is_cube: bool
    """Whether the space has a third dimension, along which it is seen."""
    rows_per_s: float
    """Fewest rows that are recorded of a simulated second."""
    path_s: float
    """Length of the drawn paths in seconds."""


def population_of(scenario: Scenario) -> Population:
    """Return a scenario's population; raise RecordingError if its model, or its period, cannot be recorded."""
    if isinstance(scenario, EmbodiedScenario):
        return _robots(scenario)
    if isinstance(scenario, ParticleScenario):
        return _agents(scenario)
    raise RecordingError(f"{scenario.name}: model: {scenario.model} cannot be recorded; allowed: embodied, particles")


def _robots(scenario: EmbodiedScenario) -> Population:
    periods = [1000 * group.parameters.get("period_s", math.nan) for group in scenario.robots]
    return Population(
        noun="robot",
        moment="step",
        size=scenario.robot_count,
        radii_cm=np.array([kind.radius_cm for kind in scenario.robot_kinds]),
        arena=scenario.arena.build(),
        largest_cm=largest_cm(scenario),
        arena_changes=bool(arena_entries(scenario)),
        is_cyclic=False,
        is_cube=False,
        period_ms=np.repeat(periods, [group.count for group in scenario.robots]),
        reference=scenario.stop.reference_robot,
        rows_per_s=scenario.timing.control_hz,
        path_s=PATH_S,
    )


def _agents(scenario: ParticleScenario) -> Population:
    side_cm, period_s = scenario.space.side_cm, scenario.clocks.period_s
    if period_s < SHORTEST_S:
        raise RecordingError(
            f"{scenario.name}: clocks.period_s is {period_s:g}, which is too short for a recording, whose times are "
            f"whole nanoseconds; allowed: {SHORTEST_S:g} or longer"
        )
    height_cm = side_cm if scenario.space.dimensions > 1 else 0.0
    return Population(
        noun="agent",
        moment="moment",
        size=scenario.agents.count,
        radii_cm=np.full(scenario.agents.count, side_cm / SIDE_IN_RADII),
        arena=make_arena(side_cm, height_cm, (), ()),
        largest_cm=(side_cm, height_cm),
        arena_changes=False,
        is_cyclic=scenario.space.boundary == "cyclic",
        is_cube=scenario.space.dimensions == 3,
        period_ms=np.full(scenario.agents.count, 1000 * period_s),
        reference=scenario.stop.reference,
        rows_per_s=ROWS_PER_PERIOD / period_s,
        path_s=PATH_CYCLES * period_s,
    )


class RowBatch(NamedTuple):
    """Consecutive rows: control steps of robots, or moments of point-like agents.

    Below, `count` is the number of robots or agents. Arrays that the level or the model leaves out have no rows.
    """

    time_ns: IntArray
    """(rows,) simulated time, ns."""
    ring_on: BoolArray
    """(rows, count) whether the ring is lit; of agents, whether they fired just before."""
    phase_ms: FloatArray
    """(rows, count) phases, ms."""
    poses: FloatArray
    """(rows, count, 3) cm, cm, rad: x, y, heading."""
    order_parameter: FloatArray
    """(rows,) of all oscillators."""
    flashes: IntArray
    """(flashes, 3) row, number of the robot or agent, and which of its own flashes this is, from 1."""
    firings: IntArray
    """(firings,) rows in which the reference fires."""
    firing_order: FloatArray
    """(firings,) order parameter that the trial measured there."""
    ring_before: BoolArray = np.empty((0, 0), np.bool_)
    """(rows, robots) the rings of the step before, which are those that other robots see."""
    camera: npt.NDArray[np.uint8] = np.empty((0, 0, 0), np.uint8)
    """(rows, robots, pixels) 1 where a lit ring is seen."""
    distance_mm: npt.NDArray[np.uint16] = np.empty((0, 0, SENSORS), np.uint16)
    """(rows, robots, 8) mm: infrared distances."""
    movables: FloatArray = np.empty((0, 0, 2))
    """(rows, movables, 2) cm: where the arena's movables are; no rows without any."""
    arenas: Sequence[tuple[int, Arena]] = ()
    """Of robots, rows from which on walls and obstacles stand, and the arena with them; the first row is 0. Movables
    are elsewhere."""
    wheels_cm_s: FloatArray = np.empty((0, 0, 2))
    """(rows, robots, 2) cm/s: left and right wheel, as commanded."""
    links: IntArray = np.empty((0, 4), np.int64)
    """(links, 4) row, agent that fires, agent that receives the pulse, and 1 where that shifts its phase."""


class RobotBuffer:
    """Gathers steps of robots, a row each; it must be flushed when it is full."""

    row_count: int
    """Rows in the buffer."""
    _watch: SynchronyWatch

    def __init__(self, scenario: EmbodiedScenario, level: Level, capacity: int) -> None:
        """Reserve memory for `capacity` rows."""
        robots, pixels, movables = scenario.robot_count, scenario.camera_pixels, len(scenario.arena.movables)
        posed = capacity if level is not Level.SUMMARY else 0
        sensed = capacity if level is Level.FULL else 0
        self._shapes: dict[str, tuple[tuple[int, ...], type]] = {
            "ring_on": ((capacity, robots), np.bool_),
            "phase_ms": ((capacity, robots), np.float64),
            "poses": ((posed, robots, 3), np.float64),
            "movables": ((posed if movables else 0, movables, 2), np.float64),
            "camera": ((sensed, robots, pixels), np.uint8),
            "distance_mm": ((sensed, robots, SENSORS), np.uint16),
            "wheels_cm_s": ((sensed, robots, 2), np.float64),
        }
        self._capacity = capacity
        self._step_ns = scenario.timing.step_ms * 1_000_000
        self._next_step = 0
        self._cycles = 0  # of the reference
        self._ring_before = np.zeros(robots, np.bool_)
        self._phase_before = np.full(robots, np.nan)
        self._flashes = np.zeros(robots, np.int64)  # of each robot, before the first row
        self._clear()

    def _clear(self) -> None:
        """Take new arrays: those that were returned are not written to again."""
        self.row_count = 0
        self._arrays: dict[str, npt.NDArray[Any]] = {
            name: np.empty(shape, kind) for name, (shape, kind) in self._shapes.items()
        }
        self._filled = [(name, array) for name, array in self._arrays.items() if len(array)]
        self._firings: list[tuple[int, float]] = []
        self._arenas: list[tuple[int, Arena]] = []

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another step."""
        return self.row_count == self._capacity

    def append(self, step: Step, watch: SynchronyWatch) -> None:
        """Add a step."""
        self._watch = watch
        row = self.row_count
        for name, array in self._filled:
            array[row] = getattr(step, name)
        if not row or step.arena is not self._arenas[-1][1]:
            self._arenas.append((row, step.arena))
        if watch.cycles > self._cycles:
            self._cycles = watch.cycles
            if watch.order_parameter is not None:
                self._firings.append((row, watch.order_parameter))
        self.row_count += 1

    def flush(self) -> RowBatch:
        """Return the rows, of which there must be one at least, and remove them."""
        arrays = {name: array[: self.row_count] for name, array in self._arrays.items()}
        ring_on, phase_ms = arrays["ring_on"], arrays["phase_ms"]
        ring_before = np.concatenate([self._ring_before[None], ring_on])[:-1]
        phase_before = np.concatenate([self._phase_before[None], phase_ms])[:-1]
        fires = ring_on & (~ring_before | (phase_ms < phase_before))  # by the rule of `synchrony.SynchronyWatch`
        rows, robots = np.nonzero(fires)
        counts = self._flashes + np.cumsum(fires, axis=0)
        firings = np.array(self._firings, float).reshape(-1, 2)
        batch = RowBatch(
            time_ns=(self._next_step + np.arange(self.row_count)) * self._step_ns,
            ring_before=ring_before,
            order_parameter=self._watch.measure(phase_ms),
            flashes=np.column_stack([rows, robots, counts[rows, robots]]),
            firings=firings[:, 0].astype(np.int64),
            firing_order=firings[:, 1],
            arenas=tuple(self._arenas),
            **arrays,
        )
        self._next_step += self.row_count
        self._ring_before, self._phase_before, self._flashes = ring_on[-1].copy(), phase_ms[-1].copy(), counts[-1]
        self._clear()
        return batch


def make_buffer(scenario: Scenario, seed: int, level: Level, capacity: int) -> Any:
    """Return a buffer for a trial that must be flushed after some `capacity` rows."""
    if isinstance(scenario, EmbodiedScenario):
        return RobotBuffer(scenario, level, capacity)
    assert isinstance(scenario, ParticleScenario), "other models have no population"
    return AgentBuffer(scenario, seed, level, capacity)


GLOW = 0.075
"""Share of a period for which an agent is shown as lit after it has fired: an instant would hardly be seen."""

LATEST_S = 9e9
"""Latest time that can be recorded, in seconds (285 years): nanoseconds are 64-bit integers."""


class _SwarmState(NamedTuple):
    """A swarm just after an event."""

    time_s: float
    positions: FloatArray
    """(agents, dimensions) cm"""
    headings: FloatArray
    """(agents, dimensions) unit vectors"""
    phases: FloatArray
    """(agents,) share of a period"""
    speeds: FloatArray
    """(agents,) cm/s"""


class _Rows(NamedTuple):
    """Rows of the columns of RowBatch that have these names."""

    time_ns: IntArray
    poses: FloatArray
    phase_ms: FloatArray
    ring_on: BoolArray


class AgentBuffer:
    """Gathers moments of point-like agents, a row each; it must be flushed when it is full."""

    row_count: int
    """Rows in the buffer."""

    def __init__(
        self,
        scenario: ParticleScenario,
        seed: int,
        level: Level,
        capacity: int,
        rows_per_period: float = ROWS_PER_PERIOD,
    ) -> None:
        """Prepare for `capacity` rows, which those that lead to a single event may exceed."""
        # observers are shown no swarm before its first event
        fresh = ParticleSimulation(scenario, seed)
        self._before = _state_of(fresh)
        self._periods_s = fresh.periods_s
        self._capacity = capacity
        self._rows_per_period = rows_per_period
        self._stop = scenario.stop
        self._period_s = scenario.clocks.period_s
        self._has_links = level is Level.FULL
        self._regular_row = 0  # number of the next one
        self._flashes = np.zeros(scenario.agents.count, np.int64)  # of each agent so far
        self._flashed_s = np.full(scenario.agents.count, -np.inf)  # time of each agent's last flash
        self._clear()

    def _clear(self) -> None:
        self.row_count = 0
        self._rows: list[_Rows] = []
        self._flash_rows: list[IntArray] = []
        self._firings: list[tuple[int, float]] = []
        self._links: list[IntArray] = []

    @property
    def is_full(self) -> bool:
        """Whether it must be flushed."""
        return self.row_count >= self._capacity

    def append(self, event: Event, swarm: ParticleSimulation) -> None:
        """Add an event and the regular rows before it; raise RecordingError if its time is too late to be recorded."""
        if event.time_s > LATEST_S:
            raise RecordingError(f"{swarm.scenario.name}: lasts more than {LATEST_S:g} s, and cannot be recorded")
        now = _state_of(swarm)
        time_ns = round(event.time_s * 1e9)
        self._add_regular_rows(time_ns)
        if len(event.fired):
            if self._has_links:
                links = swarm.pulse_links()
                self._links.append(np.column_stack([np.full(len(links), self.row_count), links]))
            self._add_flashes(swarm, event)
            self._add_rows(np.array([time_ns]), now.positions[None], now.headings, now.phases[None])
            self._regular_row += self._regular_ns(self._regular_row) == time_ns
        self._before = now

    def catch_up(self, time_s: float) -> None:
        """Add the regular rows before a time at which nothing has happened since the last event."""
        self._add_regular_rows(round(time_s * 1e9))

    def _regular_ns(self, number: int) -> int:
        """Return the time of a regular row, ns."""
        return round(number * self._period_s * 1e9 / self._rows_per_period)

    def _add_regular_rows(self, until_ns: int) -> None:
        """Add the regular rows before `until_ns`: all agents have moved straight on since the event before."""
        times = []
        while self._regular_ns(self._regular_row) < until_ns:
            times.append(self._regular_ns(self._regular_row))
            self._regular_row += 1
        if times:
            before, time_ns = self._before, np.array(times)
            elapsed_s = (time_ns / 1e9 - before.time_s)[:, None]
            moved = (elapsed_s * before.speeds)[..., None] * before.headings
            phases = before.phases + elapsed_s / self._periods_s
            self._add_rows(time_ns, before.positions + moved, before.headings, phases)

    def _add_flashes(self, swarm: ParticleSimulation, event: Event) -> None:
        """Add the flashes of an instant whose row is added next."""
        fired = np.sort(event.fired)
        self._flashes[fired] += 1
        self._flashed_s[fired] = event.time_s
        self._flash_rows.append(np.column_stack([np.full(len(fired), self.row_count), fired, self._flashes[fired]]))
        if self._stop.reference in event.fired and swarm.order_parameter is not None:
            self._firings.append((self.row_count, swarm.order_parameter))

    def _add_rows(self, time_ns: IntArray, positions: FloatArray, headings: FloatArray, phases: FloatArray) -> None:
        """Add rows.

        Args:
            time_ns: (rows,) ns.
            positions: (rows, agents, dimensions) cm.
            headings: (agents, dimensions) unit vectors, the same in all rows.
            phases: (rows, agents) share of a period.
        """
        places, ahead = _from_above(positions), _from_above(headings)
        angles = np.broadcast_to(np.arctan2(ahead[:, 1], ahead[:, 0]), phases.shape)
        is_lit = time_ns[:, None] / 1e9 - self._flashed_s < GLOW * self._period_s
        poses = np.concatenate([places, angles[..., None]], axis=-1)
        self._rows.append(_Rows(time_ns, poses, 1000 * self._period_s * phases, is_lit))
        self.row_count += len(time_ns)

    def flush(self) -> RowBatch:
        """Return the rows, of which there must be one at least, and remove them."""
        rows = _Rows(*map(np.concatenate, zip(*self._rows, strict=True)))
        firings = np.array(self._firings, float).reshape(-1, 2)
        batch = RowBatch(
            **rows._asdict(),
            order_parameter=METRICS[self._stop.metric](rows.phase_ms, 1000 * self._period_s),
            flashes=_joined(self._flash_rows, 3),
            firings=firings[:, 0].astype(np.int64),
            firing_order=firings[:, 1],
            links=_joined(self._links, 4),
        )
        self._clear()
        return batch


def _state_of(swarm: ParticleSimulation) -> _SwarmState:
    return _SwarmState(swarm.time_s, swarm.positions(), swarm.headings(), swarm.phases(), swarm.speeds_cm_s)


def _from_above(vectors: FloatArray) -> FloatArray:
    """Return x and y of vectors, (..., dimensions): a third dimension is dropped, and y of a segment is 0."""
    across = vectors[..., 1:2] if vectors.shape[-1] > 1 else np.zeros_like(vectors)
    return np.concatenate([vectors[..., :1], across], axis=-1)


def _joined(parts: Sequence[IntArray], width: int) -> IntArray:
    """Return the parts, (rows, width) each, one below the other; there may be none."""
    return np.concatenate([np.empty((0, width), np.int64), *parts])
