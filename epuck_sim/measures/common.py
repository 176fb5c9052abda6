"""Base classes of shipped measures: series, shares, and allowed parameters.

The fields of a measure that is a dataclass are its parameters.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any


@dataclass
class Shipped:
    """A measure of a simulation."""

    simulation: Any

    def __post_init__(self) -> None:
        """Begin with nothing measured; a subclass replaces it."""

    @property
    def has_bodies(self) -> bool:
        """Whether the simulation is one of robots."""
        return bool(self.simulation.scenario.model == "embodied")


class Series(Shipped):
    """A measure with a value for each cycle, which its method `cycle` or `batch` appends."""

    @cached_property
    def _series(self) -> list[Any]:
        return []

    def value(self) -> Any:
        return self._series


class Share(Shipped):
    """A measure whose value is the share of a part in a whole, both of which it counts."""

    _part, _whole = 0, 0

    def value(self) -> float | None:
        return share(self._part, self._whole)


def share(part: float, whole: float) -> float | None:
    """Return the part's share of the whole; None where there is no whole."""
    return part / whole if whole else None


Rule = tuple[Callable[[Any], bool], str]  # test of a parameter, and text that says what is allowed

BELOW_HALF_A_CYCLE: Rule = (lambda cycles: 0 <= cycles < 0.5, "from 0 to below 0.5, in cycles")
ABOVE_0: Rule = (lambda number: number > 0, "above 0")


def one_of(choices: Collection[str]) -> Rule:
    """Return the rule for a parameter that must be one of these words."""
    return choices.__contains__, ", ".join(choices)


def up_to(most: int) -> Rule:
    """Return the rule for a whole number from 1 to a limit."""
    return lambda number: 1 <= number <= most, f"1 to {most}"


def allowed(**rules: Rule) -> Callable[[SimpleNamespace], None]:
    """Return a measure's `check`, which raises ValueError for a parameter that breaks its rule."""

    def check(parameters: SimpleNamespace) -> None:
        for name, (is_allowed, words) in rules.items():
            value = getattr(parameters, name)
            if not is_allowed(value):
                shown = f"{value:g}" if isinstance(value, float) else repr(value)
                raise ValueError(f"{name} is {shown}; allowed: {words}")

    return check


def check_sight(scenario: Any, _: Any) -> None:
    """Raise ValueError where observers cannot find out who receives from whom: by radio, or drawn at random."""
    groups = scenario.robots if scenario.model == "embodied" else ()
    for number, group in enumerate(groups):
        if group.signal.kind == "radio":
            raise ValueError(f"robots.{number}.signal.kind is 'radio'; allowed where sight is measured: any other")
    if scenario.model == "particles" and scenario.neighbourhood.kind == "random":
        raise ValueError("neighbourhood.kind is 'random'; allowed where receivers are measured: any other")
