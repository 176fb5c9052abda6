"""What a trial waits for: conditions on measures, and the moments of entries of its schedule."""

from collections.abc import Callable, Mapping, Sequence

from epuck_sim.measures.interface import Value
from epuck_sim.scenario.changes import ScheduleEntry, condition_key
from epuck_sim.scenario.scenario import STOP
from epuck_sim.scenario.stop import Awaited
from epuck_sim.trial.observer import TrialState

NEVER = 2**62
"""Number of a firing that no trial reaches."""


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


class WaitingEntries:
    """Has entries of a schedule carried out when their moment has come; entries that have a time are none of these."""

    def __init__(
        self, schedule: Sequence[ScheduleEntry], conditions: Conditions, carry_out: Callable[[int], None]
    ) -> None:
        """Wait for all moments; carry_out: carries out the entry of a number, from the next event on."""
        self._waiting = {number: entry for number, entry in enumerate(schedule) if entry.at_s is None}
        self._conditions = conditions
        self._carry_out = carry_out

    @property
    def next_cycle(self) -> int:
        """Number of the next firing after which an entry is to be carried out; `NEVER` if none waits for one."""
        return min((entry.at_cycle for entry in self._waiting.values() if entry.at_cycle is not None), default=NEVER)

    def look(self, state: TrialState) -> None:
        """Have those carried out whose moment has come; to be called between two events."""
        if not self._waiting:
            return
        for number in [number for number in self._waiting if self._has_come(number, state)]:
            self._carry_out(number)
            del self._waiting[number]

    def _has_come(self, number: int, state: TrialState) -> bool:
        at_cycle = self._waiting[number].at_cycle
        if at_cycle is not None:
            return state.cycles >= at_cycle
        return self._conditions.has_held(condition_key(number))
