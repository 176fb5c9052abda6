"""Compilation with numba, cached on disk where no edit can leave a stale result behind.

numba alone looks only at the file of the function it caches: an edit of a helper in another file goes unnoticed.
Here each set of sources has a cache folder of its own, named after their contents.
"""

import hashlib
import os
import tempfile
import threading
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from typing import Literal, TypeVar, cast

import platformdirs
from numba import __version__ as numba_version
from numba import njit
from numba.core import config

Function = TypeVar("Function", bound=Callable[..., object])

_redirecting = threading.Lock()


def digest(sources: Iterable[Path]) -> str:
    """Return a name for the contents of `sources` and the version of numba that compiles them."""
    contents = hashlib.sha256(numba_version.encode())
    for source in sorted(sources):
        contents.update(source.name.encode() + b"\0" + source.read_bytes())
    return contents.hexdigest()[:16]


@lru_cache
def package_digest() -> str:
    """Return the digest of this package's own sources."""
    return digest(Path(__file__).parent.glob("*.py"))


@lru_cache
def cache_root() -> Path:
    """Return the folder for compiled code: $NUMBA_CACHE_DIR, else the user's cache, else a temporary one."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(chosen) if chosen else platformdirs.user_cache_path("epuck-sim")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:  # a home that cannot be written to: compile once a machine, not once a run
        user = os.getuid() if hasattr(os, "getuid") else "user"
        return Path(tempfile.gettempdir()) / f"epuck-sim-{user}"


def compile_cached(
    function: Function, sources_digest: str, division: Literal["python", "numpy"] = "python"
) -> Function:
    """Return `function` compiled by numba, cached under `sources_digest`.

    division: "python" raises where a divisor is 0, "numpy" gives inf or NaN, and is quicker.
    Neither fast-math nor parallel loops: both would break equality bit for bit.
    """
    with _redirecting:  # numba reads the folder once, when a function is decorated
        settings = vars(config)
        before = settings["CACHE_DIR"]
        settings["CACHE_DIR"] = str(cache_root() / sources_digest)
        try:
            return cast(Function, njit(cache=True, error_model=division)(function))
        finally:
            settings["CACHE_DIR"] = before


def kernel(function: Function) -> Function:
    """Compile a function of this package; helpers that it calls must be kernels too."""
    return compile_cached(function, package_digest(), division="numpy")
