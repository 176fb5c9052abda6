"""The entries of a schedule that wait for a cycle, or for a condition at cycles."""

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.schedule import ScheduleEntry
from epuck_sim.trial.synchrony import SynchronyWatch


class CycleSchedule:
    """Has a simulation carry out entries of its schedule after firings of the reference."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        schedule = enumerate(simulation.scenario.schedule)
        self._waiting = {number: entry for number, entry in schedule if entry.at_s is None}
        self._held = dict.fromkeys(self._waiting, 0)
        """Number of firings in a row, up to the last, at which each entry's condition has held."""
        self._cycles = 0

    def look(self, watch: SynchronyWatch) -> None:
        """Have entries carried out whose moment has come; to be called between two control steps."""
        if watch.cycles == self._cycles:
            return
        self._cycles = watch.cycles
        due = [number for number, entry in self._waiting.items() if self._has_come(number, entry, watch)]
        for number in due:
            self._simulation.carry_out_scheduled(number)
            del self._waiting[number]

    def _has_come(self, number: int, entry: ScheduleEntry, watch: SynchronyWatch) -> bool:
        """Return whether an entry is to be carried out at this firing."""
        if entry.when is None:
            return entry.at_cycle is not None and watch.cycles >= entry.at_cycle
        holds = watch.order_parameter is not None and entry.when.holds(watch.order_parameter)
        self._held[number] = self._held[number] + 1 if holds else 0
        return self._held[number] >= entry.for_cycles
