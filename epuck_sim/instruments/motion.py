"""How far robots and agents get, and how often they are near walls."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.instruments.population import positions_at, sides_cm


class MeanSquaredDisplacement:
    """Mean squared distance, in cm^2, from the places at the first firing of the reference, at each cycle (series)."""

    def __init__(self, simulation: Any) -> None:
        scenario = simulation.scenario
        if hasattr(scenario, "space") and scenario.space.boundary == "cyclic":
            raise ValueError(
                "mean_squared_displacement needs walls; in a cyclic space, distances begin anew at its edge"
            )
        self._simulation = simulation
        self._start: FloatArray | None = None
        self._series: list[float] = []

    def cycle(self, event: Any, _: Any) -> None:
        """Take note of how far all have come."""
        positions = positions_at(self._simulation, event)
        if self._start is None:
            self._start = positions
        self._series.append(float(((positions - self._start) ** 2).sum(axis=1).mean()))

    def value(self) -> list[float]:
        """Return the series."""
        return self._series


class NearWalls:
    """Mean share of robots or agents whose centres are at most `within_cm` from an outer wall, over the cycles."""

    def __init__(self, simulation: Any, *, within_cm: float = 5.0) -> None:
        self._simulation = simulation
        self._within_cm = within_cm
        self._sides = np.array(sides_cm(simulation))
        self._near, self._seen = 0, 0

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        """Raise ValueError for a distance that is none."""
        if parameters.within_cm <= 0:
            raise ValueError(f"within_cm is {parameters.within_cm:g}; allowed: above 0")

    def cycle(self, event: Any, _: Any) -> None:
        """Count who is near a wall."""
        positions = positions_at(self._simulation, event)
        distances = np.minimum(positions, self._sides - positions).min(axis=1)
        self._near += int(np.count_nonzero(distances <= self._within_cm))
        self._seen += len(positions)

    def value(self) -> float | None:
        """Return the share; None without a cycle."""
        return self._near / self._seen if self._seen else None
