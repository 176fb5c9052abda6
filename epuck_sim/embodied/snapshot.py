"""Snapshots of simulations: how to get to where one is, from its seed and from what was changed from outside."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.control.interface import Value
from epuck_sim.embodied.commands import Commands
from epuck_sim.scenario.embodied import EmbodiedScenario

if TYPE_CHECKING:
    from epuck_sim.embodied.simulation import Simulation


class Command(NamedTuple):
    """A command from outside."""

    steps: int
    """Control steps before it."""
    wheels_cm_s: FloatArray
    rings: BoolArray

    @classmethod
    def of(cls, steps: int, commands: Commands) -> "Command":
        """Return the present command."""
        return cls(steps, commands.wheels_cm_s.copy(), commands.rings.copy())

    def repeat(self, simulation: "Simulation") -> None:
        """Give the command again."""
        left, right = self.wheels_cm_s.T
        if len(left):
            simulation.command(left, right)
        if len(self.rings):
            simulation.command(ring_on=self.rings)


class ParameterChange(NamedTuple):
    """A change of parameters of a group."""

    steps: int
    """Control steps before it."""
    group: int
    values: dict[str, Value]

    def repeat(self, simulation: "Simulation") -> None:
        """Make the change again."""
        simulation.set_parameters(self.group, **self.values)


class ScheduledChange(NamedTuple):
    """An entry of the schedule that waited for a cycle."""

    steps: int
    """Control steps before it."""
    entry: int

    def repeat(self, simulation: "Simulation") -> None:
        """Carry out the entry again."""
        simulation.carry_out_scheduled(self.entry)


Change = Command | ParameterChange | ScheduledChange


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
