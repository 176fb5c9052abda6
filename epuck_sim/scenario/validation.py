"""The table of scenario classes, and readable messages for scenarios that fail validation."""

from collections.abc import Mapping
from typing import Any, NamedTuple, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.arena import Box, BoxPatch, Circle, CirclePatch, Polygon, PolygonPatch
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.faults import FAULTS
from epuck_sim.scenario.neighbourhoods import Cone, Everybody, Nearest, RandomAgents, Range
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.signals import CameraSignal, ConeSignal, RadioSignal
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr, storable

SCENARIO_TYPES: dict[str, type[Scenario]] = {"embodied": EmbodiedScenario, "particles": ParticleScenario}
"""Class of a scenario by the name that its key `model` gives."""


class Union(NamedTuple):
    """A section that is one of several classes."""

    tag: str
    """The key whose value names the class."""
    classes: Mapping[str, type[BaseModel]]


UNIONS = {
    "faults": Union("kind", FAULTS),
    "obstacles": Union("shape", {"circle": Circle, "box": Box, "polygon": Polygon}),
    "patches": Union("shape", {"circle": CirclePatch, "box": BoxPatch, "polygon": PolygonPatch}),
    "neighbourhood": Union(
        "kind",
        {
            "nearest": Nearest,
            "range": Range,
            "cone_of_vision": Cone,
            "cone_of_emission": Cone,
            "all": Everybody,
            "random": RandomAgents,
        },
    ),
    "signal": Union("kind", {"camera": CameraSignal, "cone": ConeSignal, "radio": RadioSignal}),
}
"""Sections that are one of several classes, by their key."""

ALLOWED = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "dict_type": "a mapping of keys to values",
    "finite_number": "a finite number",
    "float_parsing": "a number",
    "float_type": "a number",
    "greater_than": "above {gt:.12g}",
    "greater_than_equal": "at least {ge:.12g}",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number with fewer digits",
    "int_type": "a whole number",
    "invalid_key": "text as the key",
    "less_than": "below {lt:.12g}",
    "less_than_equal": "at most {le:.12g}",
    "literal_error": "{expected}",
    "model_attributes_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "multiple_of": "a multiple of {multiple_of:g}",
    "string_too_long": "at most {max_length} characters",
    "string_too_short": "{min_length} or more characters",
    "string_type": "text",
    "string_unicode": "text in Unicode",
    "too_long": "at most {max_length} values",
    "too_short": "{min_length} or more values",
    "tuple_type": "a list",
    "value_error": "{error}",
}
"""What is allowed, by pydantic's type of the error; in braces, what pydantic knows of it."""


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
        raise ScenarioError("\n".join(_message(kind, origin, detail) for detail in error.errors())) from error


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


def _message(kind: type[Scenario], origin: str, detail: ErrorDetails) -> str:
    """Return one of pydantic's errors as file: key: what was given; what is allowed."""
    location = [str(part) for part in detail["loc"] if part != "[key]"]
    path, member = _without_tag(location)
    where = f"{origin}: {'.'.join(path)}" if path else origin
    error = detail["type"]
    if error == "extra_forbidden":
        foreign = kind.foreign_keys.get(".".join(path))
        known = list(member.model_fields) if member else _known_keys(kind, path[:-1])
        other = f"; for another {UNIONS[path[0]].tag}, give the whole section" if member and path[0] in UNIONS else ""
        return f"{where}: {foreign or f'{did_you_mean(path[-1], known)}; allowed: {comma_list(known)}{other}'}"
    if error == "missing":
        return f"{where}: is missing"
    allowed = ALLOWED.get(error, "another kind of value").format(**detail.get("ctx", {}))
    union = next((UNIONS[part] for part in location if part in UNIONS), None)
    if union and error in ("union_tag_invalid", "union_tag_not_found", "model_attributes_type"):
        allowed = f"a mapping with {union.tag}: {' or '.join(union.classes)}"
    if error == "value_error" and isinstance(detail["input"], dict):  # of a whole section, whose message names the key
        return f"{where}: {allowed}"
    return f"{where}: is {short_repr(detail['input'])}; allowed: {allowed}"


def _without_tag(location: list[str]) -> tuple[list[str], type[BaseModel] | None]:
    """Return a key without the tag that pydantic adds inside a union, and the class which that names."""
    for section, union in UNIONS.items():
        for index, part in enumerate(location):
            if section in location[:index] and part in union.classes:
                return [*location[:index], *location[index + 1 :]], union.classes[part]
    return location, None


def _known_keys(kind: type[Scenario], path: list[str]) -> list[str]:
    """Return the keys of the section at `path`."""
    section: type[BaseModel] | None = kind
    for part in path:
        if section is not None and not part.isdecimal():  # numbers are places in a list of sections
            section = _section_in(section.model_fields[part].annotation)
    return list(section.model_fields) if section else []


def _section_in(annotation: Any) -> type[BaseModel] | None:
    """Return the first class of a section in the type of a field; None if there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := _section_in(part))), None)
