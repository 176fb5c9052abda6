"""How synchronised a swarm is from cycle to cycle, when it passes thresholds, and whether it stays above them."""

from types import SimpleNamespace
from typing import Any

from epuck_sim.measures.common import Series, Share, allowed


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


class ThresholdCycles:
    """Cycle at which the order parameter first reached each of the `thresholds` (a series, one for each of them)."""

    UNIT = "cycles"

    def __init__(self, simulation: Any, *, thresholds: str = "0.5 0.8 0.9 0.95 0.99") -> None:  # noqa: ARG002
        self._thresholds = read_thresholds(thresholds)
        self._cycles: list[int | None] = [None] * len(self._thresholds)

    @staticmethod
    def check(parameters: SimpleNamespace) -> None:
        read_thresholds(parameters.thresholds)

    def cycle(self, _: Any, state: Any) -> None:
        order = state.order_parameter
        if order is None:
            return
        for place, threshold in enumerate(self._thresholds):
            if self._cycles[place] is None and order >= threshold:
                self._cycles[place] = state.cycles

    def value(self) -> list[int | None]:
        """Return the cycles; None for thresholds that were not reached."""
        return list(self._cycles)


class BelowThreshold(Share):
    """Share of the cycles after the order parameter first reached `threshold` in which it is below it."""

    def __init__(self, simulation: Any, *, threshold: float = 0.95) -> None:
        super().__init__(simulation)
        self._threshold = threshold
        self._is_reached = False

    check = staticmethod(allowed(threshold=(lambda threshold: 0 < threshold <= 1, "above 0 and up to 1")))

    def cycle(self, _: Any, state: Any) -> None:
        order = state.order_parameter
        if order is None:
            return
        if self._is_reached:
            self._whole += 1
            self._part += order < self._threshold
        self._is_reached = self._is_reached or order >= self._threshold


class StaysAbove(BelowThreshold):
    """Whether the order parameter is never below `threshold` again after it first reached it."""

    def value(self) -> bool | None:
        """Return whether it is; None if the threshold was not reached, or at the last cycle only."""
        return not self._part if self._whole else None
