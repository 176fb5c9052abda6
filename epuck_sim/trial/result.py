"""The outcome of a trial."""

from collections.abc import Mapping
from typing import NamedTuple

from epuck_sim.measures.interface import Value
from epuck_sim.scenario.changes import TrialEvent


class TrialResult(NamedTuple):
    """What came out of a trial."""

    scenario: str
    """The scenario's name."""
    seed: int
    """Seed with which the trial can be run again, alone."""
    t_sync_cycles: int | None
    """Firings of the reference robot until the swarm was synchronised; None if it never was."""
    censored: bool | None
    """Whether the trial ended, at its limit of cycles or time, before the swarm was synchronised.

    None of a trial without T_sync: its reference is no oscillator, or `stop.order_parameter` is null.
    """
    cycles: int
    """Firings of the reference robot, until synchrony if there was any."""
    order_parameter: float | None
    """Order parameter at the last firing counted in `cycles`; None if there was none."""
    steps: int
    """Control steps; of point-like agents, instants at which some fired."""
    simulated_s: float
    """Simulated time in seconds."""
    wall_s: float
    """Time that the trial took, in seconds on the wall."""
    measures: Mapping[str, Value] = {}
    """Value of each of the scenario's measures by its name."""
    events: tuple[TrialEvent, ...] = ()
    """What has changed: entries of the schedule that were carried out, and faults that began and ended."""

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds in a second on the wall."""
        return self.simulated_s / self.wall_s

    def _repr_html_(self) -> str:
        """Return the result as a table, for notebooks."""
        from epuck_sim.display.html import facts, to_html  # noqa: PLC0415 is for notebooks alone

        fields = [*self._replace(measures={})._asdict().items(), *self.measures.items()]
        return to_html(facts((name, _format(value)) for name, value in fields if name != "measures"))


def _format(value: object) -> str:
    if isinstance(value, list | tuple):
        return f"{len(value)} values"
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
