"""The arenas and controllers that come with the package, found by name from any folder."""

from pathlib import Path

import epuck_sim

_PACKAGE = Path(epuck_sim.__file__).parent


ARENAS, SWEEPS, CONTROLLERS = "arenas", "arenas/sweeps", "controllers"
"""What is shipped: a folder each."""

_SUFFIX = {ARENAS: ".yaml", SWEEPS: ".yaml", CONTROLLERS: ".py"}


def builtin_folder(kind: str) -> Path:
    """Return the folder of what is shipped of a kind.

    A built wheel carries them inside the package; in a checkout they lie beside it.
    """
    inside = _PACKAGE / kind
    return inside if inside.is_dir() else _PACKAGE.parent / kind


def builtin_files(kind: str) -> dict[str, Path]:
    """Return the files that are shipped of a kind by their names, without suffix."""
    return {path.stem: path for path in sorted(builtin_folder(kind).glob(f"*{_SUFFIX[kind]}"))}
