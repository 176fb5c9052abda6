"""What a page lets its reader change: keys of a scenario, each with the values that its slider stops at."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from epuck_sim.display.table import leaves
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.scenario import Scenario

Value = float | int | str | bool | None


@dataclass(frozen=True)
class Setting:
    """A key of a scenario that a page can change, to one of some values."""

    key: str  # dotted, as `--set` takes it
    label: str
    unit: str
    stops: tuple[Value, ...]  # ascending where they are numbers; the scenario's is one of them
    value: Value  # the scenario's
    thesis: Value = None  # that of the thesis's base case; None if the key is not there
    only: tuple[str, str] | None = None  # a key and those of its values, in one text, with which this key is there


def stops(low: float, high: float, *, step: float = 0.0, also: Iterable[float] = ()) -> tuple[float, ...]:
    """Return values from `low` to `high`: every `step`, or else 20 a decade with two digits; and some further ones.

    >>> stops(1, 4, step=1, also=[2.5])
    (1, 2, 2.5, 3, 4)
    >>> stops(1, 1.4)
    (1, 1.1, 1.3, 1.4)
    """
    if step:
        found = [low + step * number for number in range(round((high - low) / step) + 1)]
    else:
        found = [low * 10 ** (number / 20) for number in range(math.floor(20 * math.log10(high / low)) + 1)]
        found = [float(f"{value:.2g}") for value in found] + [high]
    rounded = [float(f"{value:.10g}") for value in found]
    numbers: set[float] = {int(value) if value.is_integer() else value for value in rounded}
    return tuple(sorted(numbers.union(also)))


def values_of(scenario: Scenario) -> dict[str, Value]:
    """Return the value of each dotted key of a scenario."""
    return dict(leaves(scenario.model_dump(mode="json", warnings=False)))


def refuse(scenario: Scenario, reasons: Mapping[str, tuple[bool, str]]) -> None:
    """Raise ScenarioError for the first key that is a reason not to be a page, with why."""
    for key, (is_reason, why) in reasons.items():
        if is_reason:
            raise ScenarioError(f"{scenario.name}: {key}: {why}; `epuck-sim run` does")
