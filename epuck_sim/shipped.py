"""The arenas and controllers that come with the package, found by name from any folder."""

from pathlib import Path

import epuck_sim

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
