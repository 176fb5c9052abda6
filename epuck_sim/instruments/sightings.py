"""How often robots see flashes."""

from typing import Any

import numpy as np


class FlashesSeen:
    """Mean number of flashes that a robot sees in a cycle; one seen for several steps counts once (robots)."""

    MODELS = ("embodied",)

    def __init__(self, simulation: Any) -> None:
        robots = len(simulation.period_ms)
        self._is_seen = np.zeros(robots, np.bool_)
        self._count = 0
        self._cycles = 0

    def step(self, step: Any, state: Any) -> None:
        """Count the robots that see a flash and saw none in the step before."""
        is_seen = step.flash_seen
        self._count += int(np.count_nonzero(is_seen & ~self._is_seen))
        self._is_seen = is_seen
        self._cycles = state.cycles

    def value(self) -> float | None:
        """Return the mean; None without a cycle."""
        return self._count / (len(self._is_seen) * self._cycles) if self._cycles else None
