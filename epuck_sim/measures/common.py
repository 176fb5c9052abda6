"""What shipped measures share: series, shares, allowed parameters, and phases and positions whatever the model."""

from collections.abc import Callable, Collection
from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.scenario.embodied import largest_cm


class Series:
    """A measure with a value for each cycle, which its method `cycle` appends."""

    def __init__(self, simulation: Any) -> None:
        self._simulation = simulation
        self._series: list[Any] = []

    def value(self) -> Any:
        return self._series


class Share:
    """A measure that counts a part and a whole."""

    def __init__(self, simulation: Any) -> None:
        self._simulation = simulation
        self._part, self._whole = 0, 0

    def value(self) -> float | None:
        """Return the part's share of the whole; None where there is no whole."""
        return self._part / self._whole if self._whole else None


Rule = tuple[Callable[[Any], bool], str]
"""Whether a parameter is allowed, and what is."""

BELOW_HALF_A_CYCLE: Rule = (lambda cycles: 0 <= cycles < 0.5, "0 up to 0.5, in cycles")


def one_of(choices: Collection[str]) -> Rule:
    """Return the rule of a parameter that is one of some words."""
    return choices.__contains__, ", ".join(choices)


def up_to(most: int) -> Rule:
    """Return the rule of a whole number from 1 to a limit."""
    return lambda number: 1 <= number <= most, f"1 to {most}"


def allowed(**rules: Rule) -> Callable[[SimpleNamespace], None]:
    """Return a measure's `check`, which raises ValueError for a parameter against its rule."""

    def check(parameters: SimpleNamespace) -> None:
        for name, (is_allowed, words) in rules.items():
            value = getattr(parameters, name)
            if not is_allowed(value):
                shown = f"{value:g}" if isinstance(value, float) else repr(value)
                raise ValueError(f"{name} is {shown}; allowed: {words}")

    return check


def phases_at(simulation: Any, event: Any) -> FloatArray:
    """Return (oscillators,) phases from 0 to 1; of robots, those that are oscillators."""
    if not hasattr(event, "phase_ms"):
        phases: FloatArray = simulation.phases()
        return phases
    periods = simulation.period_ms
    is_oscillator = ~np.isnan(periods)
    return np.asarray(event.phase_ms[is_oscillator] / periods[is_oscillator])


def positions_at(simulation: Any, event: Any) -> FloatArray:
    """Return (population, dimensions) cm: a copy of the positions."""
    positions: FloatArray = event.poses[:, :2].copy() if hasattr(event, "poses") else simulation.positions()
    return positions


def sides_at(simulation: Any, event: Any) -> tuple[float, ...]:
    """Return the side of the arena or space along each dimension at an event."""
    return (event.arena.width_cm, event.arena.height_cm) if hasattr(event, "arena") else sides_cm(simulation)


def sides_cm(simulation: Any) -> tuple[float, ...]:
    """Return the side of the arena, at its largest, or space along each dimension."""
    scenario = simulation.scenario
    if hasattr(scenario, "arena"):
        return largest_cm(scenario)
    return (float(scenario.space.side_cm),) * int(scenario.space.dimensions)
