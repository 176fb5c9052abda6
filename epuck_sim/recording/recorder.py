"""Records a trial: an observer that gathers rows in a buffer and turns full buffers into chunks of a recording."""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.errors import RecordingError
from epuck_sim.recording import Level
from epuck_sim.recording.layers import AgentLayers, RobotLayers, arena_entities, static_arena_entities
from epuck_sim.recording.layout import arrangement_of, layout_file
from epuck_sim.recording.rows import AgentBuffer, RobotBuffer, population_of
from epuck_sim.recording.rrd_file import rrd_file, static_chunk, strict_mode
from epuck_sim.recording.series import Texts, recorded_fields, static_time_series, time_series
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_of_model, write_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario, ScenarioLike
from epuck_sim.trial.result import TrialState
from epuck_sim.util.provenance import versions

FORMAT = 1  # version of the entities in a recording
BUFFER_S, BUFFER_ROWS = 600, 60_000
"""Longest simulated time, s, and most rows times robots (8 MB) that are kept in memory before they are written."""

TRIAL, OUTCOME = "trial", "outcome"  # names of the properties that describe the trial, and say how it ended


@contextmanager
def record(
    path: Path | str,
    scenario: ScenarioLike,
    seed: int,
    level: Level | str = Level.FULL,
    *,
    memory: Sequence[str] = (),
) -> Iterator["Recorder"]:
    """Yield an observer of a trial (see `run_trial`) that records it into a file for rerun's viewer.

    Args:
        path: The file, whose name must end in `.rrd`. It gets its name when the block ends; if the block ends with an
            error, an older file stays, and nothing else is left.
        scenario: The trial's scenario, or what `load_scenario` takes.
        seed: The trial's seed.
        level: How much is recorded: summary, poses or full.
        memory: Fields of the controllers' MEMORY to record, whatever the level.

    Raises:
        EpuckSimError: The file cannot be written, the scenario cannot be recorded, there is no such level, or no
            controller remembers a field.
    """
    if level not in list(Level):
        raise RecordingError(f"level is {level!r}; allowed: {', '.join(Level)}")
    level, scenario = Level(level), load_of_model(scenario, Scenario)  # with every default written out
    memory = recorded_fields(scenario, level, memory)
    layout = layout_file(arrangement_of(scenario, level, memory))
    with rrd_file(Path(path), _recording_id(scenario, seed, level, memory), layout) as write:
        recorder = Recorder(scenario, seed, level, BUFFER_S, write, memory)
        yield recorder
        recorder.finish()


class Recorder:
    """An observer of a trial of any model that hands chunks on whenever its buffer is full."""

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        level: Level,
        buffer_s: float,
        write: Callable[[Iterable[Chunk]], None],
        memory: Sequence[str] = (),
    ) -> None:
        """Write the static chunks; the simulation need not exist yet. At most `buffer_s` of it are buffered."""
        self._level, self._send, self.trial_seed = level, write, seed
        self._population = population = population_of(scenario)
        self._threshold = scenario.stop.order_parameter
        self._state: TrialState | None = None
        self._capacity = max(1, int(min(buffer_s * population.rows_per_s, BUFFER_ROWS / population.size)))
        self._buffer: Any
        self._layers: list[RobotLayers | AgentLayers]  # of a full recording
        if isinstance(scenario, EmbodiedScenario):
            self._buffer = RobotBuffer(scenario, level, self._capacity, memory)
            self._layers = [RobotLayers(scenario, population)] if level is Level.FULL else []
        else:
            assert isinstance(scenario, ParticleScenario), "other models have no population"
            self._buffer = AgentBuffer(scenario, seed, level)
            self._layers = [AgentLayers(scenario, population)] if level is Level.FULL else []
        self._texts = Texts(self._threshold)
        self._write(
            _description(scenario, seed, level, memory),
            static_time_series(population, level, memory),
            static_arena_entities(population, level) if level is not Level.SUMMARY else (),
            *(layers.static_chunks() for layers in self._layers),
        )

    def __call__(self, event: Any, state: TrialState) -> None:
        """Record an event of the trial."""
        self._state = state
        self._buffer.append(event, state)
        if self._buffer.row_count >= self._capacity:
            self.flush()

    def catch_up(self, time_s: float) -> None:
        """Record agents up to a time before their next event, as observers are called at events only."""
        self._buffer.catch_up(time_s)
        self.flush()

    def flush(self) -> None:
        """Write the buffered rows."""
        if not self._buffer.row_count:
            return
        batch, population = self._buffer.flush(), self._population
        self._write(
            self._texts.chunks(batch, self._state) if self._state is not None else (),
            time_series(batch, population, self._threshold, self._level),
            arena_entities(batch, population) if self._level is not Level.SUMMARY else (),
            *(layers.chunks(batch) for layers in self._layers),
        )

    def _write(self, *parts: Iterable[Chunk]) -> None:
        with strict_mode():
            self._send(chain.from_iterable(parts))

    def finish(self) -> None:
        """Write the remaining rows, and how the trial ended."""
        cycles, synchronised = 0, False
        if self._state is not None:
            cycles, synchronised = self._state.outcome.cycles, self._state.is_synchronised
            if isinstance(self._buffer, AgentBuffer):
                self._buffer.end(self._state.time_s)
        self.flush()
        final = (layers.final_chunks() for layers in self._layers if isinstance(layers, RobotLayers))
        self._write(*final, [Chunk.from_property(OUTCOME, rr.AnyValues(cycles=cycles, synchronised=synchronised))])


def _recording_id(scenario: Scenario, seed: int, level: Level, memory: Sequence[str]) -> str:
    """Return a name that is the same whenever the same trial is recorded at the same level, with the same fields."""
    described = "\n".join([write_scenario(scenario), str(seed), level, json.dumps(versions()), *memory])
    return hashlib.sha256(described.encode()).hexdigest()[:32]


def _description(scenario: Scenario, seed: int, level: Level, memory: Sequence[str]) -> Iterator[Chunk]:
    described: dict[str, Any] = {
        "format": FORMAT,
        "level": str(level),
        "scenario": write_scenario(scenario),
        "seed": str(seed),  # which may exceed 64 bits
        "versions": json.dumps({**versions(), "rerun": version("rerun-sdk")}),
        **({"memory": json.dumps(memory)} if memory else {}),
    }
    yield Chunk.from_property(TRIAL, rr.AnyValues(**described))
    yield static_chunk("/__properties", rr.archetypes.RecordingInfo(name=f"{scenario.name}, seed {seed}"))
