"""Conditions on measures, and whether they have held in a trial."""

from collections.abc import Mapping

from epuck_sim.measures.interface import Value
from epuck_sim.scenario.condition import Awaited
from epuck_sim.scenario.scenario import STOP


class ConditionWatch:
    """Looks at the values of a measure until a condition on it has held."""

    has_held: bool

    def __init__(self, awaited: Awaited) -> None:
        self.measure = awaited.condition.measure
        self.counts_firings = awaited.for_cycles is not None
        """Whether it is to look at firings of the reference alone, instead of wherever the measure is told."""
        self._condition = awaited.condition
        self._needed = awaited.for_cycles or 1
        self._in_a_row = 0
        self.has_held = False

    def look(self, value: Value) -> None:
        """Take note of a value; where it is undetermined, the condition does not hold."""
        holds = isinstance(value, int | float) and self._condition.holds(value)
        self._in_a_row = self._in_a_row + 1 if holds else 0
        self.has_held = self.has_held or self._in_a_row >= self._needed


class Conditions:
    """The conditions that a trial waits for."""

    def __init__(self, awaited: Mapping[str, Awaited]) -> None:
        """Wait for conditions, each of which is given by its dotted key in the scenario."""
        self._watches = {key: ConditionWatch(each) for key, each in awaited.items()}

    def on(self, measure: str) -> list[ConditionWatch]:
        """Return those on the measure of this name."""
        return [watch for watch in self._watches.values() if watch.measure == measure]

    def has_held(self, key: str) -> bool:
        """Return whether the condition with this key has held."""
        return self._watches[key].has_held

    def is_over(self) -> bool:
        """Return whether the condition that ends the trial has held, if there is one."""
        return STOP in self._watches and self.has_held(STOP)
