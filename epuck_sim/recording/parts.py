"""The table of models that can be recorded: how their rows are gathered, and what a recording of them shows."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import rerun.blueprint as rrb

from epuck_sim.errors import RecordingError
from epuck_sim.recording.buffers.agents import SwarmWindow
from epuck_sim.recording.buffers.robots import Columns, Window
from epuck_sim.recording.layers.agents import SwarmDetails
from epuck_sim.recording.layers.robots import Details, RobotDetails
from epuck_sim.recording.layout import make_layout, make_swarm_layout
from epuck_sim.recording.level import Level
from epuck_sim.recording.population import Population
from epuck_sim.scenario.scenario import Scenario


class Buffer(Protocol):
    """Gathers rows of a trial."""

    taken: int
    """Rows in it."""

    @property
    def is_full(self) -> bool:
        """Whether it is to be emptied."""

    def take(self, event: Any, state: Any) -> None:
        """Take note of an event of the trial, as observers are shown it."""

    def empty(self) -> Columns:
        """Return the rows, at least one, and forget them."""


class Parts(NamedTuple):
    """What a recording of a model is made of."""

    layout: Callable[[Level, float, float], rrb.Blueprint]
    """From the level and the arena's width and height, cm."""
    buffer: Callable[[Any, int, Level, int], Buffer]
    """From the scenario, the seed, the level and a number of rows."""
    details: Callable[[Any, Population], Details]
    """From the scenario and its population: what full recordings show beside poses and phases."""


PARTS = {
    "embodied": Parts(make_layout, lambda scenario, _, level, rows: Window(scenario, level, rows), RobotDetails),
    "particles": Parts(make_swarm_layout, SwarmWindow, SwarmDetails),
}


def parts_of(scenario: Scenario) -> Parts:
    """Return the parts of a recording of this scenario's model; raise RecordingError where it cannot be recorded."""
    if scenario.model not in PARTS:
        raise RecordingError(
            f"{scenario.name}: model: {scenario.model} cannot be recorded; allowed: {', '.join(PARTS)}"
        )
    return PARTS[scenario.model]
