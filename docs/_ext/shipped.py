"""Writes the reference of what is shipped: scenarios, sweeps, controllers and measures, each with its one line."""

import ast
from collections.abc import Callable, Mapping
from pathlib import Path

from epuck_sim.cli.listing import describe_shipped, list_measures
from epuck_sim.util.builtin import CONTROLLERS, builtin_files

FIGURES = Path(__file__).parent.parent / "figures"
"""Folder of the pictures, some of which are named after what is shipped."""


def write_scenarios() -> str:
    """Return the shipped scenarios as Markdown."""
    return _write_with_pictures(describe_shipped()["scenarios"])


def write_sweeps() -> str:
    """Return the shipped sweeps as Markdown."""
    return _write_with_pictures(describe_shipped()["sweeps"])


def write_measures() -> str:
    """Return the shipped measures as Markdown."""
    return _write_table(list_measures()["measures"])


def write_controllers() -> str:
    """Return the shipped controllers as Markdown: what each does, and its parameters as its file declares them."""
    files = builtin_files(CONTROLLERS)
    parts = []
    for name, description in describe_shipped()["controllers"].items():
        source = files[name].read_text(encoding="utf-8")
        parts += [f"### `{name}`", description, f"```python\n{_parameters_in(source)}\n```"]
    return "\n\n".join(parts)


def _parameters_in(source: str) -> str:
    """Return the lines of a controller's file that declare its parameters."""
    for statement in ast.parse(source).body:
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == "PARAMETERS":
            return "\n".join(source.splitlines()[statement.lineno - 1 : statement.end_lineno])
    return "PARAMETERS = {}"


def _write_with_pictures(descriptions: Mapping[str, str]) -> str:
    """Return a section for each name: its description, and its picture if there is one."""
    parts = []
    for name, description in descriptions.items():
        parts += [f"### `{name}`", description]
        pictures = [FIGURES / f"{name}.png", FIGURES / f"gallery-{name}.png"]
        parts += [f"![{description}](figures/{each.name}){{width=560px}}" for each in pictures if each.is_file()]
    return "\n\n".join(parts)


def _write_table(descriptions: Mapping[str, str]) -> str:
    rows = [f"| `{name}` | {_escaped(description)} |" for name, description in descriptions.items()]
    return "\n".join(["| | |", "| --- | --- |", *rows])


def _escaped(text: str) -> str:
    return text.replace("|", r"\|")


WRITERS: dict[str, Callable[[], str]] = {
    "scenarios": write_scenarios,
    "sweeps": write_sweeps,
    "controllers": write_controllers,
    "measures": write_measures,
}
"""What each kind of shipped things is written by."""
