"""Names and descriptions of what comes with the package, and of what installed packages offer."""

import ast
import json
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from inspect import getsource
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from epuck_sim.cli.tables import terminal_width
from epuck_sim.control.interface import RobotCode
from epuck_sim.control.loader import CONTROLLER, SENSOR, find_controller, find_sensor
from epuck_sim.errors import EpuckSimError, ScenarioError
from epuck_sim.measures.measure import MEASURE, find_measure
from epuck_sim.scenario.base import ConfigModel, section_classes, tagged
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import SCENARIO, SCENARIO_TYPES
from epuck_sim.scenario.particles import CURVE, find_curve
from epuck_sim.scenario.robot_kind import ROBOT
from epuck_sim.scenario.scenario import ONE_MEASURE, MeasureSection
from epuck_sim.user_files import OWN_PACKAGE, Kind, Place
from epuck_sim.util.builtin import SWEEPS, builtin_files
from epuck_sim.util.messages import describe_error, natural_order, nearest_name
from epuck_sim.util.yaml_io import read_yaml


def list_names() -> dict[str, dict[str, str]]:
    """Return names and descriptions of scenarios, sweeps, controllers, robots, and what else packages offer."""
    sweeps, curves = builtin_files(SWEEPS), CURVE.offers.keys() - CURVE.shipped().keys()
    kinds = {
        "scenarios": _describe(SCENARIO, SCENARIO.offers.keys() - sweeps.keys(), _of_yaml),
        "sweeps": _describe(SCENARIO, sweeps, _of_yaml),
        "controllers": _describe(CONTROLLER, CONTROLLER.offers, partial(_of_code, find_controller)),
        "robots": _describe(ROBOT, ROBOT.offers, _of_yaml),
        "sensors": _describe(SENSOR, SENSOR.offers, partial(_of_code, find_sensor)),
        "response curves": _describe(CURVE, curves, partial(_of_code, find_curve)),
    }
    return {kind: described for kind, described in kinds.items() if described}


def list_measures() -> dict[str, dict[str, str]]:
    """Return the names and descriptions of the measures, as one kind."""
    return {"measures": _describe(MEASURE, MEASURE.offers, _of_measure)}


def list_keys(ending: str) -> dict[str, dict[str, str]]:
    """Return descriptions of keys with this ending, or in this section, by model (N: place), and of this name."""
    part = re.sub(r"\b\d+\b", "N", ending)
    found: dict[str, dict[str, str]] = {}
    for name, key, said in _every_key(f".{part}."):
        of_model = found.setdefault(f"model: {name}", {})
        if said not in of_model.get(key, ""):  # several classes of sections, or controllers, have it
            of_model[key] = f"{of_model.get(key, '')} {said}".lstrip()
    names = {name for kind in (SCENARIO, CONTROLLER, ROBOT, SENSOR, CURVE, MEASURE) for name in kind.offers}
    kinds = {**list_names(), **list_measures()} if ending in names else {}
    found |= {kind: {ending: described[ending]} for kind, described in kinds.items() if ending in described}
    if not found:
        keys = [key.partition(":")[0] for _, key, _ in _every_key("")]
        near = nearest_name(part, {*keys, *".".join(keys).split("."), *names})
        meant = f", did you mean {near}?" if near else ""
        raise ScenarioError(f"{ending}: no section of scenarios has it{meant}; parameters: `list`, `list --measures`")
    return found


def print_descriptions(kinds: Mapping[str, Mapping[str, str]]) -> None:
    """Print a heading for each kind and a line for each name; on a terminal, descriptions are wrapped between words."""
    width = terminal_width()
    for kind, descriptions in kinds.items():
        print(kind)
        column = min(max(20, *map(len, descriptions)), (width or 80) // 2)
        for name, description in descriptions.items():
            line = f"  {name:{column}} {description}"
            print(textwrap.fill(line, width, subsequent_indent=" " * (column + 3)) if width else line)


def _describe(kind: Kind, names: Iterable[str], describe: Callable[[Place], str]) -> dict[str, str]:
    """Return names in order, each with its description, where it comes from, or what is wrong with it."""
    described: dict[str, str] = {}
    for name in sorted(names, key=natural_order):
        try:
            described[name] = describe(kind.named(name))
        except (EpuckSimError, SyntaxError, ValueError) as error:
            described[name] = str(error) if isinstance(error, EpuckSimError) else describe_error(error)
        if packages := [place.package for place in kind.offers[name] if place.package != OWN_PACKAGE]:
            described[name] += f" (from {' and '.join(packages)})"
    return described


def _of_yaml(place: Place) -> str:
    given = read_yaml(place.path or Path())
    return str(given.get("description", "")) if isinstance(given, Mapping) else ""


def _of_code(find: Callable[[str], RobotCode], place: Place) -> str:
    path, parameters = place.path or Path(), find(place.name).parameters
    doc = ast.get_docstring(ast.parse(path.read_bytes(), path.name)) if path.suffix == ".py" else ""
    return _with_parameters((doc or "").partition("\n")[0], parameters)


def _of_measure(place: Place) -> str:
    measure = find_measure(place.name)
    return _with_parameters((measure.make.__doc__ or "").partition("\n")[0], measure.parameters)


def _with_parameters(doc: str, parameters: Mapping[str, object]) -> str:
    listed = ", ".join(f"{key}: {default}" for key, default in parameters.items())
    return f"{doc} {{{listed}}}" if listed else doc


def _every_key(part: str) -> Iterator[tuple[str, str, str]]:
    for name, model in SCENARIO_TYPES.items():
        yield from ((name, *told) for told in _keys(model, part, model.refused))
        if model is EmbodiedScenario:
            yield from ((name, *told) for told in _keys_of_controllers(part))


def _keys_of_controllers(part: str) -> Iterator[tuple[str, str]]:
    """Yield the key of each parameter of controllers that has `part`, with its comment in their files, and default."""
    owners: dict[tuple[str, str, str], list[str]] = {}
    for name in sorted(CONTROLLER.offers, key=natural_order):
        with suppress(EpuckSimError):  # which `list` shows
            controller = find_controller(name)
            source = b"\n".join(controller.sources.values()).decode(errors="replace")  # its own file first
            for key, default in controller.parameters.items():
                comment = re.search(rf"""["']{key}["']: [^#\n]*# *(.+)""", source)
                told = key, comment[1] if comment else "", json.dumps(default)
                owners.setdefault(told, []).append(name)
    for (key, said, value), names in owners.items():
        if part in f".robots.N.parameters.{key}.":
            yield f"robots.N.parameters.{key}", f"{said} ({', '.join(names)}; default: {value})".lstrip()


def _keys(section: type[ConfigModel], part: str, refused: Sequence[str], above: str = "") -> Iterator[tuple[str, str]]:
    """Yield each dotted key in a section that has `part`, or `KEY: KIND`, with docstring, type and default."""
    tag, kinds = tagged(section)
    kinds = tuple(kind for kind in kinds if kind not in refused)
    if tag and not kinds:
        return
    docs = {tag: f"`{kinds[0] if kinds else ''}`: {(section.__doc__ or '').splitlines()[0]}", **docstrings(section)}
    for name, value in section.model_json_schema(schema_generator=_Plain)["properties"].items():
        classes = section_classes(section.model_fields[name].annotation)
        key, inner = f"{above}{name}", [each for each in classes if each is not MeasureSection]
        for each in inner:
            yield from _keys(each, part, refused, f"{key}{'.N' * (value.get('type') == 'array')}.")
        if name in docs and not inner and part in f".{key}." and key not in refused:
            default = f"; default: {json.dumps(value['default'])}" if "default" in value else ""
            if name != tag:
                yield key, f"{docs[name]} ({allowed(value)}{default})"
                continue
            for kind, said in re.findall(r"`(\w+)`[^:]*: (.+?)\.?(?=; `|$)", docs[tag]):
                if kind in kinds:
                    yield f"{key}: {kind}", f"{said} (the default)" if kind == value.get("default") else said


class _Plain(GenerateJsonSchema):
    def encode_default(self, dft: Any) -> Any:
        """Encode a default, but for sections, which pydantic up to 2.13 cannot: their keys have their own defaults."""
        has_sections = any(isinstance(each, ConfigModel) for each in (dft if isinstance(dft, tuple) else [dft]))
        return None if has_sections else super().encode_default(dft)


@cache
def docstrings(section: type[ConfigModel]) -> dict[str, str]:
    """Return the docstring of each field of a section that has one, there or in a class above."""
    source = "".join(getsource(each) for each in section.__mro__ if issubclass(each, ConfigModel))
    found = {
        name: re.search(rf'^    {name}: (?:(?!^(?:    )?\w).)*?^    """(.*?)"""', source, re.M | re.S)
        for name in section.model_fields
    }
    return {name: " ".join(doc[1].split()) for name, doc in found.items() if doc}


LIMITS = {
    "ge": "from {:,.12g}",
    "gt": "above {:,.12g}",
    "le": "to {:,.12g}",
    "lt": "below {:,.12g}",
    "multiple_of": "in steps of {:g}",
    "minItems": "of at least {:g}",
    "maxItems": "and at most {:g}",
}
"""Limits in words, as pydantic writes them in JSON schemas of values that have a validator of their own."""

TYPES = {"integer": "whole number", "string": "text", "boolean": "true or false", "array": "list", "object": "mapping"}
"""Types of JSON schemas in words, where these are others."""

MEASURE_REFERENCE = "#/$defs/MeasureSection"  # of the one section that is not written as a mapping of its fields


def allowed(value: Mapping[str, Any], code: str = "") -> str:
    """Return in words what a JSON schema allows: `number above 0 to 1`; single values stand between `code`."""
    if value.get("$ref") == MEASURE_REFERENCE:
        return ONE_MEASURE
    if "anyOf" in value:
        return " or ".join(allowed(each, code) for each in value["anyOf"])
    kind = value.get("type", "any value")
    choices = ["null"] if kind == "null" else value.get("enum", [value["const"]] if "const" in value else ())
    if choices:
        return " or ".join(f"{code}{each}{code}" for each in choices)
    limits = [words.format(value[name]) for name, words in LIMITS.items() if name in value]
    items = f" of: {allowed(value['items'], code)}" if {"enum", "$ref"} & value.get("items", {}).keys() else ""
    return " ".join([TYPES.get(kind, kind) + items, *limits])
