"""How far robots and agents get, how long they keep their way, and how often they are near walls."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.instruments.population import positions_at, sides_at


class MeanSquaredDisplacement:
    """Mean squared distance, in cm^2, from the places at the first firing of the reference, at each cycle (series)."""

    def __init__(self, simulation: Any) -> None:
        scenario = simulation.scenario
        if hasattr(scenario, "space") and scenario.space.boundary == "cyclic":
            raise ValueError(
                "mean_squared_displacement needs walls; in a cyclic space, distances begin anew at its edge"
            )
        self._simulation = simulation
        self._start: FloatArray | None = None
        self._series: list[float] = []

    def cycle(self, event: Any, _: Any) -> None:
        """Take note of how far all have come."""
        positions = positions_at(self._simulation, event)
        if self._start is None:
            self._start = positions
        self._series.append(float(((positions - self._start) ** 2).sum(axis=1).mean()))

    def value(self) -> list[float]:
        """Return the series."""
        return self._series


class NearWalls:
    """Mean share of robots or agents whose centres are at most `within_cm` from an outer wall, over the cycles."""

    def __init__(self, simulation: Any, *, within_cm: float = 5.0) -> None:
        self._simulation = simulation
        self._within_cm = within_cm
        self._near, self._seen = 0, 0

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        """Raise ValueError for a distance that is none."""
        if parameters.within_cm <= 0:
            raise ValueError(f"within_cm is {parameters.within_cm:g}; allowed: above 0")

    def cycle(self, event: Any, _: Any) -> None:
        """Count who is near a wall."""
        positions = positions_at(self._simulation, event)
        distances = np.minimum(positions, sides_at(self._simulation, event) - positions).min(axis=1)
        self._near += int(np.count_nonzero(distances <= self._within_cm))
        self._seen += len(positions)

    def value(self) -> float | None:
        """Return the share; None without a cycle."""
        return self._near / self._seen if self._seen else None


class MeanSpeed:
    """Mean speed over the floor in cm/s, of all robots and steps (robots)."""

    MODELS = ("embodied",)

    def __init__(self, simulation: Any) -> None:
        self._step_s = 1 / simulation.scenario.timing.control_hz
        self._before: FloatArray | None = None
        self._way_cm, self._steps = 0.0, 0

    def stretch(self, stretch: Any, _: Any) -> None:
        """Add how far robots have come since the last step."""
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

    MODELS = ("embodied", "particles")

    def __init__(self, simulation: Any, *, lags: int = 100) -> None:
        self._simulation = simulation
        self._has_bodies = simulation.scenario.model == "embodied"
        self._interval_s = simulation.step_s if self._has_bodies else simulation.scenario.clocks.period_s
        self._last: FloatArray = np.zeros((0, 0))  # (lags, n d) velocities, of which products are still to come
        self._sums, self._terms = np.zeros(lags + 1), np.zeros(lags + 1)
        self._place: FloatArray | None = None

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        """Raise ValueError without a lag."""
        if not 1 <= parameters.lags <= 100_000:
            raise ValueError(f"lags is {parameters.lags}; allowed: 1 to 100000")

    def stretch(self, stretch: Any, _: Any) -> None:
        """Take note of how far robots have moved in each step."""
        places = stretch.poses[:, :, :2]
        before = places[:1] if self._place is None else self._place
        self._add(np.diff(places, axis=0, prepend=before)[self._place is None :])
        self._place = places[-1:].copy()

    def cycle(self, _: Any, __: Any) -> None:
        """Take note of the velocities of agents."""
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
