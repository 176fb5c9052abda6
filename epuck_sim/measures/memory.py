"""A field of a controller's MEMORY, by name."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.step import check_field, memory_values
from epuck_sim.measures.common import Series, allowed, one_of, share


@dataclass
class Memory(Series):
    """A field `name` of a controller's MEMORY: `take` its final value, its mean over cycles, or its series (robots).

    The value is that of one `robot`, or, if `robot` is -1, the mean over all whose controllers have this field.
    """

    name: str = "phase_ms"
    robot: int = -1
    take: str = "final"
    check = staticmethod(allowed(take=one_of(("final", "mean", "series"))))
    MODELS = ("embodied",)

    @staticmethod
    def check_scenario(scenario: Any, parameters: SimpleNamespace) -> None:
        if not -1 <= parameters.robot < scenario.population:
            raise ValueError(f"robot is {parameters.robot}; allowed: 0 to {scenario.population - 1}, or -1 for all")
        check_field(scenario, parameters.name, None if parameters.robot < 0 else parameters.robot)

    def cycle(self, step: Any, _: Any) -> None:
        values: FloatArray = memory_values(step.memories, self.name)
        chosen = values[~np.isnan(values)] if self.robot < 0 else values[[self.robot]]
        self._series.append(float(chosen.mean()) if len(chosen) else None)

    def value(self) -> float | list[float | None] | None:
        """Return the final value, the mean or the series; None without a cycle."""
        if self.take == "series":
            return self._series
        known = [each for each in self._series if each is not None]
        if self.take == "final":
            return known[-1] if known else None
        return share(sum(known), len(known))
