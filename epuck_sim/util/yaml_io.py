"""Reading and writing YAML as people mean it: `1e-3` is a number, `no` a word, a key given twice a mistake.

PyYAML follows YAML 1.1, where `1e-3` is text, `no` is false and `12:30` is 750; the words and numbers here are those of
YAML 1.2's core schema. Files that would unfold into far more than they show are refused.
"""

import re
from pathlib import Path
from typing import Any

import yaml

from epuck_sim.errors import ScenarioError

MAX_BYTES = 1_000_000  # largest size of a file, about a thousand times that of a scenario
MAX_NODES = 100_000  # largest number of values in a file, with every alias counted as what it stands for


class _Loader(yaml.SafeLoader):
    """SafeLoader with the core schema's plain words and numbers."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012 as PyYAML has it


class _Dumper(yaml.SafeDumper):
    """SafeDumper that quotes text which a reader, of YAML 1.1 or this one, would take for something else."""


for _tag, _pattern, _first in (
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("null", r"~|null|Null|NULL|", "~nN\0"),
    ("int", r"[-+]?[0-9]+", "-+0123456789"),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", "-+.0123456789"),
    ("float", r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", "-+."),
    ("merge", r"<<", "<"),
):
    for _class in (_Loader, _Dumper):
        _class.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), list(_first))

_Loader.add_constructor("tag:yaml.org,2002:int", lambda _, node: int(node.value))  # 010 is ten, as it reads


def write_yaml(value: Any) -> str:
    """Return plain values as YAML from which `parse_yaml` reads the same values again."""
    return yaml.dump(value, Dumper=_Dumper, sort_keys=False, default_flow_style=None)


def read_yaml(path: Path) -> Any:
    """Return the contents of a YAML file."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ScenarioError(f"{path}: is larger than {MAX_BYTES / 1e6:g} MB; a scenario is a few kB of YAML")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: is not UTF-8 text, at byte {error.start}; save it as UTF-8") from error
    return parse_yaml(text, str(path))


def line_of_key(path: Path, key: str) -> int:
    """Return the line of a dotted key in a YAML file, or of the innermost section around it that is there."""
    node, line = yaml.compose(path.read_text(encoding="utf-8"), _Loader), 1
    for part in key.split("."):
        pairs = {pair[0].value: pair for pair in node.value} if isinstance(node, yaml.MappingNode) else {}
        if isinstance(node, yaml.SequenceNode) and part.isdecimal() and int(part) < len(node.value):
            pairs = {part: (node.value[int(part)],) * 2}
        if part not in pairs:
            break
        line, node = pairs[part][0].start_mark.line + 1, pairs[part][1]
    return line


def parse_yaml(text: str, source: str) -> Any:
    """Return the contents of a YAML text."""
    try:
        loader = _Loader(text)
        loader.name = source
        node = loader.get_single_node()
        if node is None:
            return None
        _check_document(node, source)
        return loader.construct_document(node)
    except yaml.YAMLError as error:
        said, blanks = " ".join(str(error).split()), "; indent by blanks, not by tabs" * (r"'\t'" in str(error))
        raise ScenarioError(f"{source}: cannot be read as YAML: {said}{blanks}") from error
    except RecursionError as error:
        raise ScenarioError(f"{source}: is nested too deeply") from error
    except ValueError as error:  # a number of thousands of digits
        raise ScenarioError(f"{source}: has a value that cannot be read: {error}") from error


def _check_document(root: yaml.Node, source: str) -> None:
    sizes: dict[int, int] = {}  # number of values in each node; 0 while they are counted

    def size(node: yaml.Node) -> int:
        if id(node) not in sizes:
            sizes[id(node)] = 0
            pairs = node.value if isinstance(node, yaml.MappingNode) else ()
            seen: set[str] = set()
            for key in (key for key, _ in pairs if isinstance(key, yaml.ScalarNode)):
                if key.value in seen:
                    line = key.start_mark.line + 1
                    raise ScenarioError(f"{source}: key {key.value!r} is given twice, again in line {line}")
                seen.add(key.value)
            items = node.value if isinstance(node, yaml.SequenceNode) else ()
            sizes[id(node)] = 1 + sum(map(size, (*items, *(part for pair in pairs for part in pair))))
        if not sizes[id(node)]:
            raise ScenarioError(f"{source}: an alias in line {node.start_mark.line + 1} contains itself")
        return sizes[id(node)]

    if size(root) > MAX_NODES:
        raise ScenarioError(f"{source}: expands to more than {MAX_NODES} values; a scenario has a few dozen")
