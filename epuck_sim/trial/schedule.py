"""The entries of a schedule that wait for a firing of the reference, or for a condition."""

from collections.abc import Callable, Sequence

from epuck_sim.scenario.schedule import ScheduleEntry, condition_key
from epuck_sim.trial.conditions import Conditions
from epuck_sim.trial.observer import TrialState

NEVER = 2**62
"""Number of a firing that no trial reaches."""


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
