"""Names and descriptions of what comes with the package, for `epuck-sim list`."""

import ast

from epuck_sim.scenario.yaml_io import read_yaml
from epuck_sim.util.builtin import CONTROLLERS, builtin_files


def describe_scenarios(kind: str) -> dict[str, str]:
    """Return the name and description of each shipped arena or sweep."""
    return {name: str(read_yaml(path).get("description", "")) for name, path in builtin_files(kind).items()}


def describe_controllers() -> dict[str, str]:
    """Return each shipped controller's name and the first line of its docstring."""
    docs = {
        name: ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        for name, path in builtin_files(CONTROLLERS).items()
    }
    return {name: doc.partition("\n")[0] for name, doc in docs.items()}
