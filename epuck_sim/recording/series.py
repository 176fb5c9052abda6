"""Plots over time in a recording: flashes, order, phases, memory and readings; and a log of changes."""

import math
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.embodied.step import check_fields, reading_fields
from epuck_sim.recording import GREY, Level
from epuck_sim.recording.rerun import static_chunk, temporal_chunk
from epuck_sim.recording.rows import Population, RowBatch
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import Scenario, require_model
from epuck_sim.trial.result import TrialState

FLASHES = "/flashes"
ORDER_AT_STEPS = "/order/steps"
ORDER_AT_FIRINGS = "/order/firings"
THRESHOLD = "/order/threshold"
PHASES = "/phases"
PHASE_LEAD = "/phase_lead"
WHEELS = "/wheels"
NOW = "/now"
MEMORY = "/memory"
EVENTS = "/events"

KEEP_EXTREMES: dict[str, Any] = {"aggregation_policy": "MinMax"}
"""Style of lines that show their extremes when zoomed out: the mean of many cycles would be flat."""

RED = (225, 40, 40)
BLUE = (60, 130, 230)


def static_time_series(population: Population, level: Level, memory: Sequence[str]) -> Iterator[Chunk]:
    """Yield the appearance of the plots."""
    lines = rr.SeriesLines(names=robot_names(population), **KEEP_EXTREMES)
    for field in memory:
        yield static_chunk(memory_entity(field), lines)
    yield static_chunk(FLASHES, rr.SeriesPoints(colors=RED, markers="circle", marker_sizes=3, names="flash"))
    steps = f"at each {population.moment}"
    yield static_chunk(ORDER_AT_STEPS, rr.SeriesLines(colors=GREY, widths=1, names=steps, **KEEP_EXTREMES))
    firings = "at firings of the reference"
    yield static_chunk(ORDER_AT_FIRINGS, rr.SeriesPoints(colors=BLUE, marker_sizes=4, names=firings))
    yield static_chunk(THRESHOLD, rr.SeriesLines(colors=RED, widths=1, names="synchronised"))
    yield static_chunk(NOW, rr.TextDocument.from_fields(media_type="text/markdown"))
    if level is not Level.SUMMARY:
        yield static_chunk(PHASES, lines)
        yield static_chunk(PHASE_LEAD, rr.SeriesPoints(names=robot_names(population), markers="circle", marker_sizes=2))


def time_series(batch: RowBatch, population: Population, threshold: float | None, level: Level) -> Iterator[Chunk]:
    """Yield the data of the plots in these rows; `threshold` is the order parameter's, None if there is none."""
    time_ns = batch.time_ns
    for field, values in batch.memory:
        yield scalars(memory_entity(field), time_ns, values)
    if len(batch.flashes):
        rows, flashing, cycles = batch.flashes.T
        numbers = rr.Scalars.columns(scalars=flashing), rr.AnyValues.columns(cycle=cycles)
        yield temporal_chunk(FLASHES, time_ns[rows], rr.ComponentColumnList(chain(*numbers)))
    if len(batch.firings):
        yield scalars(ORDER_AT_FIRINGS, time_ns[batch.firings], batch.firing_order)
    yield scalars(ORDER_AT_STEPS, time_ns, batch.order_parameter)
    if threshold is not None:
        yield scalars(THRESHOLD, time_ns[[0, -1]], np.full(2, threshold))
    if level is not Level.SUMMARY:
        yield scalars(PHASES, time_ns, batch.phase_ms)
        if len(batch.firings):
            lead = phase_lead(batch.phase_ms[batch.firings], population)
            yield scalars(PHASE_LEAD, time_ns[batch.firings], lead)


class Texts:
    """Texts of a recording: a log of changes, and a state line with seconds, the cycle, and T_sync once it is known."""

    def __init__(self, threshold: float | None) -> None:
        """Begin before the first row; without a threshold of the order parameter there is no T_sync."""
        self._events = self._cycles = 0
        self._not_yet = "" if threshold is None else ": not synchronised"
        self._said = ""

    def chunks(self, batch: RowBatch, state: TrialState) -> Iterator[Chunk]:
        """Yield the new texts of these rows; `state` is the trial's state after the last row."""
        if events := state.events[self._events :]:
            self._events += len(events)
            times = np.array([round(event.time_s * 1e9) for event in events])
            whom = [f" in {', '.join(map(str, event.robots))}" if event.robots else "" for event in events]
            said = [f"{event.source}: {event.what}{each}" for event, each in zip(events, whom, strict=True)]
            yield temporal_chunk(EVENTS, times, rr.TextLog.columns(text=said))
        cycles = self._cycles + np.searchsorted(batch.firings, np.arange(len(batch.time_ns)), side="right")
        self._cycles = state.cycles
        t_sync = state.outcome.cycles if state.is_synchronised else math.inf
        new: dict[int, str] = {}
        for row, (time_ns, cycle) in enumerate(zip(batch.time_ns.tolist(), cycles.tolist(), strict=True)):
            reached = f": T_sync {t_sync} cycles" if cycle >= t_sync else self._not_yet
            text = f"**{time_ns // 10**9} s**" + (f", cycle {cycle}{reached}" if state.oscillators else "")
            if text != self._said:
                new[row] = self._said = text
        if new:
            yield temporal_chunk(NOW, batch.time_ns[list(new)], rr.TextDocument.columns(text=[*new.values()]))


def phase_lead(phase_ms: FloatArray, population: Population) -> FloatArray:
    """Return (rows, count) cycles, -0.5 to 0.5: by how much phases, (rows, count) ms, are ahead of the reference's."""
    cycles = phase_ms / population.period_ms
    ahead: FloatArray = cycles - cycles[:, [population.reference]]
    return ahead - np.round(ahead)


def robot_names(population: Population) -> list[str]:
    """Return the names of the lines of robots or agents."""
    return [f"{population.noun} {number}" for number in range(population.size)]


def scalars(entity: str, time_ns: IntArray, values: FloatArray) -> Chunk:
    """Return a chunk of (rows, ...) values, row by row."""
    return temporal_chunk(entity, time_ns, rr.Scalars.columns(scalars=values.ravel()), math.prod(values.shape[1:]))


def recorded_fields(scenario: Scenario, level: Level, memory: Sequence[str]) -> tuple[str, ...]:
    """Return the fields that a recording has: those in `memory`, each once, and at level full all readings.

    Raises ScenarioError if no controller remembers a field, or there are no controllers.
    """
    readings = reading_fields(scenario) if isinstance(scenario, EmbodiedScenario) else []
    memory = [memory] if isinstance(memory, str) else memory
    if memory:
        bodies = require_model(scenario, EmbodiedScenario, "only robots have a memory to record")
        check_fields(bodies, [field for field in memory if field not in readings])
    return tuple(dict.fromkeys([*memory, *(readings if level is Level.FULL else ())]))


def memory_entity(field: str) -> str:
    """Return the entity of a field; values are NaN for robots whose controllers have no such field."""
    return f"{MEMORY}/{field}"
