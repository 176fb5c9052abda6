"""How synchronised a swarm is from cycle to cycle, when it passes thresholds, and whether it stays above them."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from epuck_sim.measures.common import Series, Share, Shipped, allowed


class OrderParameter(Series):
    """Order parameter at each firing of the reference: `stop.metric`, eq. 4.2, 5.7 or 3.4 (series)."""

    def cycle(self, _: Any, state: Any) -> None:
        """Take note of the order parameter, which the trial has measured; None of robots without oscillators."""
        self._series.append(state.order_parameter)


def read_thresholds(text: str) -> list[float]:
    """Return the numbers in a text, parted by blanks or commas; raise ValueError if there is none.

    >>> read_thresholds("0.5, 0.95")
    [0.5, 0.95]
    """
    numbers = [float(word) for word in text.replace(",", " ").split()]
    if not numbers or not all(0 < number <= 1 for number in numbers):
        raise ValueError(f"thresholds is {text!r}; allowed: numbers above 0 and up to 1, such as '0.5 0.9 0.95'")
    return numbers


@dataclass
class ThresholdCycles(Shipped):
    """Cycle at which the order parameter first reached each of the `thresholds` (a series, one for each of them)."""

    thresholds: str = "0.5 0.8 0.9 0.95 0.99"
    UNIT = "cycles"

    def __post_init__(self) -> None:
        self._cycles: dict[float, int | None] = dict.fromkeys(read_thresholds(self.thresholds))

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        read_thresholds(parameters.thresholds)

    def cycle(self, _: Any, state: Any) -> None:
        for threshold, cycle in self._cycles.items():
            if cycle is None and state.order_parameter is not None and state.order_parameter >= threshold:
                self._cycles[threshold] = state.cycles

    def value(self) -> list[int | None]:
        """Return the cycles; None for thresholds that were not reached."""
        return [self._cycles[threshold] for threshold in read_thresholds(self.thresholds)]


@dataclass
class BelowThreshold(Share):
    """Share of the cycles after the order parameter first reached `threshold` in which it is below it."""

    threshold: float = 0.95
    check = staticmethod(allowed(threshold=(lambda threshold: 0 < threshold <= 1, "above 0 and up to 1")))
    _is_reached = False

    def cycle(self, _: Any, state: Any) -> None:
        order = state.order_parameter
        if order is None:
            return
        if self._is_reached:
            self._whole += 1
            self._part += order < self.threshold
        self._is_reached = self._is_reached or order >= self.threshold


class StaysAbove(BelowThreshold):
    """Whether the order parameter is never below `threshold` again after it first reached it."""

    def value(self) -> bool | None:
        """Return whether it is; None if the threshold was not reached, or at the last cycle only."""
        return not self._part if self._whole else None
