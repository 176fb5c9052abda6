"""Which versions made a result, and where, so that anyone can get the same numbers again."""

import platform
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import version

import epuck_sim

ENGINES = ("pymunk", "numba", "numpy")

PROVENANCE = ("epuck_sim", *ENGINES, "python", "host")
"""What a stored trial says of its making."""


@lru_cache
def versions() -> dict[str, str]:
    """Return the versions of this package, of what computes for it, and of Python."""
    engines = {name: version(name) for name in ENGINES}
    return {"epuck_sim": epuck_sim.__version__, **engines, "python": platform.python_version()}


def in_text(made_by: Mapping[str, str]) -> str:
    """Return versions, and the host if it is there, on a line."""
    return ", ".join(f"{name} {value}" for name, value in made_by.items())


@lru_cache
def host() -> str:
    """Return the name of this machine."""
    return platform.node()
