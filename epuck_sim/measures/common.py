"""What shipped measures share: a series over cycles, choices, and phases and positions whatever the model."""

from collections.abc import Callable, Iterable
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


def one_of(**choices: Iterable[str]) -> Callable[[SimpleNamespace], None]:
    """Return a measure's `check`, which raises ValueError for a parameter that is none of its choices."""

    def check(parameters: SimpleNamespace) -> None:
        for name, allowed in choices.items():
            if getattr(parameters, name) not in allowed:
                raise ValueError(f"{name} is {getattr(parameters, name)!r}; allowed: {', '.join(allowed)}")

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
