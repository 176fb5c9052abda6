"""Scenarios from YAML: find the file, apply `--set`, validate, fill in the controllers' defaults, write it again."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from epuck_sim.controller_file import find_controller
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario import Box, Circle, Polygon, Scenario
from epuck_sim.shipped import shipped_folder, shipped_names
from epuck_sim.wording import listed, shown, unknown
from epuck_sim.yaml_reader import parse_yaml, read_yaml


def load_scenario(source: Scenario | str | Path | Mapping[str, Any], settings: Sequence[str] = ()) -> Scenario:
    """Return a validated scenario with every default written out.

    source: a shipped arena's name, a YAML file, a mapping with a scenario's keys, or a Scenario.
    settings: changes as `key=value`, such as `robots.0.parameters.speed_cm_s=1.0`; later ones win.
    Raises ScenarioError, which names the file, the key, the value and what is allowed.

    >>> load_scenario("thesis", ["arena.width_cm=100"]).arena.width_cm
    100.0
    """
    folder = None
    if isinstance(source, Scenario):
        if not settings:
            return _resolve(source, source.name, folder)
        given: Any = source.model_dump(mode="json", exclude_none=True)
        origin = source.name
    elif isinstance(source, Mapping):
        given, origin = dict(source), "scenario"
    else:
        path = find_scenario(str(source))
        given, origin, folder = read_yaml(path), str(path), path.parent
        if given is None:
            raise ScenarioError(f"{path}: is empty; a scenario is a mapping of keys to values")
        if isinstance(given, dict):
            given = {"name": path.stem, **given}
    if not isinstance(given, dict):
        raise ScenarioError(f"{origin}: is {shown(given)}; a scenario is a mapping of keys to values")
    for setting in settings:
        given = apply_setting(given, setting)
    origin = " ".join([origin, *(f"--set {setting}" for setting in settings)])
    try:
        scenario = Scenario.model_validate(given)
    except ValidationError as error:
        raise ScenarioError("\n".join(_readable(origin, detail) for detail in error.errors())) from error
    return _resolve(scenario, origin, folder)


def find_scenario(name: str) -> Path:
    """Return the file of a shipped arena, or the file `name`; raises ScenarioError where there is neither."""
    names = shipped_names("arenas", ".yaml")
    if name in names:
        return shipped_folder("arenas") / f"{name}.yaml"
    path = Path(name)
    try:
        if path.is_file():
            return path
        if path.exists():
            raise ScenarioError(f"{name}: is no regular file")
    except OSError as error:
        raise ScenarioError(f"{name}: cannot be read: {error.strerror}") from error
    if path.suffix in (".yaml", ".yml"):
        raise ScenarioError(f"{name}: there is no such file")
    raise ScenarioError(f"{unknown(name, names)}; shipped arenas: {listed(names)}; or give a file that ends in .yaml")


def apply_setting(given: Mapping[str, Any], setting: str) -> dict[str, Any]:
    """Return the mapping `given` with one change, `key=value` with a dotted key; raises ScenarioError."""
    key, equals, text = setting.partition("=")
    if not equals or not key:
        raise ScenarioError(f"--set {setting}: give it as key=value, such as stop.max_cycles=100")
    value = parse_yaml(text, f"--set {setting}")
    parts = key.split(".")
    result = _with({"robots": [{}], **given}, parts, value, setting)
    assert isinstance(result, dict)  # a mapping changed is a mapping
    return result


def _with(container: Any, parts: list[str], value: Any, setting: str) -> Any:
    """Return `container` with `value` at the path `parts`; sections that are not there yet are made."""
    if not parts:
        return value
    first, *rest = parts
    if isinstance(container, list | tuple):
        if not first.isdecimal() or int(first) >= len(container):
            raise ScenarioError(f"--set {setting}: {first!r} is no place in a list of {len(container)}, counted from 0")
        place = int(first)
        return [*container[:place], _with(container[place], rest, value, setting), *container[place + 1 :]]
    if container is not None and not isinstance(container, Mapping):
        raise ScenarioError(f"--set {setting}: {first!r} lies in {shown(container)}, which has no keys")
    here = dict(container or {})
    here[first] = _with(here.get(first), rest, value, setting)
    return here


def _resolve(scenario: Scenario, origin: str, folder: Path | None) -> Scenario:
    """Return the scenario with controllers found and their parameters complete; raises ScenarioError."""
    groups = []
    for place, group in enumerate(scenario.robots):
        key = f"{origin}: robots.{place}"
        try:
            controller = find_controller(group.controller, folder)
        except ControllerError as error:
            raise ScenarioError(f"{key}.controller: {error}") from error
        try:
            parameters = controller.resolve(group.parameters)
        except ValueError as error:
            raise ScenarioError(f"{key}.parameters: {error}") from error
        if controller.is_oscillator and parameters["period_s"] * 1000 <= scenario.timing.step_ms:
            raise ScenarioError(
                f"{key}.parameters: period_s is {parameters['period_s']}; allowed: longer than a control step, "
                f"{scenario.timing.step_ms / 1000:g} s"
            )
        shipped = controller.path.parent == shipped_folder("controllers")
        name = controller.name if shipped else str(controller.path)
        groups.append(group.model_copy(update={"controller": name, "parameters": parameters}))
    return scenario.model_copy(update={"robots": tuple(groups)})


def write_scenario(scenario: Scenario) -> str:
    """Return a scenario as YAML with every key; read again, it is the same scenario."""
    return yaml.safe_dump(scenario.model_dump(mode="json", exclude_none=True), sort_keys=False, default_flow_style=None)


def _readable(origin: str, detail: ErrorDetails) -> str:
    """Return one of pydantic's errors as file: key: what was given; what is allowed."""
    path = [str(part) for part in detail["loc"] if part not in ("circle", "box", "polygon")]
    where = f"{origin}: {'.'.join(path)}" if path else origin
    if detail["type"] == "extra_forbidden":
        return f"{where}: {unknown(path[-1], _known_keys(path[:-1]))}; allowed: {listed(_known_keys(path[:-1]))}"
    if detail["type"] == "missing":
        return f"{where}: is missing"
    message = WORDS.get(detail["type"]) or detail["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if detail["type"] == "value_error" and isinstance(detail["input"], dict):
        return f"{where}: {message}"
    return f"{where}: is {shown(detail['input'])}; allowed: {message}"


WORDS = {
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "union_tag_invalid": "shape: circle, box or polygon",
    "union_tag_not_found": "shape: circle, box or polygon",
}
"""What is allowed, in words of the file rather than of Python."""


def _known_keys(path: list[str]) -> list[str]:
    """Return the keys of the section at `path`."""
    section: Any = Scenario.model_validate({})
    for part in path:
        if part == "obstacles":
            return list(dict.fromkeys(key for shape in (Circle, Box, Polygon) for key in shape.model_fields))
        section = section[0] if isinstance(section, tuple) else getattr(section, part)
    return list(type(section).model_fields) if isinstance(section, BaseModel) else []
