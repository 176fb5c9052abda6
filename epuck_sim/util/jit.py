"""Compilation with numba, cached on disk in such a way that no edit can leave stale code behind.

Each set of sources has a cache folder of its own, named after their contents. numba is loaded when the first function
is compiled or called: a process that only reads users' files, which import kernels, does not load it.
"""

import hashlib
import os
import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cached_property, lru_cache
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

from epuck_sim.util.cache_folder import cache_root, remove_unused

Function = TypeVar("Function", bound=Callable[..., object])

PACKAGE = Path(__file__).parents[1]  # folder of the package

SHARED = ("util", "control")
"""Rooms on whose kernels and values those of all others may depend, beside the files of the package's root."""

VALUE_FILES = (
    *("arena.py", "elementary.py", "epuck.py", "faults.py"),
    *("util/native.py", "control/interface.py", "embodied/own_sensors.py", "embodied/swarm.py"),
)
"""Files outside of rooms, or without kernels, on whose functions, constants, types or options compiled code depends."""

WITHOUT_ALLOCATION = {"_nrt": False}
"""Option of numba with which a function that allocates an array is refused, and nothing counts references."""


def digest(contents: Iterable[bytes]) -> str:
    """Return 16 hexadecimal digits that stand for `contents` and for the version of numba."""
    from numba import __version__ as numba_version

    name = hashlib.sha256(numba_version.encode())
    for content in contents:
        name.update(hashlib.sha256(content).digest())
    return name.hexdigest()[:16]


def kernel_files(room: str, package: Path = PACKAGE) -> list[Path]:
    """Return all files that a room's kernels depend on, so that an edit of one room leaves the others' compiled."""
    rooms = sorted({*SHARED, room})
    values = [package / name for name in VALUE_FILES if "/" not in name or name.partition("/")[0] in rooms]
    sources = [path for each in rooms for path in sorted((package / each).rglob("*.py"))]
    return [*values, *(path for path in sources if b"epuck_sim.util.jit import" in path.read_bytes())]


@lru_cache
def kernel_digest(room: str = "util", package: Path = PACKAGE) -> str:
    """Return the digest of all files that the kernels of a room depend on."""
    return digest(path.read_bytes() for path in kernel_files(room, package))


def digest_of_room(function: Any) -> str:
    """Return the digest of all files that the kernels of a function's room depend on."""
    return kernel_digest(function.__module__.partition(".")[2].partition(".")[0])  # tests mirror the rooms


def open_cache(contents_digest: str) -> Path:
    """Return the cache folder of these contents, marked as used now; unused ones are removed when a new one is made."""
    folder = cache_root() / contents_digest
    with suppress(OSError):  # what cannot be kept is said when it is written
        try:
            os.utime(folder)
        except FileNotFoundError:
            folder = cache_root(to_fill=True) / contents_digest
            folder.mkdir(parents=True, exist_ok=True)
            remove_unused(folder.parent.iterdir(), is_cache)
    return folder


def is_cache(folder: Path) -> bool:
    """Return whether a folder has a digest as its name and holds nothing but compiled code, and indices of old ones."""
    if not re.fullmatch("[0-9a-f]{16}", folder.name) or folder.is_symlink() or not folder.is_dir():
        return False
    return all(path.is_dir() or ".nbi" in path.name or ".nbc" in path.name for path in folder.rglob("*"))


def bind(function: Any, **names: object) -> Any:
    """Return a copy of a function in which these global names have these values."""
    bound = FunctionType(function.__code__, {**function.__globals__, **names})
    bound.__annotations__ = function.__annotations__
    return bound


def name_after(function: Any, contents_digest: str) -> Any:
    """Name a function after its contents: numba knows it by name, types and a count, and could take another for it."""
    function.__qualname__ = f"{function.__name__}_{contents_digest}"
    return function


class Kernel:
    """A function of this package that Python and compiled code can call; what it calls must be kernels, too."""

    def __init__(self, function: Any, **options: Any) -> None:
        self.function, self._options = function, options
        self.__doc__ = function.__doc__

    @cached_property
    def for_python(self) -> Any:
        """The function as Python calls it."""
        from epuck_sim.util.native import compile_cached

        return compile_cached(self.function, digest_of_room(self.function), careful=False, **self._options)

    @cached_property
    def part(self) -> Any:
        """The function as a part of others."""
        from epuck_sim.util.native import compile_part

        return compile_part(self.function, error_model="numpy", **self._options)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the function from Python."""
        return self.for_python(*arguments, **named)


def jit(function: Function) -> Function:
    """Return a kernel that may allocate arrays."""
    return cast(Function, Kernel(function))


def jit_no_alloc(function: Function) -> Function:
    """Return a kernel that allocates no arrays, nor does what it calls: counting references takes long."""
    return cast(Function, Kernel(function, **WITHOUT_ALLOCATION))


def jit_inline(function: Function) -> Function:
    """Return a kernel as `jit_no_alloc` does, which is inlined wherever it is called: passing arrays takes time."""
    return cast(Function, Kernel(function, forceinline=True, **WITHOUT_ALLOCATION))
