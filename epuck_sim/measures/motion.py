"""How far robots and agents get, how long they keep their way, and how often they are near walls."""

import math
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.measures.common import Series, Share, allowed, positions_at, sides_at, sides_cm, up_to


class MeanSquaredDisplacement(Series):
    """Mean squared distance, in cm^2, from the places at the first firing of the reference, at each cycle (series)."""

    UNIT = "cm²"

    def __init__(self, simulation: Any) -> None:
        scenario = simulation.scenario
        if hasattr(scenario, "space") and scenario.space.boundary == "cyclic":
            raise ValueError(
                "mean_squared_displacement needs walls; in a cyclic space, distances begin anew at its edge"
            )
        super().__init__(simulation)
        self._start: FloatArray | None = None

    def cycle(self, event: Any, _: Any) -> None:
        positions = positions_at(self._simulation, event)
        if self._start is None:
            self._start = positions
        self._series.append(float(((positions - self._start) ** 2).sum(axis=1).mean()))


class NearWalls(Share):
    """Mean share of robots or agents whose centres are at most `within_cm` from an outer wall, over the cycles."""

    def __init__(self, simulation: Any, *, within_cm: float = 5.0) -> None:
        super().__init__(simulation)
        self._within_cm = within_cm

    check = staticmethod(allowed(within_cm=(lambda within_cm: within_cm > 0, "above 0")))

    def cycle(self, event: Any, _: Any) -> None:
        positions = positions_at(self._simulation, event)
        distances = np.minimum(positions, sides_at(self._simulation, event) - positions).min(axis=1)
        self._part += int(np.count_nonzero(distances <= self._within_cm))
        self._whole += len(positions)


class MeanSpeed:
    """Mean speed over the floor in cm/s, of all robots and steps (robots)."""

    UNIT = "cm/s"
    MODELS = ("embodied",)

    def __init__(self, simulation: Any) -> None:
        self._step_s = 1 / simulation.scenario.timing.control_hz
        self._before: FloatArray | None = None
        self._way_cm, self._steps = 0.0, 0

    def stretch(self, stretch: Any, _: Any) -> None:
        places = stretch.poses[:, :, :2]
        moved = np.diff(places, axis=0, prepend=places[:1] if self._before is None else self._before)
        ways = np.sqrt((moved**2).sum(axis=2)).mean(axis=1)[self._before is None :]
        for way in ways.tolist():
            self._way_cm += way
        self._steps += len(ways)
        self._before = places[-1:].copy()

    def value(self) -> float | None:
        """Return the mean; None before the second step."""
        return self._way_cm / (self._steps * self._step_s) if self._steps else None


class VelocityCorrelationTime:
    """Time in s after which the autocorrelation of velocities has fallen to 1 / e of that at once.

    Velocities are those from step to step of robots, and those at cycles of agents. The autocorrelation, a mean over
    all and over time, is interpolated between two lags.
    """

    UNIT = "s"
    MODELS = ("embodied", "particles")

    def __init__(self, simulation: Any, *, lags: int = 100) -> None:
        self._simulation = simulation
        self._has_bodies = simulation.scenario.model == "embodied"
        self._interval_s = simulation.step_s if self._has_bodies else simulation.scenario.clocks.period_s
        self._last: FloatArray = np.zeros((0, 0))  # (lags, n d) velocities, of which products are still to come
        self._sums, self._terms = np.zeros(lags + 1), np.zeros(lags + 1)
        self._place: FloatArray | None = None

    check = staticmethod(allowed(lags=up_to(100_000)))

    def stretch(self, stretch: Any, _: Any) -> None:
        places = stretch.poses[:, :, :2]
        before = places[:1] if self._place is None else self._place
        self._add(np.diff(places, axis=0, prepend=before)[self._place is None :])
        self._place = places[-1:].copy()

    def cycle(self, _: Any, __: Any) -> None:
        if not self._has_bodies:
            self._add((self._simulation.headings() * self._simulation.speeds_cm_s[:, None])[None])

    def _add(self, velocities: FloatArray) -> None:
        """Add the products of these velocities, (k, n, d), of later ones, and of the last ones before them."""
        if not len(velocities):
            return
        lags = len(self._sums) - 1
        latest = velocities.reshape(len(velocities), -1)
        known = np.concatenate([self._last, latest]) if len(self._last) else latest
        products = known @ known[len(known) - len(velocities) :].T
        for place in range(len(velocities)):
            at = len(known) - len(velocities) + place
            first = max(0, at - lags)
            self._sums[: at - first + 1] += products[first : at + 1, place][::-1]
            self._terms[: at - first + 1] += 1
        self._last = known[-lags:]

    def value(self) -> float | None:
        """Return the time; None if nobody moves, or if the correlation does not fall so far within the lags."""
        return correlation_time(self._sums[self._terms > 0] / self._terms[self._terms > 0], self._interval_s)


def correlation_time(correlation: FloatArray, interval_s: float) -> float | None:
    """Return when a correlation falls to 1 / e of its first value; None if it never does.

    Args:
        correlation: (lags,) from lag 0 on.
        interval_s: Time from one lag to the next.

    >>> correlation_time(np.array([4.0, 2.0, 1.0]), 0.1)
    0.15284822353142308
    """
    if not len(correlation) or correlation[0] <= 0:
        return None
    share = correlation / correlation[0]
    (below,) = np.nonzero(share <= 1 / math.e)
    if not len(below):
        return None
    lag = int(below[0])
    return float(interval_s * (lag - 1 + (share[lag - 1] - 1 / math.e) / (share[lag - 1] - share[lag])))


MOST_CELLS = 10**6
"""Most cells of a map."""


class _Map:
    """What both measures of places share: how many were in each cell, at all cycles together."""

    def __init__(self, simulation: Any, *, cells: int = 10) -> None:
        self._simulation = simulation
        self._shape = (cells,) * len(sides_cm(simulation))
        if cells ** len(self._shape) > MOST_CELLS:
            raise ValueError(f"cells is {cells}, along each of {len(self._shape)} axes; allowed: {MOST_CELLS} in all")
        self._cell_cm = np.array(sides_cm(simulation)) / cells
        self._counts: IntArray = np.zeros(cells ** len(self._shape), np.int64)

    check = staticmethod(allowed(cells=up_to(MOST_CELLS)))

    def cycle(self, event: Any, _: Any) -> None:
        """Count who is in which cell; those on an edge belong to the cell beyond it, or to the last."""
        places = positions_at(self._simulation, event) // self._cell_cm
        axes = np.clip(places, 0, self._shape[0] - 1).astype(np.int64)
        cells = np.ravel_multi_index(tuple(axes.T[::-1]), self._shape)  # x runs fastest
        self._counts += np.bincount(cells, minlength=len(self._counts))


class Coverage(_Map):
    """Share of the cells, `cells` along each axis, in which the centre of a robot or agent was at a cycle."""

    def value(self) -> float | None:
        """Return the share; None without a cycle."""
        return float((self._counts > 0).mean()) if self._counts.any() else None


class Density(_Map):
    """Share of all positions at cycles in each cell: a series of cells, row by row; x runs fastest, then y."""

    def value(self) -> list[float]:
        """Return the shares; none without a cycle."""
        total = int(self._counts.sum())
        return [float(share) for share in self._counts / total] if total else []


SECONDS_PER_HOUR = 3600


class Moved:
    """Distance in cm that a movable moves in an hour, straight from cycle to cycle; a mean over movables (robots)."""

    UNIT = "cm/h"
    MODELS = ("embodied",)

    def __init__(self, simulation: Any) -> None:  # noqa: ARG002 every measure takes the simulation
        self._places: FloatArray | None = None
        self._begin_s = self._last_s = 0.0
        self._path_cm = 0.0

    @staticmethod
    def check_scenario(scenario: Any, _: Any) -> None:
        """Raise ValueError if there is nothing to move."""
        if not scenario.arena.movables:
            raise ValueError("moved needs arena.movables; the arena has none")

    def cycle(self, step: Any, _: Any) -> None:
        places = step.movables.copy()
        if self._places is None:
            self._begin_s = step.time_s
        else:
            self._path_cm += float(np.sqrt(((places - self._places) ** 2).sum(axis=1)).mean())
        self._places, self._last_s = places, step.time_s

    def value(self) -> float | None:
        """Return the distance; None without two cycles."""
        seconds = self._last_s - self._begin_s
        return SECONDS_PER_HOUR * self._path_cm / seconds if seconds > 0 else None


class Avoiding(Share):
    """Share of time in which a robot turns: its wheels are commanded different speeds (robots).

    With the shipped motion algorithm (Appendix B), which drives straight ahead else, this is the time in avoidance.
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
