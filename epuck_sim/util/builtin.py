"""The arenas, sweeps, robots and controllers that come with the package, found by name from any folder."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

import epuck_sim

_PACKAGE = Path(epuck_sim.__file__).resolve().parent

ARENAS, SWEEPS, ROBOTS, CONTROLLERS = "arenas", "arenas/sweeps", "arenas/robots", "controllers"
"""Kinds of files, and their folders: arenas with one scenario each, sweeps of scenarios, robots, their controllers."""

TEMPLATES = "arenas/new"
"""Folder of the commented files that `epuck-sim new` copies: NAME in them stands for the name that the user gives."""


def builtin_folder(kind: str) -> Path:
    """Return the folder of the built-in files of a kind: inside the package if installed, beside it in a checkout."""
    inside = _PACKAGE / kind
    return inside if inside.is_dir() else _PACKAGE.parent / kind


@cache
def builtin_files(kind: str) -> Mapping[str, Path]:
    """Return the built-in files of a kind by their names, which have no suffix."""
    files = builtin_folder(kind).glob("*.py" if kind == CONTROLLERS else "*.yaml")
    return MappingProxyType({path.stem: path for path in sorted(files)})
