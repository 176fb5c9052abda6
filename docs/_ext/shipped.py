"""Writes the reference of what is shipped: scenarios, sweeps, robots, controllers, measures, with line and picture."""

import ast
from pathlib import Path

from epuck_sim.cli.listing import list_measures, list_names
from epuck_sim.util.builtin import CONTROLLERS, ROBOTS, builtin_files

FIGURES = Path(__file__).parent.parent / "figures"
"""Folder of the pictures: of sweeps named after them, of others in `shipped`."""


KINDS = ("scenarios", "sweeps", "robots", "controllers", "measures")


def write(kind: str) -> str:
    """Return what is shipped of a kind as Markdown: a section for each name, with description, file and picture."""
    parts = []
    for name, description in (list_measures() if kind == "measures" else list_names())[kind].items():
        parts += [f"### `{name}`", description]
        if kind == "controllers":
            parts.append(
                f"```python\n{_parameters_in(builtin_files(CONTROLLERS)[name].read_text(encoding='utf-8'))}\n```"
            )
        if kind == "robots":
            parts.append(f"```yaml\n{builtin_files(ROBOTS)[name].read_text(encoding='utf-8')}```")
        picture = f"{name}.png" if kind == "sweeps" else f"shipped/{kind[:-1]}-{name}.png"
        if (FIGURES / picture).is_file():
            parts.append(f"![{name}](figures/{picture}){{width=560px}}")
    return "\n\n".join(parts)


def _parameters_in(source: str) -> str:
    """Return the lines of a controller's file that declare its parameters."""
    for statement in ast.parse(source).body:
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == "PARAMETERS":
            return "\n".join(source.splitlines()[statement.lineno - 1 : statement.end_lineno])
    return "PARAMETERS = {}"
