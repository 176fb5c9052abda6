"""Clusters of phases: oscillators that fire in groups before all fire as one."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.measures.common import BELOW_HALF_A_CYCLE, Series, Share, Shipped, allowed, share


def cluster_numbers(phases: FloatArray, gap: float) -> IntArray:
    """Return (n,) the number, from 0, of the cluster of phases on the circle to which each belongs.

    Neighbours on the circle belong to one cluster if they are no more than `gap` apart (single linkage).

    Args:
        phases: (n,) phases in cycles.
        gap: Largest distance between neighbours in a cluster, in cycles.

    >>> cluster_numbers(np.array([0.0, 0.99, 0.5]), 0.02).tolist()
    [0, 0, 1]
    """
    if not len(phases):
        return np.zeros(0, np.int64)
    order = np.argsort(phases % 1.0, kind="stable")
    ordered = phases[order] % 1.0
    is_end = np.diff(ordered, append=ordered[0] + 1.0) > gap
    numbers = np.empty(len(phases), np.int64)
    # a cluster that goes on across phase 0 ends with the first of the circle's ends
    numbers[order] = (np.cumsum(is_end) - is_end) % max(int(is_end.sum()), 1)
    return numbers


@dataclass
class _Clusters(Shipped):
    """What all measures of clusters share: who is in which at each cycle."""

    gap: float = 0.02
    check = staticmethod(allowed(gap=BELOW_HALF_A_CYCLE))

    def cycle(self, event: Any, _: Any) -> None:
        self.take(cluster_numbers(self.phases(event), self.gap))

    def take(self, numbers: IntArray) -> None:
        raise NotImplementedError


class ClusterCount(_Clusters, Series):
    """Number of phase clusters at each cycle: neighbours at most `gap` cycles apart are in one (series)."""

    def take(self, numbers: IntArray) -> None:
        self._series.append(int(numbers.max(initial=-1)) + 1)


class LargestCluster(_Clusters, Series):
    """Share of the oscillators that is in the largest phase cluster at each cycle (series)."""

    def take(self, numbers: IntArray) -> None:
        largest = np.bincount(numbers).max(initial=0)
        self._series.append(share(int(largest), len(numbers)))  # None without oscillators


class ClusterLife(_Clusters, Share):
    """Mean life of phase clusters of two or more, in cycles: clusters at risk over clusters that end.

    A cluster lives on if, at the next cycle, one has more than half of all that are in either of the two.
    """

    UNIT = "cycles"
    _before: IntArray | None = None

    def take(self, numbers: IntArray) -> None:
        if self._before is not None and len(numbers):
            lived, gone = surviving_clusters(self._before, numbers)
            self._part += lived + gone
            self._whole += gone
        self._before = numbers


def surviving_clusters(before: IntArray, after: IntArray) -> tuple[int, int]:
    """Return how many clusters of two or more live on, and how many do not; see `ClusterLife`.

    Args:
        before: (n,) number of the cluster to which each belongs.
        after: (n,) the same later.
    """
    common = np.zeros((before.max() + 1, after.max() + 1), np.int64)
    np.add.at(common, (before, after), 1)
    sizes, later_sizes = common.sum(axis=1), common.sum(axis=0)
    either = sizes[:, None] + later_sizes - common
    lives_on = (2 * common > either).any(axis=1)[sizes >= 2]
    return int(np.count_nonzero(lives_on)), int(np.count_nonzero(~lives_on))
