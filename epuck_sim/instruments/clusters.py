"""Clusters of phases: oscillators that fire in groups before all fire as one."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.instruments.population import phases_at


def cluster_sizes(phases: FloatArray, gap: float) -> IntArray:
    """Return the sizes of the clusters of phases on the circle, in no order.

    Neighbours on the circle belong to one cluster if they are no more than `gap` apart (single linkage).

    Args:
        phases: (n,) phases in cycles.
        gap: Largest distance between neighbours in a cluster, in cycles.

    >>> sorted(cluster_sizes(np.array([0.0, 0.99, 0.5]), 0.02).tolist())
    [1, 2]
    """
    if not len(phases):
        return np.zeros(0, np.int64)
    ordered = np.sort(phases % 1.0)
    gaps = np.diff(ordered, append=ordered[0] + 1.0)
    ends = np.flatnonzero(gaps > gap)
    if not len(ends):
        return np.array([len(phases)])
    sizes = np.diff(ends, prepend=ends[-1] - len(phases))
    return np.asarray(sizes, np.int64)


class _Clusters:
    """What both measures of clusters share: the sizes at each cycle."""

    def __init__(self, simulation: Any, *, gap: float = 0.02) -> None:
        self._simulation = simulation
        self._gap = gap
        self._sizes: list[IntArray] = []

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        """Raise ValueError for a gap that no cluster has."""
        if not 0 <= parameters.gap < 0.5:
            raise ValueError(f"gap is {parameters.gap:g}; allowed: 0 up to 0.5, in cycles")

    def cycle(self, event: Any, _: Any) -> None:
        """Take note of the sizes of the clusters."""
        self._sizes.append(cluster_sizes(phases_at(self._simulation, event), self._gap))


class ClusterCount(_Clusters):
    """Number of phase clusters at each cycle: neighbours at most `gap` cycles apart are in one (series)."""

    def value(self) -> list[int]:
        """Return the series."""
        return [len(sizes) for sizes in self._sizes]


class LargestCluster(_Clusters):
    """Share of the oscillators that is in the largest phase cluster at each cycle (series)."""

    def value(self) -> list[float | None]:
        """Return the series; None where there are no oscillators."""
        return [float(sizes.max() / sizes.sum()) if len(sizes) else None for sizes in self._sizes]
