"""How a small perturbation of point agents grows or dies out, beside a twin without it (thesis 5.4)."""

import math
from dataclasses import dataclass
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.elementary import log
from epuck_sim.measures.common import BELOW_HALF_A_CYCLE, Series, allowed

SMALLEST, LARGEST = 1e-12, 0.1  # deviations in cycles between which one grows freely: above rounding, below a cycle


@dataclass
class _Twin(Series):
    """Base class of measures of perturbations: the largest deviation of a phase from the twin's, at each cycle."""

    displacement: float = 0.0
    check = staticmethod(allowed(displacement=BELOW_HALF_A_CYCLE))
    MODELS = ("particles",)

    def __post_init__(self) -> None:
        from epuck_sim.particles.twin import make_endless, make_twin  # reading a scenario must not compile anything

        scenario, seed = self.simulation.scenario, self.simulation.seed
        self._twin = make_twin(scenario, seed, self.displacement)
        self._wait_s = scenario.clocks.period_s / 2 if self.displacement else 0.0  # a twin slightly behind fires later
        # a twin that is run to a firing has had changes scheduled for that time: compare it with a copy run alike
        self._trial = make_endless(scenario, seed) if self._wait_s or scenario.schedule else self.simulation

    @staticmethod
    def check_scenario(scenario: Any, parameters: SimpleNamespace) -> None:
        if not parameters.displacement and not scenario.start.displacement and not scenario.clocks.jitter:
            instead = "give displacement, or the scenario's start.displacement or clocks.jitter"
            raise ValueError(f"there is no perturbation to measure; {instead}")
        scenario.check_twin()

    def batch(self, batch: Any, _: Any) -> None:
        from epuck_sim.particles.twin import deviations

        for row, time_s in enumerate(batch.time_s.tolist()):
            for simulation in {self._trial, self._twin} - {self.simulation}:
                simulation.run_to(time_s + self._wait_s)
            phases = batch.phases[row] if self._trial is self.simulation else self._trial.phases()
            self._series.append(float(deviations(phases, self._twin.phases()).max()))


class Perturbation(_Twin):
    """Largest deviation of a phase from that of an undisturbed twin, in cycles, at each cycle (series; agents).

    The twin has neither the scenario's displacement nor its jitter (5.4). With `displacement` it has both, the phase of
    its agent 0 starts ahead by `displacement`, and the two are compared half a period after each firing.
    """

    UNIT = "cycles"


class PerturbationGrowth(_Twin):
    """Growth of the deviation `perturbation` since the last cycle: ln(d / d before) at each cycle (series; agents)."""

    def value(self) -> list[float | None]:
        """Return the series; None at the first cycle and where the deviation is too small or too large to tell."""
        return [None, *growth_rates(self._series)] if self._series else []


class PerturbationExponent(_Twin):
    """Mean growth a cycle while the deviation is small, and its 95 % interval (a series of three; agents)."""

    OVER = "part"

    def value(self) -> list[float | None]:
        """Return mean, lower and upper end; None where there are too few cycles."""
        return mean_with_interval([rate for rate in growth_rates(self._series) if rate is not None])


@dataclass
class PerturbationTransient(_Twin):
    """Cycles until the deviation is at most `tolerance` for good (agents)."""

    tolerance: float = 0.01
    _rule = (lambda tolerance: 0 < tolerance < 0.5, "above 0 and below 0.5, in cycles")
    check = staticmethod(allowed(displacement=BELOW_HALF_A_CYCLE, tolerance=_rule))
    UNIT = "cycles"

    def value(self) -> int | None:
        """Return the number of cycles after which no deviation is above `tolerance`; None if the last one is."""
        beyond = (cycle for cycle, deviation in enumerate(self._series, 1) if deviation > self.tolerance)
        last = max(beyond, default=0)
        return last if last < len(self._series) else None


def growth_rates(deviations: list[float]) -> list[float | None]:
    """Return ln of each deviation over the one before; None unless both are from `SMALLEST` to `LARGEST`."""
    return [
        log(after / before) if min(before, after) >= SMALLEST and max(before, after) <= LARGEST else None
        for before, after in pairwise(deviations)
    ]


def mean_with_interval(rates: list[float]) -> list[float | None]:
    """Return the mean of rates and the ends of Student's 95 % interval, as if the rates were independent."""
    if len(rates) < 2:
        return [rates[0] if rates else None, None, None]
    values: FloatArray = np.array(rates)
    mean = float(values.mean())
    from scipy.special import stdtrit

    half = float(stdtrit(len(rates) - 1, 0.975) * values.std(ddof=1) / math.sqrt(len(rates)))
    return [mean, mean - half, mean + half]
