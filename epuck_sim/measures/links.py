"""Who receives from whom, as a graph at each cycle, and how it changes (thesis chapter 5).

Links of agents are those at the instant of the reference's firing: from each agent to those that would receive its
pulse then (5.1.3). Links of robots are those of the whole cycle: from each robot to those whose cameras saw its ring
lit in a step of the cycle. A link is stored as one number: the sender times the population, plus the receiver.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.measures.common import Series, Share, Shipped, allowed, check_sight, one_of
from epuck_sim.util.jit import jit

NO_LINKS: IntArray = np.zeros(0, np.int64)


class Links(Shipped):
    """Base class of measures of links: the links of each cycle."""

    MODELS = ("embodied", "particles")
    check_scenario = staticmethod(check_sight)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._population = int(self.simulation.scenario.population)
        self._seen: list[IntArray] = [NO_LINKS]
        if not self.has_bodies:
            self.simulation.neighbour_links()  # compiles the kernel before any clock runs

    def stretch(self, stretch: Any, _: Any) -> None:
        _, looks, lit = stretch.sightings.T
        self._seen.append(lit * self._population + looks)

    def cycle(self, _: Any, __: Any) -> None:
        if self.has_bodies:
            self.take(np.unique(np.concatenate(self._seen)))
            self._seen = [NO_LINKS]
        else:
            self.take(self.simulation.neighbour_links())

    def take(self, links: IntArray) -> None:
        raise NotImplementedError


class NeighbourChange(Links, Series):
    """Share of links that changed since the last cycle: 1 - |A and B| / |A or B| (series)."""

    _before: IntArray | None = None

    def take(self, links: IntArray) -> None:
        change = None
        if self._before is not None and len(self._before) + len(links):
            common = len(np.intersect1d(self._before, links, assume_unique=True))
            change = 1 - common / (len(self._before) + len(links) - common)
        self._series.append(change)
        self._before = links


class LinkLife(Links, Share):
    """Mean number of successive cycles in which a link exists: links at risk over links that end."""

    UNIT = "cycles"
    _before: IntArray | None = None

    def take(self, links: IntArray) -> None:
        if self._before is not None:
            self._part += len(self._before)
            self._whole += len(self._before) - len(np.intersect1d(self._before, links, assume_unique=True))
        self._before = links


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
    """Return the sizes, in no order, of the components of the graph with these links, which must be ascending.

    In a weak component links count as if they led both ways; in a strong one every member reaches all others.
    """
    if connection == "weak":
        senders, receivers = np.divmod(links, population)
        links = np.sort(np.concatenate((links, receivers * population + senders)))
    begins = np.searchsorted(links, np.arange(population + 1) * population)
    return strong_component_sizes(begins, links % population)


@jit
def strong_component_sizes(begins: IntArray, receivers: IntArray) -> IntArray:
    """Return the sizes of the strong components, which Tarjan's search finds (SIAM J. Comput. 1, 146, 1972).

    Links of node i are those from `begins[i]` up to `begins[i + 1]`; `receivers` holds the node to which each leads.
    """
    population = len(begins) - 1
    following = begins.copy()  # the next link of each node to follow
    rank = np.zeros(population, np.int64)  # order in which nodes were met, from 1; 0: not yet
    lowest = np.zeros(population, np.int64)  # lowest rank that each is known to reach; 0: its component is complete
    path, waiting, sizes = np.zeros((3, population), np.int64)  # waiting: those met whose component is not complete
    met = on_path = number = count = 0
    for root in range(population):
        node = root
        while rank[root] == 0 or on_path > 0:
            if rank[node] == 0:
                met += 1
                rank[node] = lowest[node] = met
                path[on_path], waiting[number] = node, node
                on_path, number = on_path + 1, number + 1
            node = path[on_path - 1]
            if following[node] < begins[node + 1]:
                receiver = receivers[following[node]]
                following[node] += 1
                if rank[receiver] == 0:
                    node = receiver
                elif lowest[receiver] > 0:
                    lowest[node] = min(lowest[node], rank[receiver])
                continue
            on_path -= 1
            if lowest[node] < rank[node]:
                before = path[on_path - 1]
                lowest[before] = min(lowest[before], lowest[node])
            else:
                while lowest[node] > 0:
                    number -= 1
                    lowest[waiting[number]] = 0
                    sizes[count] += 1
                count += 1
    return sizes[:count]


@dataclass
class Degree(Links, Series):
    """Number of links of each robot or agent at each cycle: mean, smallest, largest or sd over all (series)."""

    direction: str = "in"
    statistic: str = "mean"
    check = staticmethod(allowed(direction=one_of(DIRECTIONS), statistic=one_of(STATISTICS)))

    def take(self, links: IntArray) -> None:
        self._series.append(float(STATISTICS[self.statistic](degrees(links, self._population, self.direction))))


@dataclass
class Isolated(Links, Series):
    """Share of robots or agents without links at each cycle: to them (`in`), from them (`out`), or `both` (series)."""

    direction: str = "in"
    check = staticmethod(allowed(direction=one_of(DIRECTIONS)))

    def take(self, links: IntArray) -> None:
        self._series.append(float((degrees(links, self._population, self.direction) == 0).mean()))


@dataclass
class _Components(Links, Series):
    """Base class of both measures of components, whose values are None before `cycles` cycles have passed."""

    connection: str = "weak"
    cycles: int = 1
    check = staticmethod(allowed(connection=one_of(CONNECTIONS), cycles=(lambda cycles: cycles >= 1, "1 and above")))

    def __post_init__(self) -> None:
        super().__post_init__()
        self._last: deque[IntArray] = deque(maxlen=self.cycles)

    def take(self, links: IntArray) -> None:
        self._last.append(links)
        value = None
        if len(self._last) == self.cycles:
            together = links if self.cycles == 1 else np.unique(np.concatenate(self._last))
            value = self.of_sizes(component_sizes(together, self._population, self.connection))
        self._series.append(value)

    def of_sizes(self, sizes: IntArray) -> float:
        """Return the value of a cycle from the sizes of its components."""
        raise NotImplementedError


class ComponentCount(_Components):
    """Number of weak or strong components of the links of the last `cycles` cycles, at each cycle (series)."""

    def of_sizes(self, sizes: IntArray) -> int:
        return len(sizes)


class LargestComponent(_Components):
    """Share of robots or agents in the largest component (see `component_count`) at each cycle (series)."""

    def of_sizes(self, sizes: IntArray) -> float:
        return float(sizes.max() / sizes.sum())


@dataclass
class SpanningTime(Links):
    """Cycles until all links so far, taken together, join the swarm into one weak or strong component."""

    connection: str = "strong"
    check = staticmethod(allowed(connection=one_of(CONNECTIONS)))
    UNIT = "cycles"
    _cycles, _spans, _together = 0, False, NO_LINKS

    def take(self, links: IntArray) -> None:
        if not self._spans:
            self._cycles += 1
            self._together = np.union1d(self._together, links)
            self._spans = len(component_sizes(self._together, self._population, self.connection)) == 1

    def value(self) -> int | None:
        """Return the number of cycles; None if the trial ends before."""
        return self._cycles if self._spans else None
