"""Settings of pages of agents and of robots: their keys, refusals, and the places of numbers in records."""

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import with_values
from epuck_sim.scenario.particles import ParticleScenario

Value = float | int | str | bool | None


@dataclass(frozen=True)
class Setting:
    """A key of a scenario that a page can change, to one of some values."""

    key: str  # dotted, as `--set` takes it
    label: str
    unit: str
    stops: tuple[Value, ...]  # ascending where they are numbers; the scenario's is one of them
    value: Value  # the scenario's
    thesis: Value = None  # value in the thesis's base case; None if it has no such key
    only: tuple[str, str] | None = None  # another key, and its values, in one text, for which this setting exists


def stops(low: float, high: float, *, step: float = 0.0, also: Iterable[float] = ()) -> tuple[float, ...]:
    """Return values from `low` to `high`: every `step`, or else 20 a decade with two digits; and some further ones.

    >>> stops(1, 4, step=1, also=[2.5])
    (1, 2, 2.5, 3, 4)
    >>> stops(1, 1.35)
    (1, 1.1, 1.3, 1.35)
    """
    if step:
        found = [low + step * number for number in range(round((high - low) / step) + 1)]
    else:
        found = [low * 10 ** (number / 20) for number in range(math.floor(20 * math.log10(high / low)) + 1)]
        found = [min(float(f"{value:.2g}"), high) for value in found] + [high]
    rounded = [float(f"{value:.10g}") for value in found]
    numbers: set[float] = {int(value) if value.is_integer() else value for value in rounded}
    return tuple(sorted(numbers.union(also)))


def allowed(scenario: EmbodiedScenario | ParticleScenario, key: str, values: Iterable[Value]) -> tuple[Value, ...]:
    """Return the values of a key that the program allows, given the scenario's other values."""
    found: list[Value] = []
    for value in values:
        with suppress(ScenarioError):
            with_values(scenario, {key: value}, scenario.name)
            found.append(value)
    return tuple(found)


def refuse(scenario: EmbodiedScenario | ParticleScenario, *reasons: tuple[Any, str, str]) -> None:
    """Raise ScenarioError for the first true reason why a scenario is no page: condition, key and sentence of each."""
    of_any = (
        (scenario.sweep is not None, "sweep", "a page has one scenario, and sweeps only the speed"),
        (scenario.schedule, "schedule", "pages have no schedule"),
        (scenario.faults, "faults", "pages have no faults"),
        (scenario.stop.when is not None, "stop.when", "pages have no measures that could end a trial"),
    )
    for is_reason, key, why in of_any + reasons:
        if is_reason:
            raise ScenarioError(f"{scenario.name}: {key}: {why}; use `epuck-sim run`")


def fields_of(dtype: np.dtype[Any], prefix: str = "", first: int = 0) -> dict[str, tuple[int, str]]:
    """Return offset and kind of each number of a record, by its dotted name; an array has one entry.

    >>> fields_of(np.dtype([("a", "?"), ("b", [("c", "f8"), ("d", "u8", 2)])], align=True))
    {'a': (0, '?'), 'b.c': (8, 'f8'), 'b.d': (16, 'u8')}
    """
    found: dict[str, tuple[int, str]] = {}
    for name, field in (dtype.fields or {}).items():
        kind, offset = field[0], field[1]
        if kind.base.fields:
            found |= fields_of(kind.base, f"{prefix}{name}.", first + offset)
        else:
            found[prefix + name] = first + offset, "?" if kind.base == np.bool_ else kind.base.str[1:]
    return found
