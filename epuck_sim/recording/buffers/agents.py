"""A window of a trial of point-like agents: instants at which some fire, and moments in between, as `Columns`.

Nothing needs to be asked of a swarm between two events: flights are straight and phases rise evenly, so that what was
shown of it at the one tells everything until the other.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.errors import RecordingError
from epuck_sim.order_parameter import METRICS
from epuck_sim.particles.simulation import Event, ParticleSimulation
from epuck_sim.recording.buffers.robots import Columns
from epuck_sim.recording.level import Level
from epuck_sim.recording.population import FRAMES
from epuck_sim.recording.relations.pulses import Hearing
from epuck_sim.scenario.particles import ParticleScenario

GLOW = 0.075
"""For such a share of a period, who has fired is shown as lit: an instant would hardly be seen."""

LATEST_S = 9e9
"""Nanoseconds are counted no farther: 285 years."""


class _Moment(NamedTuple):
    """A swarm just after an event."""

    time_s: float
    positions: FloatArray
    """(agents, dimensions) cm"""
    headings: FloatArray
    """(agents, dimensions) unit vectors."""
    phases: FloatArray
    """(agents,)"""


class _Rows(NamedTuple):
    """Some rows of the columns of the same names; arrays begin with (rows, agents)."""

    time_ns: IntArray
    poses: FloatArray
    phase_ms: FloatArray
    ring_on: BoolArray


class SwarmWindow:
    """Gathers moments; to be emptied when it is full."""

    taken: int
    """Rows in the window."""

    def __init__(self, scenario: ParticleScenario, seed: int, level: Level, rows: int) -> None:
        """Make room for about so many rows: a window may be full to overflowing by those of one event."""
        # observers are shown no swarm before its first event
        fresh = ParticleSimulation(scenario, seed)
        self._before = _look(fresh)
        self._speeds, self._periods_s = fresh.speeds_cm_s, fresh.periods_s
        self._most = rows
        self._stop = scenario.stop
        self._period_s = scenario.clocks.period_s
        self._hearing = Hearing(scenario) if level is Level.FULL else None
        self._frame = 0  # number of the regular row to come
        self._flashes = np.zeros(scenario.agents.count, np.int64)  # of each agent so far
        self._flashed_s = np.full(scenario.agents.count, -np.inf)  # and when it had the last one
        self._begin()

    def _begin(self) -> None:
        self.taken = 0
        self._rows: list[_Rows] = []
        self._flash_rows: list[IntArray] = []
        self._firings: list[tuple[int, float]] = []
        self._links: list[IntArray] = []

    @property
    def is_full(self) -> bool:
        """Whether it is to be emptied."""
        return self.taken >= self._most

    def take(self, event: Event, swarm: ParticleSimulation) -> None:
        """Take note of an event, and of what led there; raises RecordingError for a time that cannot be counted."""
        if event.time_s > LATEST_S:
            raise RecordingError(f"{swarm.scenario.name}: lasts more than {LATEST_S:g} s, and cannot be recorded")
        now = _look(swarm)
        time_ns = round(event.time_s * 1e9)
        self._take_frames(time_ns)
        if len(event.fired):
            if self._hearing is not None:
                links = self._hearing.find_links(now.positions, self._before.headings, event.fired, event.heard)
                self._links.append(np.column_stack([np.full(len(links), self.taken), links]))
            self._take_flashes(swarm, event)
            self._add(np.array([time_ns]), now.positions[None], now.headings, now.phases[None])
            self._frame += self._frame_ns(self._frame) == time_ns
        self._before = now

    def _frame_ns(self, number: int) -> int:
        return round(number * self._period_s * 1e9 / FRAMES)

    def _take_frames(self, until_ns: int) -> None:
        """Take the regular rows before `until_ns`, as all have gone straight on since the event before."""
        times = []
        while self._frame_ns(self._frame) < until_ns:
            times.append(self._frame_ns(self._frame))
            self._frame += 1
        if times:
            before, time_ns = self._before, np.array(times)
            since = (time_ns / 1e9 - before.time_s)[:, None]
            flown = (since * self._speeds)[..., None] * before.headings
            self._add(time_ns, before.positions + flown, before.headings, before.phases + since / self._periods_s)

    def _take_flashes(self, swarm: ParticleSimulation, event: Event) -> None:
        """Take note of who fires at an instant, whose row comes next."""
        fired = np.sort(event.fired)
        self._flashes[fired] += 1
        self._flashed_s[fired] = event.time_s
        self._flash_rows.append(np.column_stack([np.full(len(fired), self.taken), fired, self._flashes[fired]]))
        if self._stop.reference in event.fired and swarm.order_parameter is not None:
            self._firings.append((self.taken, swarm.order_parameter))

    def _add(self, time_ns: IntArray, positions: FloatArray, headings: FloatArray, phases: FloatArray) -> None:
        """Add rows.

        time_ns: (rows,); positions: (rows, agents, dimensions) cm; headings: (agents, dimensions) unit vectors;
        phases: (rows, agents).
        """
        places, ahead = _from_above(positions), _from_above(headings)
        turned = np.broadcast_to(np.arctan2(ahead[:, 1], ahead[:, 0]), phases.shape)
        is_lit = time_ns[:, None] / 1e9 - self._flashed_s < GLOW * self._period_s
        poses = np.concatenate([places, turned[..., None]], axis=-1)
        self._rows.append(_Rows(time_ns, poses, 1000 * self._period_s * phases, is_lit))
        self.taken += len(time_ns)

    def empty(self) -> Columns:
        """Return what is in the window, at least one row; it is empty then."""
        rows = _Rows(*map(np.concatenate, zip(*self._rows, strict=True)))
        firings = np.array(self._firings, float).reshape(-1, 2)
        columns = Columns(
            **rows._asdict(),
            order_parameter=METRICS[self._stop.metric](rows.phase_ms, 1000 * self._period_s),
            flashes=_joined(self._flash_rows, 3),
            firings=firings[:, 0].astype(np.int64),
            firing_order=firings[:, 1],
            links=_joined(self._links, 4),
        )
        self._begin()
        return columns


def _look(swarm: ParticleSimulation) -> _Moment:
    return _Moment(swarm.time_s, swarm.positions(), swarm.headings(), swarm.phases())


def _from_above(vectors: FloatArray) -> FloatArray:
    """Return (..., 2) of (..., dimensions): what a third one adds cannot be seen, and a segment lies along x."""
    across = vectors[..., 1:2] if vectors.shape[-1] > 1 else np.zeros_like(vectors)
    return np.concatenate([vectors[..., :1], across], axis=-1)


def _joined(parts: Sequence[IntArray], width: int) -> IntArray:
    """Return (rows, width) the parts, one after the other; there may be none."""
    return np.concatenate([np.empty((0, width), np.int64), *parts])
