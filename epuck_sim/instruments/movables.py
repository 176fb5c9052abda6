"""How far the movables of an arena are moved."""

from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray

SECONDS_PER_HOUR = 3600


class Moved:
    """Distance in cm that a movable moves in an hour, straight from cycle to cycle; a mean over movables (robots)."""

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
        """Take note of how far movables have come since the last cycle."""
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
