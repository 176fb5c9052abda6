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
from typing import Any, Literal, TypeVar, cast

import platformdirs
from numba import __version__ as numba_version
from numba import njit
from numba.core import config

Function = TypeVar("Function", bound=Callable[..., object])

_redirecting = threading.Lock()


def digest(contents: Iterable[bytes]) -> str:
    """Return a name for `contents`, and for the version of numba that compiles them."""
    name = hashlib.sha256(numba_version.encode())
    for content in contents:
        name.update(hashlib.sha256(content).digest())
    return name.hexdigest()[:16]


@lru_cache
def kernel_digest() -> str:
    """Return the digest of this package's kernels: of every file that imports this module, and of the constants."""
    package = Path(__file__).parents[1]
    sources = [source.read_bytes() for source in sorted(package.rglob("*.py"))]
    constants = (package / "epuck.py").read_bytes()
    return digest([constants, *(source for source in sources if b"epuck_sim.util.jit import" in source)])


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


def compile_cached(function: Function, contents_digest: str, *, careful: bool, **options: object) -> Function:
    """Return `function` compiled by numba, cached under `contents_digest`.

    careful: a divisor of 0 and an index out of bounds raise, as in Python; else they are the function's own business.
    options: further ones of numba's.
    Neither fast-math nor parallel loops: both would break equality bit for bit.
    """
    with _redirecting:  # numba reads the folder once, when a function is decorated
        settings = vars(config)
        before = settings["CACHE_DIR"]
        settings["CACHE_DIR"] = str(cache_root() / contents_digest)
        try:
            division: Literal["python", "numpy"] = "python" if careful else "numpy"
            compiler: Any = njit  # whose types do not know all of its options
            compiled = compiler(cache=True, error_model=division, boundscheck=careful, **options)(function)
            return cast(Function, compiled)
        finally:
            settings["CACHE_DIR"] = before


def jit(function: Function) -> Function:
    """Compile a function of this package; helpers that it calls must be kernels too."""
    return compile_cached(function, kernel_digest(), careful=False)


def jit_no_alloc(function: Function) -> Function:
    """Compile a function that makes no arrays, nor do its helpers, which are lean kernels, too.

    Then nobody needs to count who uses an array, which takes longer than what small functions do; and it is an error
    to make one.
    """
    return compile_cached(function, kernel_digest(), careful=False, _nrt=False)


def jit_inline(function: Function) -> Function:
    """Compile a lean kernel that is written in place wherever it is called: to hand over many arrays takes time."""
    return compile_cached(function, kernel_digest(), careful=False, _nrt=False, forceinline=True)
