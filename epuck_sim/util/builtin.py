"""The arenas and controllers that come with the package, found by name from any folder."""

import ast
from pathlib import Path

import epuck_sim
from epuck_sim.scenario.yaml_io import read_yaml

_PACKAGE = Path(epuck_sim.__file__).parent


ARENAS, SWEEPS, CONTROLLERS = "arenas", "arenas/sweeps", "controllers"
"""What is shipped: a folder each."""

_SUFFIX = {ARENAS: ".yaml", SWEEPS: ".yaml", CONTROLLERS: ".py"}


def shipped_folder(kind: str) -> Path:
    """Return the folder of what is shipped of a kind.

    A built wheel carries them inside the package; in a checkout they lie beside it.
    """
    inside = _PACKAGE / kind
    return inside if inside.is_dir() else _PACKAGE.parent / kind


def shipped_files(kind: str) -> dict[str, Path]:
    """Return the files that are shipped of a kind by their names, without suffix."""
    return {path.stem: path for path in sorted(shipped_folder(kind).glob(f"*{_SUFFIX[kind]}"))}


def describe_scenarios(kind: str) -> dict[str, str]:
    """Return the name and description of each shipped arena or sweep."""
    return {name: str(read_yaml(path).get("description", "")) for name, path in shipped_files(kind).items()}


def describe_controllers() -> dict[str, str]:
    """Return each shipped controller's name and the first line of its docstring."""
    docs = {
        name: ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        for name, path in shipped_files(CONTROLLERS).items()
    }
    return {name: doc.partition("\n")[0] for name, doc in docs.items()}
