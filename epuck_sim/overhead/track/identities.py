"""Finds out which flashes are of the same robot, in a film in which robots are dark between their flashes.

Every flash has at most one that follows and one that it follows. Of all ways to link the flashes of some periods, the
likeliest is taken (`scipy.optimize.linear_sum_assignment`); then what is usual is learnt from it, and they are linked
again. How much less likely the best way without a link is tells how sure that link is.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.track.flash_motion import (
    LONGEST,
    MISSED,
    SHORTEST,
    FlashTable,
    Habits,
    Ways,
    ways_between,
)

ROUNDS = 5
"""Number of times that flashes are linked, each time by what was learnt before."""

BLOCK_PERIODS = 8.0
"""Length of a part of the film whose flashes are linked at once."""

SURE = 0.95
"""Certainty of a link from which it counts as sure."""


class Identities(NamedTuple):
    """Whose flashes are whose."""

    robot: IntArray
    """(flashes,) number of the robot, from 0, in order of their first flashes."""
    cycle: IntArray
    """(flashes,) which of its own flashes this is, from 1."""
    certainty: FloatArray
    """(flashes,) probability that the link to the robot's flash before is right, against the best alternative; NaN for
    a robot's first flash."""
    speed_cm_s: float
    """Speed of a robot that drives straight ahead."""

    @property
    def robots(self) -> int:
        """Number of robots; one that was lost and found again counts twice."""
        return int(self.robot.max(initial=-1)) + 1

    @property
    def unsure(self) -> float:
        """Share of the links whose best alternative is nearly as good."""
        links = self.certainty[~np.isnan(self.certainty)]
        return float(np.mean(links < SURE)) if len(links) else 0.0


def link_flashes(flashes: FlashTable, period_s: float, floor_cm: tuple[float, float]) -> Identities:
    """Return the identities of flashes, which are in order of their onsets.

    Args:
        flashes: The flashes of a film.
        period_s: Period of the oscillators.
        floor_cm: Width and height, along y, of the floor.
    """
    if not len(flashes.onset_s):
        none = np.empty(0, np.int64)
        return Identities(none, none, np.empty(0), 0.0)
    habits = Habits.at_first(flashes, period_s, floor_cm)
    candidates = _candidates(flashes, habits)
    ways = ways_between(flashes, *candidates, habits)
    for _ in range(ROUNDS):
        costs = _Costs(flashes, habits, candidates, -habits.log_likelihood(ways))
        links = _link(flashes.onset_s, costs, BLOCK_PERIODS * period_s)
        is_linked = links[candidates[0]] == candidates[1]
        if not is_linked.any():
            break
        habits = habits.relearnt(Ways(*(column[is_linked] for column in ways)))
    certainty = _certainties(links, costs, flashes.onset_s, period_s)
    return Identities(*_number(links), certainty, habits.speed_cm_s)


def _candidates(flashes: FlashTable, habits: Habits) -> tuple[IntArray, IntArray]:
    """Return the pairs of flashes that a robot may have made one after the other, as their speed and times allow."""
    onset_s, period_s = flashes.onset_s, habits.period_s
    first = np.searchsorted(onset_s, onset_s + SHORTEST * period_s)
    end = np.searchsorted(onset_s, onset_s + 2 * LONGEST * period_s)
    source = np.repeat(np.arange(len(first)), end - first)
    target = np.arange(len(source)) + np.repeat(end - np.cumsum(end - first), end - first)
    return source, target


class _Costs:
    """Costs of links, relative to no link.

    They are negative where a link is likelier than the end of one robot's flashes and the beginning of another's.
    """

    def __init__(
        self, flashes: FlashTable, habits: Habits, candidates: tuple[IntArray, IntArray], costs: FloatArray
    ) -> None:
        number = len(flashes.onset_s)
        area = math.tau * habits.floor_cm[0] * habits.floor_cm[1]
        since = (flashes.onset_s - flashes.onset_s[0]) / habits.period_s
        until = (flashes.onset_s[-1] - flashes.onset_s) / habits.period_s
        begin, end = (np.log(np.clip(1.0 - share, MISSED / 4, 1.0)) for share in (since, until))
        source, target = candidates
        gain = costs + begin[target] - math.log(area) + end[source]
        self._first = np.searchsorted(source, np.arange(number + 1))
        self._target, self._gain = target, gain

    def of(self, sources: IntArray) -> tuple[IntArray, FloatArray]:
        """Return (m,) the targets of some sources, ascending, and (sources, m) costs, 0 at most."""
        spans = [slice(self._first[source], self._first[source + 1]) for source in sources]
        targets = np.unique(np.concatenate([self._target[span] for span in spans]))
        costs = np.zeros((len(sources), len(targets)))
        for row, span in enumerate(spans):
            costs[row, np.searchsorted(targets, self._target[span])] = np.minimum(self._gain[span], 0.0)
        return targets, costs


def _link(onset_s: FloatArray, costs: _Costs, block_s: float) -> IntArray:
    """Return (flashes,) the flash that follows each, or -1; blocks overlap, so that their ends do not matter."""
    links = np.full(len(onset_s), -1)
    begin = 0
    while begin < len(onset_s):
        end, half = (int(np.searchsorted(onset_s, onset_s[begin] + part * block_s)) for part in (1.0, 0.5))
        keep = half if end < len(onset_s) else end
        targets, table = costs.of(np.arange(begin, end))
        table[:, np.isin(targets, links[:begin])] = 0.0
        links[begin:keep] = _best(targets, table)[: keep - begin]
        begin = keep
    return links


def _best(targets: IntArray, costs: FloatArray) -> IntArray:
    """Return (sources,) the targets of the cheapest links from each source, -1 for none."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 takes a while to load

    links = np.full(len(costs), -1)
    rows, columns = linear_sum_assignment(costs)
    is_link = costs[rows, columns] < 0
    links[rows[is_link]] = targets[columns[is_link]]
    return links


def _certainties(links: IntArray, costs: _Costs, onset_s: FloatArray, period_s: float) -> FloatArray:
    """Return (flashes,) the certainty of the link to each flash from the one before; NaN where there is none.

    Each link is forbidden in turn, and the flashes of the periods around it are linked anew.
    """
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 takes a while to load

    certainty = np.full(len(links), np.nan)
    linked = np.flatnonzero(links >= 0)
    before = np.full(len(links), -1)
    before[links[linked]] = linked
    for source in linked:
        first, end = np.searchsorted(onset_s, onset_s[source] + period_s * np.array([-1.0, 1.0]))
        targets, table = costs.of(np.arange(first, end))
        elsewhere = (before[targets] >= 0) & ((before[targets] < first) | (before[targets] >= end))
        table[:, elsewhere] = 0.0
        rows = np.flatnonzero(links[first:end] >= 0)
        columns = np.searchsorted(targets, links[first:end][rows])
        best = table[rows, columns].sum()
        table[source - first, np.searchsorted(targets, links[source])] = 0.0
        margin = max(float(table[linear_sum_assignment(table)].sum() - best), 0.0)
        certainty[links[source]] = 1 / (1 + math.exp(-margin))
    return certainty


def _number(links: IntArray) -> tuple[IntArray, IntArray]:
    """Return (flashes,) numbers of the robots, in order of their first flashes, and of their own flashes, from 1."""
    robot, cycle = np.full(len(links), -1), np.ones(len(links), np.int64)
    robots = 0
    for source, target in enumerate(links):
        if robot[source] < 0:
            robot[source] = robots
            robots += 1
        if target >= 0:
            robot[target], cycle[target] = robot[source], cycle[source] + 1
    return robot, cycle
