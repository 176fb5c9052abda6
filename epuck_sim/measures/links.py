"""Who receives from whom, as a graph at each cycle, and how it changes (thesis chapter 5).

Links of agents are those at the instant of the reference's firing: from each agent to those that would receive its
pulse then (5.1.3). Links of robots are those of the whole cycle: from each robot to those whose cameras saw its ring
lit in a step of the cycle. A link is stored as one number: the sender times the population, plus the receiver. The
links of a batch of cycles are ascending: each cycle adds the square of the population to those of the one before.
"""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.measures.common import Series, Share, Shipped, allowed, check_sight, one_of

NO_LINKS: IntArray = np.zeros(0, np.int64)
MOST_WAITING = 10_000  # largest number of cycles, times the population, that wait to be taken together


class Links(Shipped):
    """Base class of measures of links: the links of each cycle of several, and of some cycles before."""

    MODELS = ("embodied", "particles")
    check_scenario = staticmethod(check_sight)
    # records some cycles, so many, from their links, and negative ones: those of the cycles that are kept
    take: Callable[[IntArray, int], None]
    # number of cycles whose links are kept for the next ones, these links, and numbers of cycles taken and waiting
    _keeps, _before, _passed, _waiting = 0, NO_LINKS, 0, 0

    def __post_init__(self) -> None:
        self._population = int(self.simulation.scenario.population)
        self._square = self._population**2
        self._seen: list[IntArray] = [NO_LINKS]

    def stretch(self, stretch: Any, _: Any) -> None:
        _, looks, lit = stretch.sightings.T
        self._seen.append((self._waiting * self._population + lit) * self._population + looks)

    def batch(self, batch: Any, _: Any) -> None:
        if not self.has_bodies:
            self._seen.append(batch.links + self._waiting * self._square)
        self._waiting += len(batch.time_s)
        if self._waiting * self._population >= MOST_WAITING:
            self._take_waiting()

    def _take_waiting(self) -> None:
        """Take the cycles that are complete: for many of a small swarm numpy needs hardly longer than for one."""
        if not self._waiting:
            return
        links, cycles, self._waiting = np.concatenate(self._seen), self._waiting, 0
        end = cycles * self._square
        self._seen = [links[links >= end] - end]
        links = np.concatenate([self._before, np.unique(links[links < end]) if self.has_bodies else links])
        self.take(links, cycles)
        self._before = links[links >= end - self._keeps * self._square] - end
        self._passed += cycles

    def value(self) -> Any:
        self._take_waiting()
        return super().value()  # type: ignore[misc]

    def of_rows(self, links: IntArray, first: int, end: int) -> IntArray:
        """Return the links of some cycles, `first` up to `end`, together, as if they were of the first of a batch."""
        begin, last = np.searchsorted(links, [first * self._square, end * self._square])
        return np.unique(links[begin:last] % self._square)

    def compare(self, links: IntArray, cycles: int) -> tuple[IntArray, IntArray, IntArray]:
        """Return (cycles,) numbers of links of the cycle before, of this one, and of both; not for the first cycle."""
        both = np.intersect1d(links + self._square, links, assume_unique=True)
        had, kept = (np.bincount(each // self._square + 1, minlength=cycles + 1) for each in (links, both))
        first = 0 if self._passed else 1
        return had[first:-1], had[first + 1 :], kept[first + 1 :]


class NeighbourChange(Links, Series):
    """Share of links that changed since the last cycle: 1 - |A and B| / |A or B| (series)."""

    _keeps = 1

    def take(self, links: IntArray, cycles: int) -> None:
        if not self._passed:
            self._series.append(None)
        before, after, kept = self.compare(links, cycles)
        pairs = zip(kept.tolist(), (before + after - kept).tolist(), strict=True)
        self._series += [1 - both / either if either else None for both, either in pairs]


class LinkLife(Links, Share):
    """Mean number of successive cycles in which a link exists: links at risk over links that end."""

    UNIT = "cycles"
    _keeps = 1

    def take(self, links: IntArray, cycles: int) -> None:
        before, _, kept = self.compare(links, cycles)
        self._part += int(before.sum())
        self._whole += int((before - kept).sum())


DIRECTIONS = ("in", "out", "both")
CONNECTIONS = ("weak", "strong")
STATISTICS: dict[str, Callable[..., Any]] = {"mean": np.mean, "smallest": np.min, "largest": np.max, "sd": np.std}


def ends_of(links: IntArray, population: int) -> tuple[IntArray, IntArray]:
    """Return (links,) numbers of senders, and of receivers; a population's numbers follow those of the cycle before."""
    senders, receivers = np.divmod(links, population)
    return senders, senders - senders % population + receivers


def degrees(links: IntArray, population: int, direction: str, cycles: int = 1) -> IntArray:
    """Return (cycles, population) number of links of each: to it (`in`), from it (`out`), or both."""
    senders, receivers = ends_of(links, population)
    ends = {"in": receivers, "out": senders, "both": np.concatenate([senders, receivers])}[direction]
    return np.bincount(ends, minlength=cycles * population).reshape(cycles, population)


def component_sizes(links: IntArray, population: int, connection: str, cycles: int = 1) -> tuple[IntArray, IntArray]:
    """Return (components,) the sizes of the components of the graphs of cycles, and the cycle of each, from 0.

    Links are ascending. In a weak component they count as if they led both ways; in a strong one every member reaches
    all others.
    """
    component, cycle_of = find_components(*ends_of(links, population), population, cycles, connection)
    return np.bincount(component), cycle_of


def find_components(
    senders: IntArray, receivers: IntArray, population: int, graphs: int, connection: str
) -> tuple[IntArray, IntArray]:
    """Return (graphs * population,) the component of each node, and (components,) the graph of each; senders ascend."""
    from scipy.sparse import csr_array  # takes a fifth of a second, and few trials need it
    from scipy.sparse.csgraph import connected_components

    nodes = np.arange(graphs * population + 1)
    links = csr_array((np.ones(len(senders)), receivers, np.searchsorted(senders, nodes)), (len(nodes) - 1,) * 2)
    count, component = connected_components(links, connection=connection)
    graph_of = np.zeros(count, np.int64)
    graph_of[component] = nodes[:-1] // population
    return component, graph_of


@dataclass
class Degree(Links, Series):
    """Number of links of each robot or agent at each cycle: mean, smallest, largest or sd over all (series)."""

    direction: str = "in"
    statistic: str = "mean"
    check = staticmethod(allowed(direction=one_of(DIRECTIONS), statistic=one_of(STATISTICS)))

    def take(self, links: IntArray, cycles: int) -> None:
        of_each = degrees(links, self._population, self.direction, cycles)
        self._series += STATISTICS[self.statistic](of_each, axis=1).astype(float).tolist()


@dataclass
class Isolated(Links, Series):
    """Share of robots or agents without links at each cycle: to them (`in`), from them (`out`), or `both` (series)."""

    direction: str = "in"
    check = staticmethod(allowed(direction=one_of(DIRECTIONS)))

    def take(self, links: IntArray, cycles: int) -> None:
        self._series += (degrees(links, self._population, self.direction, cycles) == 0).mean(axis=1).tolist()


@dataclass
class _Components(Links, Series):
    """Base class of both measures of components, whose values are None before `cycles` cycles have passed."""

    # returns the list of values of some cycles, so many, from the sizes of components, and the cycle of each
    of_sizes: ClassVar[Callable[..., Any]]
    connection: str = "weak"
    cycles: int = 1
    check = staticmethod(allowed(connection=one_of(CONNECTIONS), cycles=(lambda cycles: cycles >= 1, "1 and above")))

    def __post_init__(self) -> None:
        super().__post_init__()
        self._keeps = self.cycles - 1

    def take(self, links: IntArray, cycles: int) -> None:
        if self.cycles > 1:
            spans = ((max(row - self._keeps, -self._passed), row + 1) for row in range(cycles))
            links = np.concatenate([self.of_rows(links, *span) + (span[1] - 1) * self._square for span in spans])
        known = self.of_sizes(*component_sizes(links, self._population, self.connection, cycles), cycles)
        unknown = min(max(self._keeps - self._passed, 0), cycles)
        self._series += [None] * unknown + known[unknown:]


class ComponentCount(_Components):
    """Number of weak or strong components of the links of the last `cycles` cycles, at each cycle (series)."""

    def of_sizes(self, _: IntArray, cycle_of: IntArray, cycles: int) -> Any:
        return np.bincount(cycle_of, minlength=cycles).tolist()


class LargestComponent(_Components):
    """Share of robots or agents in the largest component (see `component_count`) at each cycle (series)."""

    def of_sizes(self, sizes: IntArray, cycle_of: IntArray, cycles: int) -> Any:
        largest = np.zeros(cycles, np.int64)
        np.maximum.at(largest, cycle_of, sizes)
        return (largest / self._population).tolist()


@dataclass
class SpanningTime(Links):
    """Cycles until all links so far, taken together, join the swarm into one weak or strong component."""

    connection: str = "strong"
    check = staticmethod(allowed(connection=one_of(CONNECTIONS)))
    UNIT = "cycles"
    _cycles, _together = 0, NO_LINKS

    def take(self, links: IntArray, cycles: int) -> None:
        if self._cycles:
            return

        def is_joined(row: int) -> bool:
            together = np.union1d(self._together, self.of_rows(links, 0, row + 1))
            return len(component_sizes(together, self._population, self.connection)[0]) == 1

        row = bisect_left(range(cycles), True, key=is_joined)  # links only join more
        self._together = np.union1d(self._together, self.of_rows(links, 0, cycles))
        self._cycles = self._passed + row + 1 if row < cycles else 0

    def value(self) -> int | None:
        """Return the number of cycles; None if the trial ends before."""
        self._take_waiting()
        return self._cycles or None
