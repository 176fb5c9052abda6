"""Plots of fields of what controllers remember, by name, and of what sensors in files of their own tell."""

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.embodied.memory import READING, check_fields, field_values, reading_fields
from epuck_sim.embodied.step import Step
from epuck_sim.recording.chunks import static_chunk, temporal_chunk
from epuck_sim.recording.layers.time_series import KEEP_EXTREMES, robot_names, scalar_columns
from epuck_sim.recording.level import Level
from epuck_sim.recording.population import Population
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import Scenario, require_model

MEMORY = "/memory"
"""Entity above those with (robots,) scalars at each step, one for each field that is recorded, which has its name."""


class MemorySeries:
    """Gathers fields of what robots remember, a row for each step."""

    def __init__(self, scenario: Scenario, fields: Sequence[str], population: Population) -> None:
        """Check the fields; raise ScenarioError if no controller remembers one, or if there are no controllers."""
        if fields:
            own = [field for field in fields if not field.startswith(READING)]
            check_fields(require_model(scenario, EmbodiedScenario, "robots alone have a memory to record"), own)
        self._rows: dict[str, list[FloatArray]] = {field: [] for field in fields}
        self._population = population

    def append(self, step: Step) -> None:
        """Add a step."""
        for field, rows in self._rows.items():
            rows.append(field_values(step, field))

    def static_chunks(self) -> Iterator[Chunk]:
        """Yield the appearance of the plots."""
        for field in self._rows:
            lines = rr.SeriesLines(names=robot_names(self._population), **KEEP_EXTREMES)
            yield static_chunk(memory_entity(field), lines)

    def flush(self, time_ns: IntArray) -> Iterator[Chunk]:
        """Yield the steps, which were at these times, and remove them."""
        for field, rows in self._rows.items():
            yield temporal_chunk(memory_entity(field), time_ns, *scalar_columns(np.array(rows)))
            rows.clear()


def recorded_fields(scenario: Scenario, level: Level, memory: Sequence[str]) -> tuple[str, ...]:
    """Return the fields that a recording has: those that are asked for, each once, and in a full one all readings."""
    readings = reading_fields(scenario) if level is Level.FULL and isinstance(scenario, EmbodiedScenario) else []
    return tuple(dict.fromkeys([*memory, *readings]))


def memory_entity(field: str) -> str:
    """Return the entity of a field: NaN for robots whose controllers have no such field."""
    return f"{MEMORY}/{field}"
