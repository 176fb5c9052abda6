"""The table of models that can be recorded: how their rows are gathered, and what a recording of them shows."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, Protocol

import rerun.blueprint as rrb
from rerun.chunk import Chunk

from epuck_sim.errors import RecordingError
from epuck_sim.recording.layers.agents import AgentLayers
from epuck_sim.recording.layers.robots import RobotLayers
from epuck_sim.recording.layout import agent_layout, robot_layout
from epuck_sim.recording.level import Level
from epuck_sim.recording.population import Population, agent_population, robot_population
from epuck_sim.recording.rows import AgentBuffer, RobotBuffer, RowBatch
from epuck_sim.scenario.scenario import Scenario


class Buffer(Protocol):
    """Gathers rows of a trial."""

    row_count: int
    """Rows in it."""

    @property
    def is_full(self) -> bool:
        """Whether it must be flushed."""

    def append(self, event: Any, state: Any) -> None:
        """Add an event of the trial, as observers are shown it."""

    def flush(self) -> RowBatch:
        """Return the rows, of which there must be one at least, and remove them."""


class Layers(Protocol):
    """What a full recording of one model shows, beside what all models have."""

    def static_chunks(self) -> Iterable[Chunk]:
        """Return what does not change, and the appearance of what does."""

    def chunks(self, batch: RowBatch) -> Iterable[Chunk]:
        """Return what these rows show."""

    def final_chunks(self) -> Iterable[Chunk]:
        """Return what was held back until the end of the trial."""


class Parts(NamedTuple):
    """What a recording of one model is made of."""

    population: Callable[[Any], Population]
    """Returns the population; takes the scenario."""
    layout: Callable[[Level, float, float, Sequence[str], bool], rrb.Blueprint]
    """Returns the layout of the viewer; takes the level, the arena's width and height, cm, fields of memory, and
    whether there is a log of events."""
    buffer: Callable[[Any, int, Level, int], Buffer]
    """Returns an empty buffer; takes the scenario, the seed, the level and the capacity in rows."""
    layers: Callable[[Any, Population], Layers]
    """Returns the layers of a full recording; takes the scenario and its population."""


PARTS = {
    "embodied": Parts(
        population=robot_population,
        layout=robot_layout,
        buffer=lambda scenario, _, level, capacity: RobotBuffer(scenario, level, capacity),
        layers=RobotLayers,
    ),
    "particles": Parts(population=agent_population, layout=agent_layout, buffer=AgentBuffer, layers=AgentLayers),
}
"""Parts by model. A further model is one more entry."""


def parts_of(scenario: Scenario) -> Parts:
    """Return the parts of a recording of a scenario's model; raise RecordingError if it cannot be recorded."""
    if scenario.model not in PARTS:
        raise RecordingError(
            f"{scenario.name}: model: {scenario.model} cannot be recorded; allowed: {', '.join(PARTS)}"
        )
    return PARTS[scenario.model]


def population_of(scenario: Scenario) -> Population:
    """Return a scenario's population; raise RecordingError if its model, or its period, cannot be recorded."""
    return parts_of(scenario).population(scenario)


def layout_of(scenario: Scenario, level: Level, memory: Sequence[str] = ()) -> rrb.Blueprint:
    """Return how the viewer lays out recordings of a scenario; raise RecordingError as `population_of` does.

    Args:
        scenario: The scenario.
        level: How much is recorded.
        memory: Fields of the controllers' MEMORY that are recorded.
    """
    width_cm, height_cm = population_of(scenario).largest_cm
    return parts_of(scenario).layout(level, width_cm, height_cm, memory, scenario.has_events)
