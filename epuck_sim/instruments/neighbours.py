"""How fast neighbours change, which decides whether motion helps synchronisation (thesis chapter 5)."""

from typing import Any

import numpy as np

from epuck_sim.arrays import IntArray


class NeighbourChange:
    """Share of neighbour links that changed since the last cycle: 1 - |A and B| / |A or B| (series; agents)."""

    MODELS = ("particles",)

    def __init__(self, simulation: Any) -> None:
        from epuck_sim.particles.neighbour_lists import NeighbourLists  # reading a scenario must not compile anything

        self._simulation = simulation
        self._neighbours = NeighbourLists(simulation.scenario)
        self._agents = range(simulation.scenario.agents.count)
        self._links: IntArray | None = None
        self._series: list[float | None] = []

    def cycle(self, _: Any, __: Any) -> None:
        """Compare who would receive whose pulse now with who would have at the last firing of the reference."""
        links = self._find_links()
        self._series.append(None if self._links is None else changed_share(self._links, links))
        self._links = links

    def _find_links(self) -> IntArray:
        """Return the links from senders to receivers, each as one number."""
        simulation, agents = self._simulation, len(self._agents)
        found = self._neighbours.receivers(simulation.positions(), simulation.headings(), self._agents)
        return np.concatenate([sender * agents + receivers.astype(np.int64) for sender, receivers in enumerate(found)])

    def value(self) -> list[float | None]:
        """Return the series; None at the first cycle, and where there are no links before and after."""
        return self._series


def changed_share(before: IntArray, after: IntArray) -> float | None:
    """Return 1 - |A and B| / |A or B| of two sets of distinct numbers; None if both are empty.

    >>> changed_share(np.array([1, 2]), np.array([2, 3]))
    0.6666666666666667
    """
    common = len(np.intersect1d(before, after, assume_unique=True))
    either = len(before) + len(after) - common
    return 1 - common / either if either else None
