"""The versions and the machine that made a result, so that anyone can obtain the same numbers again."""

import platform
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import version

import epuck_sim

ENGINES = ("pymunk", "numba", "numpy")  # names of the packages whose versions can change a result
PROVENANCE = ("epuck_sim", *ENGINES, "python", "host")  # names of the columns that describe how a stored trial was made


@lru_cache
def versions() -> dict[str, str]:
    """Return the versions of this package, of its engines and of Python, by name."""
    engines = {name: version(name) for name in ENGINES}
    return {"epuck_sim": epuck_sim.__version__, **engines, "python": platform.python_version()}


def format_versions(versions: Mapping[str, str]) -> str:
    """Return versions, and the host if it is among them, on one line.

    >>> format_versions({"numba": "0.60", "host": "lab"})
    'numba 0.60, host lab'
    """
    return ", ".join(f"{name} {value}" for name, value in versions.items())


@lru_cache
def host() -> str:
    """Return the name of this machine."""
    return platform.node()
