"""New values of keys of a scenario of point agents: those that its schedule sets."""

from collections.abc import Mapping
from typing import Any

from epuck_sim.scenario.overrides import set_value
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.response import resolve_response
from epuck_sim.scenario.validation import validate

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
            with_values(scenario, entry.set, f"{origin}.{number}.set")


def with_values(scenario: ParticleScenario, values: Mapping[str, Any], origin: str) -> ParticleScenario:
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
