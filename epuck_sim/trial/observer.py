"""What observers of a trial are shown: every event, and how far the trial is."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

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


Progress = Callable[[TrialState], None]
"""Called now and then while a trial runs, to show how far it is."""
