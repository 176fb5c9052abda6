"""Which versions made a result, so that anyone can get the same numbers again."""

import platform
from importlib.metadata import version

import epuck_sim

ENGINES = ("pymunk", "numba", "numpy")


def versions() -> dict[str, str]:
    """Return the versions of this package, of what computes for it, and of Python."""
    engines = {name: version(name) for name in ENGINES}
    return {"epuck_sim": epuck_sim.__version__, **engines, "python": platform.python_version()}
