"""How synchronised a swarm is from cycle to cycle: order parameter, thresholds that it passes, clusters of phases."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.measures.common import ABOVE_0, BELOW_HALF_A_CYCLE, Series, Share, Shipped, allowed, share
from epuck_sim.order_parameter import METRICS, from_reference
from epuck_sim.scenario.base import check_range
from epuck_sim.scenario.robots import members


class OrderParameter(Series):
    """Order parameter at each firing of the reference: `stop.metric`, eq. 4.2, 5.7 or 3.4 (series)."""

    def batch(self, batch: Any, _: Any) -> None:
        """Record the order parameters that the trial has measured; NaN where the reference is no oscillator."""
        self._series += batch.order_parameter.tolist()


@dataclass
class GroupOrder(Series):
    """Order parameter of the robots of one `group` at each firing of the reference: `stop.metric` (series)."""

    group: int = 0
    MODELS = ("embodied",)

    @staticmethod
    def check_scenario(scenario: Any, parameters: SimpleNamespace) -> None:
        check_range("group", parameters.group, 0, len(scenario.robots) - 1)

    def __post_init__(self) -> None:
        self._robots = [robots for *_, robots in members(self.simulation.scenario.robots)][self.group]

    def cycle(self, step: Any, _: Any) -> None:
        """Record the order parameter; None where no robot of the group has a phase."""
        stop, phases, periods = self.simulation.scenario.stop, step.phase_ms, self.simulation.period_ms
        if stop.metric == "reference":
            phases = from_reference(phases, periods, stop.reference_robot)
        known = [robot for robot in self._robots if not np.isnan(phases[robot])]
        self._series.append(float(METRICS[stop.metric](phases[known], periods[known])) if known else None)


def read_thresholds(text: str) -> list[float]:
    """Return the numbers in a text, split at blanks or commas; raise ValueError if there are none, or one is not valid.

    >>> read_thresholds("0.5, 0.95")
    [0.5, 0.95]
    """
    numbers = [float(word) for word in text.replace(",", " ").split()]
    if not numbers or not all(0 < number <= 1 for number in numbers):
        raise ValueError(f"thresholds is {text!r}; allowed: numbers above 0 and up to 1, such as '0.5 0.9 0.95'")
    return numbers


@dataclass
class ThresholdCycles(Shipped):
    """Cycle at which the order parameter first reached each of the `thresholds` (a series, one for each of them)."""

    thresholds: str = "0.5 0.8 0.9 0.95 0.99"
    UNIT, OVER = "cycles", "threshold"

    def __post_init__(self) -> None:
        self._cycles: dict[float, int | None] = dict.fromkeys(read_thresholds(self.thresholds))

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        read_thresholds(parameters.thresholds)

    def batch(self, batch: Any, _: Any) -> None:
        for threshold, cycle in self._cycles.items():
            if cycle is None and (is_reached := batch.order_parameter >= threshold).any():
                self._cycles[threshold] = batch.first + int(is_reached.argmax())

    def value(self) -> list[int | None]:
        """Return the cycles; None for thresholds that were not reached."""
        return [self._cycles[threshold] for threshold in read_thresholds(self.thresholds)]


@dataclass
class BelowThreshold(Share):
    """Share of cycles with an order parameter below `threshold`, among those after it was reached `from_cycle` on."""

    threshold: float = 0.95
    from_cycle: int = 1
    _rule = (lambda threshold: 0 < threshold <= 1, "above 0 and up to 1")
    check = staticmethod(allowed(threshold=_rule, from_cycle=ABOVE_0))
    _is_reached = False

    def batch(self, batch: Any, _: Any) -> None:
        order = batch.order_parameter[max(self.from_cycle - batch.first, 0) :]
        known = order[~np.isnan(order)]
        if not self._is_reached:
            reached = np.flatnonzero(known >= self.threshold)
            self._is_reached = len(reached) > 0
            known = known[reached[0] + 1 :] if self._is_reached else known[:0]
        self._whole += len(known)
        self._part += int(np.count_nonzero(known < self.threshold))


class StaysAbove(BelowThreshold):
    """Whether the order parameter is never below `threshold` again after it was at it, `from_cycle` or later."""

    def value(self) -> bool | None:
        """Return whether it is; None if the threshold was not reached, or at the last cycle only."""
        return not self._part if self._whole else None


def cluster_numbers(phases: FloatArray, gap: float) -> IntArray:
    """Return (..., n) the number, from 0, of the cluster to which each of (..., n) phases in cycles belongs.

    Neighbours on the circle belong to one cluster if they are no more than `gap` cycles apart (single linkage).

    >>> cluster_numbers(np.array([0.0, 0.99, 0.5]), 0.02).tolist()
    [0, 0, 1]
    """
    numbers, angles = np.zeros(phases.shape, np.int64), phases % 1.0
    if numbers.size:
        order = angles.argsort(axis=-1, kind="stable")
        order += np.arange(0, order.size, order.shape[-1]).reshape(*order.shape[:-1], 1)  # in all phases, row by row
        ordered = angles.take(order)
        is_end = np.concatenate([ordered[..., 1:], ordered[..., :1] + 1.0], axis=-1) - ordered > gap
        ends = is_end.cumsum(axis=-1)
        # phases after the last end belong to the first cluster, across phase 0
        numbers.put(order, (ends - is_end) % np.maximum(ends[..., -1:], 1))
    return numbers


@dataclass
class _Clusters(Shipped):
    gap: float = 0.02
    check = staticmethod(allowed(gap=BELOW_HALF_A_CYCLE))


class ClusterCount(_Clusters, Series):
    """Number of phase clusters at each cycle: neighbours at most `gap` cycles apart are in one (series)."""

    def batch(self, batch: Any, _: Any) -> None:
        last = cluster_numbers(batch.phases, self.gap).max(axis=1, initial=-1)
        self._series += [count or None for count in (last + 1).tolist()]  # without oscillators there are no clusters


class LargestCluster(_Clusters, Series):
    """Share of the oscillators that is in the largest phase cluster at each cycle (series)."""

    def batch(self, batch: Any, _: Any) -> None:
        numbers = cluster_numbers(batch.phases, self.gap)
        cycles, oscillators = numbers.shape
        every = numbers + oscillators * np.arange(cycles)[:, None]
        sizes = np.bincount(every.ravel(), minlength=every.size).reshape(cycles, -1)
        self._series += [share(size, oscillators) for size in sizes.max(axis=1, initial=0).tolist()]


class ClusterLife(_Clusters, Share):
    """Mean life of phase clusters of two or more, in cycles: clusters at risk over clusters that end.

    A cluster lives on if it and a cluster of the next cycle have in common more than half of all their members.
    """

    UNIT = "cycles"
    _before: IntArray | None = None

    def batch(self, batch: Any, _: Any) -> None:
        numbers = cluster_numbers(batch.phases, self.gap)
        if self._before is not None:
            numbers = np.concatenate([self._before, numbers])
        lived, gone = surviving_clusters(numbers[:-1], numbers[1:])
        self._part += lived + gone
        self._whole += gone
        self._before = numbers[-1:]


def surviving_clusters(before: IntArray, after: IntArray) -> tuple[int, int]:
    """Return how many clusters of two or more live on, and how many do not (see `ClusterLife`).

    `before` and `after` are (cycles, n) the cluster numbers of the same oscillators at cycles, and at the next ones.
    """
    cycles, clusters = len(before), max(before.max(initial=-1), after.max(initial=-1)) + 1
    pairs = (np.arange(cycles)[:, None] * clusters + before) * clusters + after
    common = np.bincount(pairs.ravel(), minlength=cycles * clusters**2).reshape(cycles, clusters, clusters)
    sizes, later_sizes = common.sum(axis=2), common.sum(axis=1)
    either = sizes[:, :, None] + later_sizes[:, None] - common
    lives_on = (2 * common > either).any(axis=2)[sizes >= 2]
    return int(np.count_nonzero(lives_on)), int(np.count_nonzero(~lives_on))
