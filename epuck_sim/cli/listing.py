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


def describe_shipped() -> dict[str, dict[str, str]]:
    """Return the names and descriptions of the scenarios, sweeps and controllers, by kind."""
    return {
        "scenarios": _in_order(describe_scenarios(ARENAS)),
        "sweeps": _in_order(describe_scenarios(SWEEPS)),
        "controllers": _in_order(describe_controllers()),
    }


def list_measures() -> dict[str, dict[str, str]]:
    """Return the names and descriptions of the measures, as one kind."""
    return {"measures": _in_order(describe_measures())}


def print_descriptions(kinds: Mapping[str, Mapping[str, str]]) -> None:
    """Print a heading for each kind and a line for each name; on a terminal, descriptions are wrapped between words."""
    for kind, descriptions in kinds.items():
        print(kind)
        if not sys.stdout.isatty():
            for name, description in descriptions.items():
                print(f"  {name:20} {description}")
            continue
        table = Table.grid(padding=(0, 1))
        table.add_column(min_width=22, no_wrap=True)
        table.add_column(overflow="fold")
        for name, description in descriptions.items():
            table.add_row(Text(f"  {name}"), Text(description))
        Console().print(table)


def _in_order(descriptions: Mapping[str, str]) -> dict[str, str]:
    return {name: descriptions[name] for name in sorted(descriptions, key=natural_order)}


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
