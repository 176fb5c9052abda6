"""How far robots and agents move, how long they keep their direction, and how often they are near walls."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.measures.common import ABOVE_0, Series, Share, Shipped, allowed, share, up_to
from epuck_sim.scenario.embodied import largest_cm
from epuck_sim.util.jit import jit


def check_walls(scenario: Any, _: Any) -> None:
    """Raise ValueError for a space without walls."""
    if scenario.model == "particles" and scenario.space.boundary == "cyclic":
        raise ValueError("this measure needs walls; a cyclic space has none, and distances begin anew at its edge")


class MeanSquaredDisplacement(Series):
    """Mean squared distance, in cm^2, from the places at the first firing of the reference, at each cycle (series)."""

    UNIT = "cm²"
    check_scenario = staticmethod(check_walls)
    _start: FloatArray | None = None

    def batch(self, batch: Any, _: Any) -> None:
        if self._start is None:
            self._start = batch.positions[0].copy()
        self._series += ((batch.positions - self._start) ** 2).sum(axis=2).mean(axis=1).tolist()


@dataclass
class NearWalls(Share):
    """Mean share of robots or agents whose centres are at most `within_cm` from an outer wall, over the cycles."""

    within_cm: float = 5.0
    check, check_scenario = staticmethod(allowed(within_cm=ABOVE_0)), staticmethod(check_walls)

    def batch(self, batch: Any, _: Any) -> None:
        distances = np.minimum(batch.positions, batch.sides_cm - batch.positions).min(axis=2)
        self._part += int(np.count_nonzero(distances <= self.within_cm))
        self._whole += distances.size


class _Moves(Shipped):
    """Base class of two measures: how far robots move from step to step, and from stretch to stretch."""

    _place: FloatArray | None = None

    def moves(self, stretch: Any) -> FloatArray:
        """Return (steps, robots, 2) cm: moves in the steps of the next stretch, but the trial's first step."""
        before, places = self._place, stretch.poses[:, :, :2]
        self._place = places[-1:].copy()
        return np.diff(places, axis=0, prepend=places[:0] if before is None else before)


class MeanSpeed(_Moves):
    """Mean speed over the floor in cm/s, of all robots and steps (robots)."""

    UNIT = "cm/s"
    MODELS = ("embodied",)
    _way_cm, _steps = 0.0, 0

    def stretch(self, stretch: Any, _: Any) -> None:
        moves = self.moves(stretch)
        for way_cm in np.sqrt((moves**2).sum(axis=2)).mean(axis=1).tolist():
            self._way_cm += way_cm
        self._steps += len(moves)

    def value(self) -> float | None:
        """Return the mean; None before the second step."""
        return share(self._way_cm, self._steps * (1 / self.simulation.scenario.timing.control_hz))


@dataclass
class VelocityCorrelationTime(_Moves):
    """Time in s after which the autocorrelation of velocities has fallen to 1 / e of its value at lag 0.

    Velocities of robots are those from step to step, and velocities of agents those at cycles. The autocorrelation is a
    mean over all of them and over time; it is interpolated between two lags.
    """

    lags: int = 100
    check = staticmethod(allowed(lags=up_to(100_000)))
    UNIT = "s"
    MODELS = ("embodied", "particles")

    def __post_init__(self) -> None:
        self._last: FloatArray = np.zeros((0, 0))  # (lags, n d) velocities that later ones will be multiplied by
        self._sums, self._velocities = np.zeros(self.lags + 1), 0
        self._first_s = self._last_s = 0.0

    def stretch(self, stretch: Any, _: Any) -> None:
        self.take(self.moves(stretch))

    def batch(self, batch: Any, _: Any) -> None:
        if not self.has_bodies:
            self._first_s = self._first_s if self._velocities else batch.time_s[0]
            self._last_s = batch.time_s[-1]
            self.take(batch.velocities)

    def take(self, velocities: FloatArray) -> None:
        """Add the products of (k, n, d) velocities with those up to `lags` before, by lag."""
        columns = velocities.shape[1] * velocities.shape[2]
        known = np.concatenate([each.reshape(-1, columns) for each in (self._last, velocities)])
        add_products(self._sums, known, len(self._last))
        self._velocities += len(velocities)
        self._last = known[-self.lags :]

    def value(self) -> float | None:
        """Return the time; None if nobody moves, or if the correlation does not fall so far within the lags."""
        terms = np.arange(self._velocities, max(self._velocities - len(self._sums), 0), -1)  # added at each lag
        cycle_s = (self._last_s - self._first_s) / max(self._velocities - 1, 1)  # pulses shorten cycles
        interval_s = self.simulation.step_s if self.has_bodies else float(cycle_s)
        return correlation_time(self._sums[: len(terms)] / terms, interval_s)


@jit
def add_products(sums: FloatArray, known: FloatArray, first: int) -> None:
    """Add products of (k, n) velocities, from row `first` on, with those up to then to `sums`, by lag.

    They are added one by one: products of matrices have other last digits where more rows are multiplied at once.
    """
    for at in range(first, len(known)):
        for lag in range(min(at + 1, len(sums))):
            product = 0.0
            for column in range(known.shape[1]):
                product += known[at, column] * known[at - lag, column]
            sums[lag] += product


def correlation_time(correlation: FloatArray, interval_s: float) -> float | None:
    """Return when a correlation, (lags,) from lag 0, falls to 1 / e of its first value, in s; None if it never does.

    >>> correlation_time(np.array([4.0, 2.0, 1.0]), 0.1)
    0.15284822353142308
    """
    if not len(correlation) or correlation[0] <= 0:
        return None
    relative = correlation / correlation[0]
    (below,) = np.nonzero(relative <= 1 / math.e)
    if not len(below):
        return None
    lag = int(below[0])
    return float(interval_s * (lag - 1 + (relative[lag - 1] - 1 / math.e) / (relative[lag - 1] - relative[lag])))


MOST_CELLS = 10**6  # most cells of a map


@dataclass
class _Map(Shipped):
    """Base class of two measures: the number of robots or agents in each cell, summed over all cycles."""

    cells: int = 10
    check = staticmethod(allowed(cells=up_to(MOST_CELLS)))

    def __post_init__(self) -> None:
        scenario = self.simulation.scenario
        sides_cm = largest_cm(scenario) if self.has_bodies else (scenario.space.side_cm,) * scenario.space.dimensions
        self._cell_cm = np.array(sides_cm) / self.cells
        self._counts: IntArray = np.zeros((self.cells,) * len(sides_cm), np.int64)

    @staticmethod
    def check_scenario(scenario: Any, parameters: SimpleNamespace) -> None:
        axes = scenario.space.dimensions if scenario.model == "particles" else 2
        if parameters.cells**axes > MOST_CELLS:
            raise ValueError(f"cells is {parameters.cells}, along each of {axes} axes; allowed: {MOST_CELLS} in all")

    def batch(self, batch: Any, _: Any) -> None:
        """Count positions in each cell; one on an edge belongs to the cell beyond it, or to the last."""
        places = batch.positions.reshape(-1, len(self._cell_cm)) // self._cell_cm
        x_first = np.clip(places, 0, self.cells - 1).astype(np.int64).T
        np.add.at(self._counts, tuple(x_first[::-1]), 1)  # x runs fastest


class Coverage(_Map):
    """Share of the cells, `cells` along each axis, in which the centre of a robot or agent was at a cycle."""

    def value(self) -> float | None:
        """Return the share; None without a cycle."""
        return float((self._counts > 0).mean()) if self._counts.any() else None


class Density(_Map):
    """Share of all positions at cycles in each cell: a series of cells, row by row; x runs fastest, then y."""

    OVER = "cell"

    def value(self) -> list[float]:
        """Return the shares; none without a cycle."""
        total = int(self._counts.sum())
        return [float(part) for part in self._counts.ravel() / total] if total else []


class Moved(Shipped):
    """Mean distance in cm that a movable moves in an hour, measured straight from cycle to cycle (robots)."""

    UNIT = "cm/h"
    MODELS = ("embodied",)
    _places: FloatArray | None = None
    _begin_s, _last_s, _path_cm = 0.0, 0.0, 0.0

    @staticmethod
    def check_scenario(scenario: Any, _: Any) -> None:
        if not scenario.arena.movables:
            raise ValueError("moved needs arena.movables; the arena has none")

    def cycle(self, step: Any, _: Any) -> None:
        places = step.movables
        if self._places is None:
            self._begin_s = step.time_s
        else:
            self._path_cm += float(np.sqrt(((places - self._places) ** 2).sum(axis=1)).mean())
        self._places, self._last_s = places, step.time_s

    def value(self) -> float | None:
        """Return the distance; None without two cycles."""
        return share(3600 * self._path_cm, self._last_s - self._begin_s)


class Avoiding(Share):
    """Share of time in which a robot turns: its wheels are commanded different speeds (robots).

    With the shipped motion algorithm (Appendix B), which otherwise drives straight on, this is the time in avoidance.
    """

    MODELS = ("embodied",)

    def stretch(self, stretch: Any, _: Any) -> None:
        left, right = stretch.wheels_cm_s[..., 0], stretch.wheels_cm_s[..., 1]
        self._part += int(np.count_nonzero(left != right))
        self._whole += left.size


class InContact(Share):
    """Share of time in which a robot touches another, a wall or an obstacle (robots)."""

    MODELS = ("embodied",)

    def stretch(self, stretch: Any, _: Any) -> None:
        step, robot, other = stretch.contacts.T
        touching = np.zeros(stretch.poses.shape[:2], np.bool_)
        touching[step, robot] = True
        touching[step[other >= 0], other[other >= 0]] = True
        self._part += int(np.count_nonzero(touching))
        self._whole += touching.size
