"""Who receives from whom, as a graph at each cycle, and how it changes (thesis chapter 5).

Of agents, links are those of the instant of the reference's firing: from each agent to those that would receive its
pulse then (5.1.3). Of robots, they are those of the whole cycle: from each robot to those whose cameras saw its ring
lit in one of the cycle's steps. A link is one number: the sender times the population, plus the receiver.
"""

from typing import Any

import numpy as np

from epuck_sim.arrays import IntArray


class Links:
    """What all measures of links share: the links of each cycle."""

    MODELS = ("embodied", "particles")

    def __init__(self, simulation: Any) -> None:
        self._simulation = simulation
        self._population = int(simulation.scenario.population)
        self._has_bodies = simulation.scenario.model == "embodied"
        self._seen: list[IntArray] = []
        if not self._has_bodies:
            simulation.neighbour_links()  # compiles what finds them before any clock runs

    def stretch(self, stretch: Any, _: Any) -> None:
        """Take note of who sees whose ring lit."""
        _, looks, lit = stretch.sightings.T
        if len(looks):
            self._seen.append(np.unique(lit * self._population + looks))

    def cycle(self, _: Any, __: Any) -> None:
        """Take note of the links of the cycle."""
        if self._has_bodies:
            found = np.unique(np.concatenate([np.zeros(0, np.int64), *self._seen]))
            self._seen.clear()
        else:
            found = self._simulation.neighbour_links()
        self.take(found)

    def take(self, links: IntArray) -> None:
        """Measure the links of a cycle, (links,) ascending."""
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
        self._series: list[float | None] = []

    def take(self, links: IntArray) -> None:
        """Compare the links with those of the last cycle."""
        self._series.append(None if self._before is None else changed_share(self._before, links))
        self._before = links

    def value(self) -> list[float | None]:
        """Return the series; None at the first cycle, and where there are no links before and after."""
        return self._series


class LinkLife(Links):
    """Mean number of successive cycles in which a link is there: links at risk over links that end."""

    def __init__(self, simulation: Any) -> None:
        super().__init__(simulation)
        self._before: IntArray | None = None
        self._at_risk, self._ended = 0, 0

    def take(self, links: IntArray) -> None:
        """Count the links that were there at the last cycle, and those of them that are gone."""
        if self._before is not None:
            self._at_risk += len(self._before)
            self._ended += len(self._before) - common_count(self._before, links)
        self._before = links

    def value(self) -> float | None:
        """Return the mean; None if no link has ended."""
        return self._at_risk / self._ended if self._ended else None
