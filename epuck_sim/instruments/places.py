"""Where robots and agents are: which part of the floor they cover, and how densely."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.instruments.population import positions_at, sides_cm

MOST_CELLS = 10**6
"""Most cells of a map."""


class _Map:
    """What both measures of places share: how many were in each cell, at all cycles together."""

    def __init__(self, simulation: Any, *, cells: int = 10) -> None:
        self._simulation = simulation
        self._shape = (cells,) * len(sides_cm(simulation))
        if cells ** len(self._shape) > MOST_CELLS:
            raise ValueError(f"cells is {cells}, along each of {len(self._shape)} axes; allowed: {MOST_CELLS} in all")
        self._cell_cm = np.array(sides_cm(simulation)) / cells
        self._counts: IntArray = np.zeros(cells ** len(self._shape), np.int64)

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        """Raise ValueError for a map without cells."""
        if not 1 <= parameters.cells <= MOST_CELLS:
            raise ValueError(f"cells is {parameters.cells}; allowed: 1 to {MOST_CELLS}")

    def cycle(self, event: Any, _: Any) -> None:
        """Count who is in which cell; those on an edge belong to the cell beyond it, or to the last."""
        places = positions_at(self._simulation, event) // self._cell_cm
        axes = np.clip(places, 0, self._shape[0] - 1).astype(np.int64)
        cells = np.ravel_multi_index(tuple(axes.T[::-1]), self._shape)  # x runs fastest
        self._counts += np.bincount(cells, minlength=len(self._counts))


class Coverage(_Map):
    """Share of the cells, `cells` along each axis, in which the centre of a robot or agent was at a cycle."""

    def value(self) -> float | None:
        """Return the share; None without a cycle."""
        return float((self._counts > 0).mean()) if self._counts.any() else None


class Density(_Map):
    """Share of all positions at cycles in each cell: a series of cells, row by row; x runs fastest, then y."""

    def value(self) -> list[float]:
        """Return the shares; none without a cycle."""
        total = int(self._counts.sum())
        return [float(share) for share in self._counts / total] if total else []
