"""Names and descriptions of the scenarios, sweeps and controllers that come with the package."""

import ast
import sys
from collections.abc import Mapping

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.measures.loader import find_measure
from epuck_sim.measures.shipped import SHIPPED
from epuck_sim.scenario.yaml_io import read_yaml
from epuck_sim.util.builtin import ARENAS, CONTROLLERS, SWEEPS, builtin_files
from epuck_sim.util.messages import natural_order


def print_shipped() -> None:
    """Print the names and descriptions of all that is shipped, each kind under its heading."""
    shipped = {
        "scenarios": describe_scenarios(ARENAS),
        "sweeps": describe_scenarios(SWEEPS),
        "controllers": describe_controllers(),
    }
    for heading, descriptions in shipped.items():
        print(heading)
        _print_descriptions(descriptions)


def print_measures() -> None:
    """Print the names, the descriptions and the parameters of the shipped measures."""
    print("measures")
    _print_descriptions(describe_measures())


def _print_descriptions(descriptions: Mapping[str, str]) -> None:
    """Print a line for each name; on a terminal, descriptions are wrapped between words."""
    names = sorted(descriptions, key=natural_order)
    if not sys.stdout.isatty():
        for name in names:
            print(f"  {name:20} {descriptions[name]}")
        return
    table = Table.grid(padding=(0, 1))
    table.add_column(min_width=22, no_wrap=True)
    table.add_column(overflow="fold")
    for name in names:
        table.add_row(Text(f"  {name}"), Text(descriptions[name]))
    Console().print(table)


def describe_scenarios(kind: str) -> dict[str, str]:
    """Return the name and description of each shipped scenario of a kind, ARENAS or SWEEPS."""
    return {name: str(read_yaml(path).get("description", "")) for name, path in builtin_files(kind).items()}


def describe_controllers() -> dict[str, str]:
    """Return each shipped controller's name and the first line of its docstring."""
    docs = {
        name: ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        for name, path in builtin_files(CONTROLLERS).items()
    }
    return {name: doc.partition("\n")[0] for name, doc in docs.items()}


def describe_measures() -> dict[str, str]:
    """Return each shipped measure's name, the first line of its docstring, and its parameters with their defaults."""
    described: dict[str, str] = {}
    for name in SHIPPED:
        measure = find_measure(name)
        parameters = ", ".join(f"{key}: {default}" for key, default in measure.parameters.items())
        doc = (measure.make.__doc__ or "").partition("\n")[0]
        described[name] = f"{doc} {{{parameters}}}" if parameters else doc
    return described
