"""Moments of point-like agents: the instants at which some fire, and regular ones in between.

The swarm need not be asked anything between two events: agents move straight on and phases rise evenly, so that its
state at one event determines all moments until the next.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.errors import RecordingError
from epuck_sim.order_parameter import METRICS
from epuck_sim.particles.simulation import Event, ParticleSimulation
from epuck_sim.recording.buffers.row_batch import RowBatch
from epuck_sim.recording.level import Level
from epuck_sim.recording.population import ROWS_PER_PERIOD
from epuck_sim.scenario.particles import ParticleScenario

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

    def __init__(self, scenario: ParticleScenario, seed: int, level: Level, capacity: int) -> None:
        """Prepare for `capacity` rows, which those that lead to a single event may exceed."""
        # observers are shown no swarm before its first event
        fresh = ParticleSimulation(scenario, seed)
        self._before = _state_of(fresh)
        self._periods_s = fresh.periods_s
        self._capacity = capacity
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

    def _regular_ns(self, number: int) -> int:
        """Return the time of a regular row, ns."""
        return round(number * self._period_s * 1e9 / ROWS_PER_PERIOD)

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
