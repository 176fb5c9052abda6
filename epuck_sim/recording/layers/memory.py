"""Plots of what controllers remember: fields of their MEMORY, by name."""

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.embodied.memory import check_fields, memory_values
from epuck_sim.embodied.step import Step
from epuck_sim.recording.chunks import static_chunk, temporal_chunk
from epuck_sim.recording.layers.time_series import KEEP_EXTREMES, robot_names, scalar_columns
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
            check_fields(require_model(scenario, EmbodiedScenario, "robots alone have a memory to record"), fields)
        self._rows: dict[str, list[FloatArray]] = {field: [] for field in fields}
        self._population = population

    def append(self, step: Step) -> None:
        """Add a step."""
        for field, rows in self._rows.items():
            rows.append(memory_values(step.memories, field))

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


def memory_entity(field: str) -> str:
    """Return the entity of a field: NaN for robots whose controllers have no such field."""
    return f"{MEMORY}/{field}"
