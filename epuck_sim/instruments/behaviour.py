"""What robots do with their time: whether they avoid, and whether they touch something."""

from typing import Any

import numpy as np


class Avoiding:
    """Share of time in which a robot turns: its wheels are commanded different speeds (robots).

    With the shipped motion algorithm (Appendix B), which drives straight ahead else, this is the time in avoidance.
    """

    MODELS = ("embodied",)

    def __init__(self, simulation: Any) -> None:  # noqa: ARG002 every measure takes the simulation
        self._turning, self._seen = 0, 0

    def stretch(self, stretch: Any, _: Any) -> None:
        """Count the robots that turn."""
        left, right = stretch.wheels_cm_s[..., 0], stretch.wheels_cm_s[..., 1]
        self._turning += int(np.count_nonzero(left != right))
        self._seen += left.size

    def value(self) -> float | None:
        """Return the share; None without a step."""
        return self._turning / self._seen if self._seen else None


class InContact:
    """Share of time in which a robot touches another, a wall or an obstacle (robots)."""

    MODELS = ("embodied",)

    def __init__(self, simulation: Any) -> None:
        self._robots = len(simulation.period_ms)
        self._touching, self._steps = 0, 0

    def stretch(self, stretch: Any, _: Any) -> None:
        """Count the robots that touch something."""
        step, robot, other = stretch.contacts.T
        touching = np.zeros((len(stretch.poses), self._robots), np.bool_)
        touching[step, robot] = True
        touching[step[other >= 0], other[other >= 0]] = True
        self._touching += int(np.count_nonzero(touching))
        self._steps += len(touching)

    def value(self) -> float | None:
        """Return the share; None without a step."""
        return self._touching / (self._robots * self._steps) if self._steps else None
