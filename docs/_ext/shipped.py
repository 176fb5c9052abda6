"""Writes the reference of what is shipped: scenarios, sweeps, robots, controllers, measures, with line and picture."""

import ast
from collections.abc import Callable, Mapping
from pathlib import Path

from epuck_sim.cli.listing import list_measures, list_names
from epuck_sim.util.builtin import CONTROLLERS, ROBOTS, builtin_files

FIGURES = Path(__file__).parent.parent / "figures"
"""Folder of the pictures: of sweeps named after them, of others in `shipped`."""


def write_scenarios() -> str:
    """Return the shipped scenarios as Markdown."""
    return _write_with_pictures("scenario", list_names()["scenarios"])


def write_sweeps() -> str:
    """Return the shipped sweeps as Markdown."""
    return _write_with_pictures("sweep", list_names()["sweeps"])


def write_measures() -> str:
    """Return the shipped measures as Markdown."""
    return _write_with_pictures("measure", list_measures()["measures"])


def write_controllers() -> str:
    """Return the shipped controllers as Markdown: what each does, and its parameters as its file declares them."""
    files = builtin_files(CONTROLLERS)
    parts = []
    for name, description in list_names()["controllers"].items():
        source = files[name].read_text(encoding="utf-8")
        declared = f"```python\n{_parameters_in(source)}\n```"
        parts += [f"### `{name}`", description, declared, *_pictures("controller", name)]
    return "\n\n".join(parts)


def write_robots() -> str:
    """Return the shipped robots as Markdown: what each is, and its file."""
    files = builtin_files(ROBOTS)
    parts = [
        (f"### `{name}`", description, f"```yaml\n{files[name].read_text(encoding='utf-8')}```")
        for name, description in list_names()["robots"].items()
    ]
    return "\n\n".join(part for section in parts for part in section)


def _parameters_in(source: str) -> str:
    """Return the lines of a controller's file that declare its parameters."""
    for statement in ast.parse(source).body:
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == "PARAMETERS":
            return "\n".join(source.splitlines()[statement.lineno - 1 : statement.end_lineno])
    return "PARAMETERS = {}"


def _write_with_pictures(kind: str, descriptions: Mapping[str, str]) -> str:
    """Return a section for each name: its description, and its picture."""
    parts = [[f"### `{name}`", description, *_pictures(kind, name)] for name, description in descriptions.items()]
    return "\n\n".join(part for section in parts for part in section)


def _pictures(kind: str, name: str) -> list[str]:
    """Return the picture of what is shipped under this name, as Markdown; nothing where there is none."""
    files = [FIGURES / f"{name}.png"] if kind == "sweep" else [FIGURES / f"shipped/{kind}-{name}.png"]
    return [f"![{name}](figures/{each.relative_to(FIGURES)}){{width=560px}}" for each in files if each.is_file()]


WRITERS: dict[str, Callable[[], str]] = {
    "scenarios": write_scenarios,
    "sweeps": write_sweeps,
    "robots": write_robots,
    "controllers": write_controllers,
    "measures": write_measures,
}
"""What each kind of shipped things is written by."""
