"""Whether a trial looks hopeless: for many cycles its order parameter is that of random phases, or stands still."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from epuck_sim.trial.result import TrialState

CYCLES = 200  # number of cycles whose order parameters are looked at together
NORMAL_QUANTILE = 3.0902  # 99.9 % quantile of the standard normal distribution
STANDSTILL = 0.05  # largest change of the order parameter, relative to what it lacks to 1, that counts as none


def is_hopeless(orders: npt.ArrayLike, oscillators: int, metric: str = "complex") -> bool:
    """Return whether order parameters of successive cycles do not tend to 1: they are low, or stand still.

    They are low if their mean is at most the 99.9 % quantile of the mean over as many cycles of independent phases,
    uniform over the period.

    Args:
        orders: (cycles,) order parameters.
        oscillators: Number of oscillators.
        metric: As `stop.metric`: `complex`, eqs. 4.2 and 5.7, or `reference`, eq. 3.4.

    >>> is_hopeless([0.2, 0.3, 0.4], 10), is_hopeless([0.7, 0.8, 0.9], 10), is_hopeless([0.8, 0.8, 0.8], 10)
    (True, False, True)
    """
    orders = np.asarray(orders, np.float64)
    mean, deviation = _of_random_phases(oscillators, metric)
    is_low = orders.mean() <= mean + NORMAL_QUANTILE * deviation / math.sqrt(len(orders))
    return bool(is_low or np.ptp(orders) <= STANDSTILL * (1 - orders.max()))


def _of_random_phases(oscillators: int, metric: str) -> tuple[float, float]:
    """Return mean and standard deviation of the order parameter of random phases.

    The mean distance of a random walk of n unit steps is that of a Gaussian one but for a factor of 1 + 1 / 16 n, with
    an error of 1.5 % for two steps and at most 0.5 % for more; its mean square is n.
    """
    if metric == "reference":  # the reference's own phase is 0
        return 1 / oscillators, math.sqrt((oscillators - 1) / 2) / oscillators
    mean = math.sqrt(math.pi / (4 * oscillators)) * (1 + 1 / (16 * oscillators))
    return mean, math.sqrt(1 / oscillators - mean * mean)


class HopelessnessWatch:
    """Looks at a trial again and again, until it looks hopeless."""

    def __init__(self, metric: str, tell: Callable[[float], None]) -> None:
        """Watch a trial; `tell` is called once, with the mean order parameter, when the trial looks hopeless."""
        self._metric = metric
        self._tell: Callable[[float], None] | None = tell
        self._cycle = 0
        self._orders: list[float] = []

    def __call__(self, state: TrialState) -> None:
        """Take note of the last cycle, unless it was seen before; between two looks some may be missed."""
        if self._tell is None or state.cycles == self._cycle or state.order_parameter is None:
            return
        self._cycle = state.cycles
        self._orders.append(state.order_parameter)
        if len(self._orders) < CYCLES:
            return
        if not state.is_synchronised and is_hopeless(self._orders, state.oscillators, self._metric):
            self._tell(sum(self._orders) / CYCLES)
            self._tell = None
        self._orders = []
