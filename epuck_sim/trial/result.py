"""What a trial shows its observers while it runs, and its outcome."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from epuck_sim.measures.measure import Value
from epuck_sim.order_parameter import Firing
from epuck_sim.scenario.changes import TrialEvent


class TrialState(Protocol):
    """How far a trial is, whatever its model: a `SynchronyWatch` of robots, or a `ParticleSimulation` itself."""

    @property
    def time_s(self) -> float:
        """Simulated time."""

    @property
    def cycles(self) -> int:
        """Firings of the reference so far."""

    @property
    def order_parameter(self) -> float | None:
        """Order parameter at the reference's last firing; None before the first."""

    @property
    def is_synchronised(self) -> bool:
        """Whether the order parameter has reached its threshold."""

    @property
    def oscillators(self) -> int:
        """Number of oscillators, whose order is measured."""

    @property
    def events(self) -> Sequence[TrialEvent]:
        """What has changed so far by a schedule, or by faults."""

    @property
    def outcome(self) -> Firing:
        """The firing at which the swarm was synchronised, or else the last one so far."""


Observer = Callable[[Any, Any], None]
"""Called as `observer(event, state)` after every event of a trial: a `Step` of robots, an `Event` of point agents.

`state` is the trial's TrialState. Observers must not change what they are shown.
"""


class OfStretches(NamedTuple):
    """An observer of robots that is told of many steps at once, by a `Stretch` (`embodied.history`)."""

    tell: Observer

    def __call__(self, stretch: Any, state: Any) -> None:
        """Tell of a stretch, and of how far the trial is at its end."""
        self.tell(stretch, state)


Progress = Callable[[TrialState], None]  # called now and then while a trial runs, to show how far it is


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
