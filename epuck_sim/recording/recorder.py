"""Records a trial: an observer that gathers rows in a window and turns full windows into chunks of a recording."""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.recording.chunks import still, strictly
from epuck_sim.recording.layers.arena import ground, set_ground
from epuck_sim.recording.layers.time_series import series, series_styles
from epuck_sim.recording.layout import layout_file
from epuck_sim.recording.level import Level
from epuck_sim.recording.parts import parts_of
from epuck_sim.recording.population import population_of
from epuck_sim.recording.rrd_file import rrd_file
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.observer import TrialState
from epuck_sim.util.provenance import versions

FORMAT = 1
"""Of the entities in a recording; a newer one may have others."""

WINDOW_S = 600
"""Simulated time in memory before it is written."""

WINDOW_ROWS = 60_000
"""But no more rows times robots, or agents, than these: about 8 MB."""

TRIAL = "trial"
OUTCOME = "outcome"
"""Properties of a recording."""


@contextmanager
def record(path: Path, scenario: Scenario, seed: int, level: Level = Level.FULL) -> Iterator["Recorder"]:
    """Yield an observer of a trial (see `run_trial`) that records it into a file for the rerun viewer.

    The file gets its name when the block ends; where it ends with an error, nothing is left behind.
    Raises EpuckSimError where the file cannot be written, or the scenario cannot be recorded.
    """
    scenario = load_scenario(scenario)  # with every default written out
    parts, arena = parts_of(scenario), population_of(scenario).arena
    layout = layout_file(level, arena.width_cm, arena.height_cm, parts.layout)
    with rrd_file(path, recording_id(scenario, seed, level), layout) as write:
        recorder = Recorder(scenario, seed, level, WINDOW_S, write)
        yield recorder
        recorder.finish()


class Recorder:
    """An observer of a trial of any model that hands on chunks, window by window."""

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        level: Level,
        window_s: float,
        write: Callable[[Iterable[Chunk]], None],
    ) -> None:
        """Write what does not move; nothing of a trial needs to exist yet.

        window_s: the most of simulated time that is held back.
        """
        self._level = level
        self._send = write
        self._subject = subject = population_of(scenario)
        self._threshold = scenario.stop.order_parameter
        self._state: TrialState | None = None
        rows = max(1, int(min(window_s * subject.rows_per_s, WINDOW_ROWS / subject.size)))
        parts = parts_of(scenario)
        self._window = parts.buffer(scenario, seed, level, rows)
        self._details = parts.details(scenario, subject) if level is Level.FULL else None
        self._write(_description(scenario, seed, level))
        self._write(series_styles(subject, level))
        if level is not Level.SUMMARY:
            self._write(set_ground(subject))
        if self._details is not None:
            self._write(self._details.still())

    def __call__(self, event: Any, state: TrialState) -> None:
        """Take note of an event of the trial."""
        self._state = state
        self._window.take(event, state)
        if self._window.is_full:
            self._empty_window()

    def _empty_window(self) -> None:
        columns = self._window.empty()
        self._write(series(columns, self._threshold, self._level))
        if self._level is not Level.SUMMARY:
            self._write(ground(columns, self._subject.radius_cm))
        if self._details is not None:
            self._write(self._details.moving(columns))

    def _write(self, chunks: Iterable[Chunk]) -> None:
        with strictly():
            self._send(chunks)

    def finish(self) -> None:
        """Write what is left, and how the trial ended."""
        cycles, synchronised = 0, False
        if self._state is not None:
            cycles, synchronised = self._state.outcome.cycles, self._state.is_synchronised
        if self._window.taken:
            self._empty_window()
        if self._details is not None:
            self._write(self._details.rest())
        self._write([Chunk.from_property(OUTCOME, rr.AnyValues(cycles=cycles, synchronised=synchronised))])


def recording_id(scenario: Scenario, seed: int, level: Level) -> str:
    """Return a name that is the same whenever the same trial is recorded at the same level."""
    described = f"{write_scenario(scenario)}\n{seed}\n{level}\n{json.dumps(versions())}"
    return hashlib.sha256(described.encode()).hexdigest()[:32]


def _description(scenario: Scenario, seed: int, level: Level) -> Iterator[Chunk]:
    made_by = {**versions(), "rerun": version("rerun-sdk")}
    trial = rr.AnyValues(
        format=FORMAT,
        level=str(level),
        scenario=write_scenario(scenario),
        seed=str(seed),  # which may exceed 64 bits
        versions=json.dumps(made_by),
    )
    yield Chunk.from_property(TRIAL, trial)
    yield still("/__properties", rr.archetypes.RecordingInfo(name=f"{scenario.name}, seed {seed}"))
