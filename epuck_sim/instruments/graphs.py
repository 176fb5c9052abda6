"""Degrees and components of the graph of links (see `links`), of one cycle or of several together."""

from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.instruments.links import Links

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


def check_choice(parameters: SimpleNamespace, name: str, allowed: tuple[str, ...]) -> None:
    """Raise ValueError if a parameter is none of those allowed."""
    given = getattr(parameters, name)
    if given not in allowed:
        raise ValueError(f"{name} is {given!r}; allowed: {', '.join(allowed)}")


class Degree(Links):
    """Number of links of each robot or agent at each cycle: mean, smallest, largest or sd over all (series)."""

    def __init__(self, simulation: Any, *, direction: str = "in", statistic: str = "mean") -> None:
        super().__init__(simulation)
        self._direction = direction
        self._reduce = STATISTICS[statistic]
        self._series: list[float] = []

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        """Raise ValueError for a direction or a statistic that there is not."""
        check_choice(parameters, "direction", DIRECTIONS)
        check_choice(parameters, "statistic", tuple(STATISTICS))

    def take(self, links: IntArray) -> None:
        """Take note of the degrees."""
        self._series.append(float(self._reduce(degrees(links, self._population, self._direction))))

    def value(self) -> list[float]:
        """Return the series."""
        return self._series


class Isolated(Links):
    """Share of robots or agents without a link at each cycle: `in`, that none reaches, `out`, or `both` (series)."""

    def __init__(self, simulation: Any, *, direction: str = "in") -> None:
        super().__init__(simulation)
        self._direction = direction
        self._series: list[float] = []

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        """Raise ValueError for a direction that there is not."""
        check_choice(parameters, "direction", DIRECTIONS)

    def take(self, links: IntArray) -> None:
        """Count those without a link."""
        self._series.append(float((degrees(links, self._population, self._direction) == 0).mean()))

    def value(self) -> list[float]:
        """Return the series."""
        return self._series


class _Components(Links):
    """What both measures of components share: the sizes at each cycle."""

    def __init__(self, simulation: Any, *, connection: str = "weak", cycles: int = 1) -> None:
        super().__init__(simulation)
        self._connection = connection
        self._last: deque[IntArray] = deque(maxlen=cycles)
        self._sizes: list[IntArray | None] = []

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        """Raise ValueError for a connection that there is not, or fewer cycles than 1."""
        check_choice(parameters, "connection", CONNECTIONS)
        if parameters.cycles < 1:
            raise ValueError(f"cycles is {parameters.cycles}; allowed: 1 and above")

    def take(self, links: IntArray) -> None:
        """Find the components of the links of the last cycles together."""
        self._last.append(links)
        if len(self._last) < (self._last.maxlen or 1):
            self._sizes.append(None)
            return
        together = links if len(self._last) == 1 else np.unique(np.concatenate(self._last))
        self._sizes.append(component_sizes(together, self._population, self._connection))


class ComponentCount(_Components):
    """Number of weak or strong components of the links of the last `cycles` cycles, at each cycle (series)."""

    def value(self) -> list[int | None]:
        """Return the series; None before so many cycles have passed."""
        return [None if sizes is None else len(sizes) for sizes in self._sizes]


class LargestComponent(_Components):
    """Share of robots or agents in the largest of these components at each cycle (series)."""

    def value(self) -> list[float | None]:
        """Return the series; None before so many cycles have passed."""
        return [None if sizes is None else float(sizes.max() / sizes.sum()) for sizes in self._sizes]


class SpanningTime(Links):
    """Cycles until the links since the first cycle connect all, as one weak or strong component."""

    def __init__(self, simulation: Any, *, connection: str = "strong") -> None:
        super().__init__(simulation)
        self._connection = connection
        self._together = np.zeros(0, np.int64)
        self._cycles = 0
        self._spanning: int | None = None

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        """Raise ValueError for a connection that there is not."""
        check_choice(parameters, "connection", CONNECTIONS)

    def take(self, links: IntArray) -> None:
        """Add the links of a cycle, until they connect all."""
        self._cycles += 1
        if self._spanning is None:
            self._together = np.union1d(self._together, links)
            if len(component_sizes(self._together, self._population, self._connection)) == 1:
                self._spanning = self._cycles

    def value(self) -> int | None:
        """Return the number of cycles; None if the trial ends before."""
        return self._spanning
