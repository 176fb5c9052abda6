"""The models that a scenario can be of, and what is said of a mapping that makes none."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.arena import Box, Circle, Polygon
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import Cone, Everybody, Nearest, ParticleScenario, Range
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

SCENARIO_TYPES: dict[str, type[Scenario]] = {"embodied": EmbodiedScenario, "particles": ParticleScenario}

VARIANTS: dict[str, dict[str, type[BaseModel]]] = {
    "obstacles": {"circle": Circle, "box": Box, "polygon": Polygon},
    "neighbourhood": {
        "nearest": Nearest,
        "range": Range,
        "cone_of_vision": Cone,
        "cone_of_emission": Cone,
        "all": Everybody,
    },
}
"""Sections that are one of several, by their key and by the word that tells which."""

SAID_BY = {"obstacles": "shape", "neighbourhood": "kind"}
"""The key that has this word."""

IN_PARTICLES = {
    "arena": "space",
    "robots": "agents, clocks, response and neighbourhood",
    "noise": "clocks.jitter for clocks; agents neither sense nor drive",
    "spread": "nothing, for agents are all alike",
    "stuck": "nothing, for agents are points",
    "contact": "nothing, for agents are points",
    "timing": "nothing, for time has no steps",
    "stop.reference_robot": "stop.reference",
    "stop.max_time_s": "stop.max_cycles",
    "stop.further_cycles": "nothing, for its trials end with synchrony",
}
"""Keys of embodied scenarios, and where in a particle scenario the same thing is said."""

WORDS = {
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
    "too_short": "at least one value",
}
"""What is allowed, in words of the file rather than of Python."""


def validate(given: Mapping[str, Any], origin: str) -> Scenario:
    """Return the scenario, of the model that it names; raises ScenarioError, each of whose lines begins with origin."""
    model = given.get("model", "embodied")
    if not isinstance(model, str) or model not in SCENARIO_TYPES:
        raise ScenarioError(
            f"{origin}: model: is {short_repr(model)}; allowed: {' or '.join(map(repr, SCENARIO_TYPES))}"
        )
    kind = SCENARIO_TYPES[model]
    try:
        return kind.model_validate(given)
    except ValidationError as error:
        raise ScenarioError("\n".join(_readable(kind, origin, detail) for detail in error.errors())) from error


def _readable(kind: type[Scenario], origin: str, detail: ErrorDetails) -> str:
    """Return one of pydantic's errors as file: key: what was given; what is allowed."""
    place = [str(part) for part in detail["loc"]]
    path, variant = _without_variant(place)
    where = f"{origin}: {'.'.join(path)}" if path else origin
    if detail["type"] == "extra_forbidden":
        known = list(variant.model_fields) if variant else _known_keys(kind, path[:-1])
        allowed = f"{did_you_mean(path[-1], known)}; allowed: {comma_list(known)}"
        if variant:
            allowed += f"; of another {SAID_BY.get(path[0], 'shape')}, give the whole section"
        return f"{where}: {_misplaced(kind, path) or allowed}"
    if detail["type"] == "missing":
        return f"{where}: is missing"
    message = WORDS.get(detail["type"]) or detail["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    section = next((part for part in place if part in VARIANTS), "")
    if section and detail["type"] in ("union_tag_invalid", "union_tag_not_found", "model_attributes_type"):
        message = f"a mapping with {SAID_BY[section]}: {' or '.join(VARIANTS[section])}"
    if detail["type"] == "value_error" and isinstance(detail["input"], dict):
        return f"{where}: {message}"
    return f"{where}: is {short_repr(detail['input'])}; allowed: {message}"


def _without_variant(place: list[str]) -> tuple[list[str], type[BaseModel] | None]:
    """Return a key without the word that pydantic adds to tell which variant of a section it is in, and the variant."""
    for section, variants in VARIANTS.items():
        for part, word in enumerate(place):
            if section in place[:part] and word in variants:
                return [*place[:part], *place[part + 1 :]], variants[word]
    return place, None


def _misplaced(kind: type[Scenario], path: list[str]) -> str | None:
    """Return where a key of the other model belongs; None for one that no model has."""
    if kind is ParticleScenario:
        place = IN_PARTICLES.get(".".join(path))
        return place and f"belongs to model: embodied; model: particles has {place}"
    if path == ["stop", "reference"] or (len(path) == 1 and path[0] in ParticleScenario.model_fields):
        return "belongs to model: particles; give that model, or leave it out"
    return None


def _known_keys(kind: type[Scenario], path: list[str]) -> list[str]:
    """Return the keys of the section at `path`."""
    model = next(name for name, each in SCENARIO_TYPES.items() if each is kind)
    section: Any = kind.model_validate({"model": model, "sweep": {"grid": {"model": [0]}}})
    for part in path:
        section = section[0] if isinstance(section, tuple) else getattr(section, part)
    return list(type(section).model_fields) if isinstance(section, BaseModel) else []
