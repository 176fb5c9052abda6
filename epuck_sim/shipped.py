"""The arenas and controllers that come with the package, found by name from any folder."""

import ast
from pathlib import Path

import epuck_sim
from epuck_sim.yaml_reader import read_yaml

_PACKAGE = Path(epuck_sim.__file__).parent


def shipped_folder(kind: str) -> Path:
    """Return the folder of the shipped `kind`, "arenas" or "controllers".

    A built wheel carries them inside the package; in a checkout they lie beside it.
    """
    inside = _PACKAGE / kind
    return inside if inside.is_dir() else _PACKAGE.parent / kind


def shipped_names(kind: str, suffix: str) -> list[str]:
    """Return the names, without suffix, of what is shipped."""
    return sorted(path.stem for path in shipped_folder(kind).glob(f"*{suffix}"))


def describe_arenas() -> dict[str, str]:
    """Return each shipped arena's name and description."""
    folder = shipped_folder("arenas")
    names = shipped_names("arenas", ".yaml")
    return {name: str(read_yaml(folder / f"{name}.yaml").get("description", "")) for name in names}


def describe_controllers() -> dict[str, str]:
    """Return each shipped controller's name and the first line of its docstring."""
    folder = shipped_folder("controllers")
    docs = {
        name: ast.get_docstring(ast.parse((folder / f"{name}.py").read_text(encoding="utf-8"))) or ""
        for name in shipped_names("controllers", ".py")
    }
    return {name: doc.partition("\n")[0] for name, doc in docs.items()}
