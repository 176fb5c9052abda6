"""The table of scenario classes, what is said of scenarios that fail validation, and values that schedules set."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.base import describe_problem
from epuck_sim.scenario.curves import resolve_response
from epuck_sim.scenario.embodied import STAYING, EmbodiedScenario
from epuck_sim.scenario.keys import all_keys, set_value
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.messages import short_repr, storable

SCENARIO_TYPES: dict[str, type[Scenario]] = {"embodied": EmbodiedScenario, "particles": ParticleScenario}
"""Class of a scenario by the name that its key `model` gives."""


def validate(given: Mapping[str, Any], origin: str) -> Scenario:
    """Return the scenario, of the class that its key `model` names.

    Raises:
        ScenarioError: It fails validation; each line of the message begins with `origin`.
    """
    _reject_surrogates(given, origin)
    model = given.get("model", "embodied")
    if not isinstance(model, str) or model not in SCENARIO_TYPES:
        raise ScenarioError(
            f"{origin}: model: is {short_repr(model)}; allowed: {' or '.join(map(repr, SCENARIO_TYPES))}"
        )
    kind = SCENARIO_TYPES[model]
    try:
        return kind.model_validate(given)
    except ValidationError as error:
        keys = all_keys(kind, given)
        raise ScenarioError("\n".join(describe_problem(kind, origin, each, keys) for each in error.errors())) from error


def _reject_surrogates(value: Any, origin: str, *path: str) -> None:
    """Raise ScenarioError for a text that is not Unicode, which no file and no database would take."""
    if isinstance(value, Mapping):
        for key, part in value.items():
            _reject_surrogates(key, origin, *path)
            _reject_surrogates(part, origin, *path, str(key))
    elif isinstance(value, list | tuple):
        for number, part in enumerate(value):
            _reject_surrogates(part, origin, *path, str(number))
    elif isinstance(value, str) and storable(value) != value:
        where = storable(": ".join([origin, *([".".join(path)] if path else [])]))
        raise ScenarioError(f"{where}: is {short_repr(value)}; allowed: text in Unicode")


CHANGING = ("agents", "neighbourhood", "response")
"""Sections that a schedule may change."""

_CHECKED = {"model", "space", "clocks", *CHANGING}
"""Sections by which new values are checked."""


def check_changes(scenario: ParticleScenario, origin: str) -> None:
    """Check the new values that the entries of a schedule set.

    No entry can make a value wrong that another one sets: each key is checked by what stays as it is.

    Args:
        scenario: The scenario, with the path of its response curve and all its parameters.
        origin: Begins every error message.

    Raises:
        ScenarioError: A value is not allowed.
    """
    for number, entry in enumerate(scenario.schedule):
        if entry.set:
            agents_with(scenario, entry.set, f"{origin}.{number}.set")


def agents_with(scenario: ParticleScenario, values: Mapping[str, Any], origin: str) -> ParticleScenario:
    """Return a scenario with new values of keys.

    Args:
        scenario: The scenario, with the path of its response curve and all its parameters.
        values: New values by dotted key, of the sections in `CHANGING`.
        origin: Begins every error message.

    Raises:
        ScenarioError: A value is not allowed.
    """
    given = scenario.model_dump(include=_CHECKED)
    for key, value in values.items():
        given = set_value(given, key, value, origin)
    checked = validate(given, origin)
    assert isinstance(checked, ParticleScenario)
    changed = {section: getattr(checked, section) for section in CHANGING}
    changed["response"] = resolve_response(checked.response, f"{origin}: response")
    return scenario.model_copy(update=changed)


def check_arenas(scenario: EmbodiedScenario, origin: str) -> None:
    """Check the arenas that entries of a schedule make.

    All entries that change the arena set the same keys, so that each makes an arena that is known beforehand, whatever
    entries come before it.

    Args:
        scenario: The scenario.
        origin: Begins every error message.

    Raises:
        ScenarioError: An arena is not allowed, too small for the robots, or depends on the order of entries; or its
            floor has a picture, which is stretched between walls that move.
    """
    first: tuple[int, set[str]] | None = None
    for number, entry in enumerate(scenario.schedule):
        values = entry.arena_values()
        if not values:
            continue
        first = first or (number, set(values))
        if set(values) != first[1]:
            raise ScenarioError(
                f"{origin}.{number}.set: sets {_listed(values)}, and {origin}.{first[0]}.set sets {_listed(first[1])}; "
                "give all entries that change the arena the same keys of it"
            )
        if scenario.arena.floor.picture is not None and values.keys() - {"obstacles"}:
            raise ScenarioError(
                f"{origin}.{number}.set: sets {_listed(values)}, and arena.floor.picture is stretched between the "
                "walls; give patches instead, or set arena.obstacles alone"
            )
        given = {
            "arena": {**scenario.arena.model_dump(exclude=STAYING), **values},
            "robots": [
                {"count": group.count, "kind": kind.model_dump(), "signal": {"kind": "cone"}}  # which all robots have
                for group, kind in zip(scenario.robots, scenario.group_kinds, strict=True)
            ],
        }
        validate(given, f"{origin}.{number}.set")


def _listed(names: Mapping[str, Any] | set[str]) -> str:
    return ", ".join(f"arena.{name}" for name in sorted(names))
