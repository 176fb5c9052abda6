"""Writes the reference of all keys of scenarios from their models: type, range, default and description."""

from collections.abc import Iterator, Mapping
from typing import Any

from epuck_sim.cli.listing import MEASURE_REFERENCE, allowed, docstrings
from epuck_sim.scenario.base import ConfigModel
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario

COMMON = [name for name in Scenario.model_fields if name not in ("model", "stop")]
"""Keys that scenarios of all models have; a trial's end is one, too, but each model has its own."""

Schema = Mapping[str, Any]


def write_scenario_keys() -> str:
    """Return the reference as Markdown: keys of all models, of robots, and of point agents."""
    robots, agents = EmbodiedScenario.model_json_schema(), ParticleScenario.model_json_schema()
    parts = ["## All models", *_write_sections(robots, COMMON)]
    for title, schema in (("Robots: `model: embodied`", robots), ("Point agents: `model: particles`", agents)):
        own = [name for name in schema["properties"] if name not in (*COMMON, "model")]
        parts += [f"## {title}", *_write_sections(schema, own)]
    return "\n\n".join(parts)


def _write_sections(schema: Schema, names: list[str]) -> Iterator[str]:
    """Yield the table of single keys, and then a heading, an introduction and a table for each section."""
    properties = {name: schema["properties"][name] for name in names}
    sections = {name: _sections_in(value) for name, value in properties.items()}
    single = {name: value for name, value in properties.items() if not sections[name]}
    if single:
        yield _write_table(schema, "", single)
    for name, found in sections.items():
        for title in found:
            yield from _write_section(title, _numbered(name, properties[name]), schema["$defs"])


def _write_section(title: str, path: str, definitions: Mapping[str, Schema]) -> Iterator[str]:
    section = definitions[title]
    properties = section["properties"]
    kind = next((f", `{name}: {value['const']}`" for name, value in properties.items() if "const" in value), "")
    yield f"### `{path}`{kind}"
    yield _in_markdown(section["description"])
    inner = {name: _sections_in(value) for name, value in properties.items()}
    rows = {name: value for name, value in properties.items() if not inner[name] and "const" not in value}
    if rows:
        yield _write_table(section, f"{path}.", rows)
    for name, found in inner.items():
        for each in found:
            yield from _write_section(each, f"{path}.{_numbered(name, properties[name])}", definitions)


def _numbered(name: str, value: Schema) -> str:
    """Return a key as it stands in dotted keys, where items of lists are numbered."""
    return f"{name}.N" if value.get("type") == "array" else name


def _sections_in(value: Schema) -> list[str]:
    """Return the names of the classes that a key's value may have."""
    if "$ref" in value:
        return [] if value["$ref"] == MEASURE_REFERENCE else [value["$ref"].rpartition("/")[2]]
    inner = [*value.get("anyOf", ()), *value.get("oneOf", ()), *([value["items"]] if "items" in value else ())]
    return [name for each in inner for name in _sections_in(each)]


def _write_table(section: Schema, prefix: str, rows: Mapping[str, Schema]) -> str:
    lines = ["| key | value | default | meaning |", "| --- | --- | --- | --- |"]
    for name, value in rows.items():
        is_required = name in section.get("required", ())
        default = "required" if is_required else f"`{_in_yaml(value.get('default', {}))}`"
        doc = _in_markdown(_doc(section["title"], name))
        lines.append(f"| `{prefix}{name}` | {allowed(value, code='`')} | {default} | {doc} |")
    return "\n".join(lines)


def _in_yaml(value: object) -> str:
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return f"{value:.12g}" if isinstance(value, float) else '""' if value == "" else str(value)


def _in_markdown(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")


def _classes(base: type) -> Iterator[type]:
    each: type
    for each in base.__subclasses__():
        yield each
        yield from _classes(each)


CLASSES: dict[str, type] = {each.__name__: each for each in _classes(ConfigModel)}


def _doc(title: str, name: str) -> str:
    """Return the docstring of a field, or of the field that it replaces in a class above."""
    docs = docstrings(CLASSES[title])
    if name in docs:
        return docs[name]
    raise ValueError(f"{title}.{name} has no docstring, which the reference of keys needs")
