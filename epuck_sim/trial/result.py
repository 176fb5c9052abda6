"""A trial's state for its observers, whether it looks hopeless, and its outcome."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from epuck_sim.measures.measure import Value
from epuck_sim.order_parameter import Firing
from epuck_sim.scenario.changes import TrialEvent

WINDOW = 200  # number of cycles whose order parameters are judged together
NORMAL_QUANTILE = 3.0902  # 99.9 % quantile of the standard normal distribution
STANDSTILL = 0.05  # largest change of the order parameter, relative to its distance from 1, that counts as none


class TrialState(Protocol):
    """State of a trial of any model: a `SynchronyWatch` of robots, or a `ParticleSimulation` itself."""

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
        """Changes so far by a schedule, or by faults."""

    @property
    def outcome(self) -> Firing:
        """The firing at which the swarm was synchronised, or else the last one so far."""


Observer = Callable[[Any, Any], None]
"""Called as `observer(event, state)` after every event of a trial: a `Step` of robots, an `Event` of point agents.

`state` is the trial's TrialState. Observers must not change what they are shown, nor take steps.
"""

Progress = Callable[[TrialState], None]  # called now and then while a trial runs, to show how far it is


def is_hopeless(orders: npt.ArrayLike, oscillators: int, metric: str = "complex") -> bool:
    """Return whether (cycles,) successive order parameters do not tend to 1: they are low, or stand still.

    They are low if their mean is at most the 99.9 % quantile of the mean over as many cycles of independent phases,
    uniform over the period. The metric is that of the scenario's `stop`.

    >>> is_hopeless([0.2, 0.3, 0.4], 10), is_hopeless([0.7, 0.8, 0.9], 10), is_hopeless([0.8, 0.8, 0.8], 10)
    (True, False, True)
    """
    orders = np.asarray(orders, np.float64)
    mean, deviation = _of_random_phases(oscillators, metric)
    is_low = orders.mean() <= mean + NORMAL_QUANTILE * deviation / math.sqrt(len(orders))
    return bool(is_low or np.ptp(orders) <= STANDSTILL * (1 - orders.max()))


def _of_random_phases(oscillators: int, metric: str) -> tuple[float, float]:
    """Return mean and standard deviation of the order parameter of random phases.

    The mean distance of a random walk of n unit steps is that of a Gaussian one times 1 + 1 / 16 n, with an error of
    1.5 % for two steps and at most 0.5 % for more; its mean square is n.
    """
    if metric == "reference":  # the reference's own phase is 0
        return 1 / oscillators, math.sqrt((oscillators - 1) / 2) / oscillators
    if metric != "complex":
        raise ValueError(f"metric is {metric!r}; allowed: complex or reference, whose order of random phases is known")
    mean = math.sqrt(math.pi / (4 * oscillators)) * (1 + 1 / (16 * oscillators))
    return mean, math.sqrt(1 / oscillators - mean * mean)


def hopelessness_watch(metric: str, tell: Callable[[float], None]) -> Progress:
    """Return a function that judges a trial every `WINDOW` cycles, and calls `tell` once when it looks hopeless.

    It tells the mean order parameter. Cycles between two calls are missed.
    """
    orders: list[float] = []
    cycle, has_told = 0, False

    def watch(state: TrialState) -> None:
        nonlocal cycle, has_told
        if has_told or state.cycles == cycle or state.order_parameter is None:
            return
        cycle = state.cycles
        orders.append(state.order_parameter)
        if len(orders) == WINDOW:
            if has_told := not state.is_synchronised and is_hopeless(orders, state.oscillators, metric):
                tell(sum(orders) / WINDOW)
            orders.clear()

    return watch


class TrialResult(NamedTuple):
    """Outcome of a trial."""

    scenario: str
    """The scenario's name."""
    seed: int
    """Seed with which the trial can be run again, alone."""
    t_sync_cycles: int | None
    """Firings of the reference robot until the swarm was synchronised; None if it never was."""
    censored: bool | None
    """Whether the trial ended, at its limit of cycles or time, before the swarm was synchronised.

    None for a trial without T_sync: its reference is no oscillator, or `stop.order_parameter` is null.
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
    """Wall time of the trial in seconds."""
    measures: Mapping[str, Value] = {}
    """Value of each of the scenario's measures by its name."""
    events: tuple[TrialEvent, ...] = ()
    """Changes: entries of the schedule that were carried out, and faults that began and ended."""

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per second of wall time."""
        return self.simulated_s / self.wall_s

    def _repr_html_(self) -> str:
        from epuck_sim.display.html import facts, to_html  # noqa: PLC0415 is for notebooks alone
        from epuck_sim.display.table import cell_text  # noqa: PLC0415

        fields = [*self._replace(measures={})._asdict().items(), *self.measures.items()]
        return to_html(facts((name, cell_text(value)) for name, value in fields if name != "measures"))
