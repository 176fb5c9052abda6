"""Who receives from whom, as a graph at each cycle, and how it changes (thesis chapter 5).

Of agents, links are those of the instant of the reference's firing: from each agent to those that would receive its
pulse then (5.1.3). Of robots, they are those of the whole cycle: from each robot to those whose cameras saw its ring
lit in one of the cycle's steps. A link is one number: the sender times the population, plus the receiver.
"""

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.measures.common import Series, allowed, one_of


class Links(Series):
    """What all measures of links share: the links of each cycle."""

    MODELS = ("embodied", "particles")

    def __init__(self, simulation: Any) -> None:
        super().__init__(simulation)
        self._population = int(simulation.scenario.population)
        self._has_bodies = simulation.scenario.model == "embodied"
        self._seen: list[IntArray] = []
        if not self._has_bodies:
            simulation.neighbour_links()  # compiles what finds them before any clock runs

    def stretch(self, stretch: Any, _: Any) -> None:
        _, looks, lit = stretch.sightings.T
        if len(looks):
            self._seen.append(np.unique(lit * self._population + looks))

    def cycle(self, _: Any, __: Any) -> None:
        if self._has_bodies:
            found = np.unique(np.concatenate([np.zeros(0, np.int64), *self._seen]))
            self._seen.clear()
        else:
            found = self._simulation.neighbour_links()
        self.take(found)

    def take(self, links: IntArray) -> None:
        raise NotImplementedError


def common_count(one: IntArray, other: IntArray) -> int:
    """Return how many numbers two sets, each of distinct numbers, have in common.

    >>> common_count(np.array([1, 2]), np.array([2, 3]))
    1
    """
    both = np.concatenate((one, other))
    both.sort()
    return int(np.count_nonzero(both[1:] == both[:-1]))


def changed_share(before: IntArray, after: IntArray) -> float | None:
    """Return 1 - |A and B| / |A or B| of two sets of distinct numbers; None if both are empty.

    >>> changed_share(np.array([1, 2]), np.array([2, 3]))
    0.6666666666666667
    """
    common = common_count(before, after)
    either = len(before) + len(after) - common
    return 1 - common / either if either else None


class NeighbourChange(Links):
    """Share of links that changed since the last cycle: 1 - |A and B| / |A or B| (series)."""

    def __init__(self, simulation: Any) -> None:
        super().__init__(simulation)
        self._before: IntArray | None = None

    def take(self, links: IntArray) -> None:
        self._series.append(None if self._before is None else changed_share(self._before, links))
        self._before = links


class LinkLife(Links):
    """Mean number of successive cycles in which a link is there: links at risk over links that end."""

    UNIT = "cycles"

    def __init__(self, simulation: Any) -> None:
        super().__init__(simulation)
        self._before: IntArray | None = None
        self._at_risk, self._ended = 0, 0

    def take(self, links: IntArray) -> None:
        if self._before is not None:
            self._at_risk += len(self._before)
            self._ended += len(self._before) - common_count(self._before, links)
        self._before = links

    def value(self) -> float | None:
        """Return the mean; None if no link has ended."""
        return self._at_risk / self._ended if self._ended else None


DIRECTIONS = ("in", "out", "both")
CONNECTIONS = ("weak", "strong")
STATISTICS: dict[str, Callable[[IntArray], Any]] = {
    "mean": np.mean,
    "smallest": np.min,
    "largest": np.max,
    "sd": np.std,
}


def degrees(links: IntArray, population: int, direction: str) -> IntArray:
    """Return (population,) number of links of each: to it (`in`), from it (`out`), or both."""
    senders, receivers = np.divmod(links, population)
    ends = {"in": [receivers], "out": [senders], "both": [senders, receivers]}[direction]
    return np.bincount(np.concatenate(ends), minlength=population)


def component_sizes(links: IntArray, population: int, connection: str) -> IntArray:
    """Return the sizes of the components of the graph with these links, in no order.

    Args:
        links: (links,) numbers of links.
        population: Number of robots or agents.
        connection: `weak`: as if links led both ways; `strong`: each reaches each along links.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    ends = np.divmod(links, population)
    graph = csr_array((np.ones(len(links), np.int8), ends), shape=(population, population))
    _, component = connected_components(graph, directed=True, connection=connection)
    return np.bincount(component)


class Degree(Links):
    """Number of links of each robot or agent at each cycle: mean, smallest, largest or sd over all (series)."""

    def __init__(self, simulation: Any, *, direction: str = "in", statistic: str = "mean") -> None:
        super().__init__(simulation)
        self._direction = direction
        self._reduce = STATISTICS[statistic]

    check = staticmethod(allowed(direction=one_of(DIRECTIONS), statistic=one_of(STATISTICS)))

    def take(self, links: IntArray) -> None:
        self._series.append(float(self._reduce(degrees(links, self._population, self._direction))))


class Isolated(Links):
    """Share of robots or agents without a link at each cycle: `in`, that none reaches, `out`, or `both` (series)."""

    def __init__(self, simulation: Any, *, direction: str = "in") -> None:
        super().__init__(simulation)
        self._direction = direction

    check = staticmethod(allowed(direction=one_of(DIRECTIONS)))

    def take(self, links: IntArray) -> None:
        self._series.append(float((degrees(links, self._population, self._direction) == 0).mean()))


class _Components(Links):
    """What both measures of components share; their values are None before `cycles` cycles have passed."""

    def __init__(self, simulation: Any, *, connection: str = "weak", cycles: int = 1) -> None:
        super().__init__(simulation)
        self._connection = connection
        self._last: deque[IntArray] = deque(maxlen=cycles)

    check = staticmethod(allowed(connection=one_of(CONNECTIONS), cycles=(lambda cycles: cycles >= 1, "1 and above")))

    def take(self, links: IntArray) -> None:
        self._last.append(links)
        if len(self._last) < (self._last.maxlen or 1):
            self._series.append(None)
            return
        together = links if len(self._last) == 1 else np.unique(np.concatenate(self._last))
        self._series.append(self.of_sizes(component_sizes(together, self._population, self._connection)))

    def of_sizes(self, sizes: IntArray) -> float:
        """Return the value of a cycle from the sizes of its components."""
        raise NotImplementedError


class ComponentCount(_Components):
    """Number of weak or strong components of the links of the last `cycles` cycles, at each cycle (series)."""

    def of_sizes(self, sizes: IntArray) -> int:
        return len(sizes)


class LargestComponent(_Components):
    """Share of robots or agents in the largest of these components at each cycle (series)."""

    def of_sizes(self, sizes: IntArray) -> float:
        return float(sizes.max() / sizes.sum())


class SpanningTime(Links):
    """Cycles until the links since the first cycle connect all, as one weak or strong component."""

    UNIT = "cycles"

    def __init__(self, simulation: Any, *, connection: str = "strong") -> None:
        super().__init__(simulation)
        self._connection = connection
        self._together = np.zeros(0, np.int64)
        self._cycles = 0
        self._spanning: int | None = None

    check = staticmethod(allowed(connection=one_of(CONNECTIONS)))

    def take(self, links: IntArray) -> None:
        self._cycles += 1
        if self._spanning is None:
            self._together = np.union1d(self._together, links)
            if len(component_sizes(self._together, self._population, self._connection)) == 1:
                self._spanning = self._cycles

    def value(self) -> int | None:
        """Return the number of cycles; None if the trial ends before."""
        return self._spanning
