"""How synchronised a swarm is from cycle to cycle."""

from typing import Any


class OrderParameter:
    """Order parameter at each firing of the reference: `stop.metric`, eq. 4.2, 5.7 or 3.4 (series)."""

    def __init__(self, simulation: Any) -> None:  # noqa: ARG002 every measure takes the simulation
        self._series: list[float | None] = []

    def cycle(self, _: Any, state: Any) -> None:
        """Take note of the order parameter, which the trial has measured; None of robots without oscillators."""
        self._series.append(state.order_parameter)

    def value(self) -> list[float | None]:
        """Return the series."""
        return self._series
