"""Snapshots of simulations: how to get to where one is, from its seed and from what was changed from outside."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from epuck_sim.scenario.embodied import EmbodiedScenario


class Change(NamedTuple):
    """A call from outside that changed a simulation, and changes another one in the same way."""

    steps: int
    """Control steps before it."""
    method: str
    """Name of the method of `Simulation`."""
    given: tuple[Any, ...]
    values: dict[str, Any]
    """Arguments by name."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A simulation at one moment; can be pickled."""

    scenario: EmbodiedScenario
    seed: int
    steps: int
    """Control steps taken."""
    changes: tuple[Change, ...]
    """What was commanded and changed from outside, in order."""

    def __repr__(self) -> str:
        """Return one line."""
        return f"Snapshot({self.scenario!r}, seed={self.seed}, steps={self.steps}, changes={len(self.changes)})"
