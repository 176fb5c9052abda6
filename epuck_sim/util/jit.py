"""Compilation with numba, cached on disk in such a way that no edit can leave stale code behind.

numba alone compares only the file of the function that it caches: an edit of a helper in another file goes unnoticed.
Here each set of sources has a cache folder of its own, named after their contents. Folders that have not been used for
a month are removed.
"""

import hashlib
import os
import re
import shutil
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from types import FunctionType
from typing import Any, Literal, TypeVar, cast

from llvmlite import ir
from numba import __version__ as numba_version
from numba import njit
from numba.core import config, types
from numba.extending import intrinsic

from epuck_sim.util.cache_folder import UNUSED_S, USER, cache_root
from epuck_sim.util.kernel import Kernel

Function = TypeVar("Function", bound=Callable[..., object])

PACKAGE = Path(__file__).parents[1]
"""Folder of the package."""

VALUE_FILES = (
    *("epuck.py", "control/error_lines.py", "control/interface.py"),
    *("embodied/faulty_swarm.py", "embodied/rigid_bodies.py", "particles/rules.py"),
    "util/kernel.py",
)
"""Files without kernels on whose constants, types or ways of compiling compiled code depends."""

_redirecting = threading.Lock()


def digest(contents: Iterable[bytes]) -> str:
    """Return 16 hexadecimal digits that stand for `contents` and for the version of numba."""
    name = hashlib.sha256(numba_version.encode())
    for content in contents:
        name.update(hashlib.sha256(content).digest())
    return name.hexdigest()[:16]


@lru_cache
def kernel_digest(package: Path = PACKAGE) -> str:
    """Return the digest of all files that the package's kernels depend on.

    These are the files which import this module, and `VALUE_FILES`; a test makes sure that there are no others.
    """
    values = [(package / name).read_bytes() for name in VALUE_FILES]
    sources = [source.read_bytes() for source in sorted(package.rglob("*.py"))]
    return digest([*values, *(source for source in sources if b"epuck_sim.util.jit import" in source)])


def _open_cache(contents_digest: str) -> Path:
    """Return the cache folder of these contents, marked as used now; unused ones are removed when a new one is made."""
    folder = cache_root() / contents_digest
    with suppress(OSError):  # numba copes with a folder that it cannot use
        try:
            os.utime(folder)
        except FileNotFoundError:
            folder.mkdir(parents=True, exist_ok=True)
            remove_unused_caches(folder.parent)
    return folder


def remove_unused_caches(root: Path) -> None:
    """Remove the cache folders in `root` that no process has used for `UNUSED_S`.

    Folders of other users or programs stay. A process that uses one meanwhile finds nothing there and compiles anew.
    """
    limit_s = time.time() - UNUSED_S
    for folder in root.iterdir():
        with suppress(OSError):  # another process is removing it
            status = folder.lstat()
            if status.st_mtime < limit_s and status.st_uid == USER and _is_cache(folder):
                shutil.rmtree(folder)


def _is_cache(folder: Path) -> bool:
    """Return whether a folder has a digest as its name and holds nothing but numba's index and data files."""
    if not re.fullmatch("[0-9a-f]{16}", folder.name) or folder.is_symlink() or not folder.is_dir():
        return False
    return all(path.is_dir() or ".nbi" in path.name or ".nbc" in path.name for path in folder.rglob("*"))


def bind(function: Any, **names: object) -> Any:
    """Return a copy of a function in which these global names have these values."""
    bound = FunctionType(function.__code__, {**function.__globals__, **names})
    bound.__annotations__ = function.__annotations__
    return bound


def name_after(function: Any, contents_digest: str) -> Any:
    """Name a function after the contents that it is compiled from, and return it.

    numba finds compiled code by the function's name, the types of its arguments, and a number that counts the functions
    of the process that compiled it. Two functions from the cache, of two processes, may have all three in common: one
    of them would be called for the other.
    """
    function.__qualname__ = f"{function.__name__}_{contents_digest}"
    return function


def compile_cached(function: Function, contents_digest: str, *, careful: bool, **options: object) -> Function:
    """Return `function` compiled by numba, without fast-math and parallel loops: outcomes stay equal bit for bit.

    Args:
        function: What to compile, when it is first called.
        contents_digest: The `digest` of everything that the compiled code depends on; names the cache folder.
        careful: Whether a division by 0 and an index out of bounds raise, as in Python; else they are undefined.
        options: Further options of numba's `njit`.
    """
    with _redirecting:  # numba reads the folder once, when a function is decorated
        settings = vars(config)
        before = settings["CACHE_DIR"]
        settings["CACHE_DIR"] = str(_open_cache(contents_digest))
        try:
            division: Literal["python", "numpy"] = "python" if careful else "numpy"
            compiler: Any = njit  # its types lack some of its options
            compiled = compiler(cache=True, error_model=division, boundscheck=careful, **options)(function)
            return cast(Function, compiled)
        finally:
            settings["CACHE_DIR"] = before


def _kernel(function: Function, **options: object) -> Function:
    """Return a kernel of this package; the functions that it calls must be kernels, too."""
    for_python: Any = compile_cached(function, kernel_digest(), careful=False, **options)
    return cast(Function, Kernel(function, for_python, error_model="numpy", **options))


def jit(function: Function) -> Function:
    """Return a kernel that may allocate arrays."""
    return _kernel(function)


def jit_no_alloc(function: Function) -> Function:
    """Return a kernel that allocates no arrays: it is an error if it, or a function that it calls, does.

    Without allocations there is no reference counting, which takes longer than the work of small kernels.
    """
    return _kernel(function, _nrt=False)


def jit_nogil(function: Function) -> Function:
    """Return a kernel as `jit_no_alloc` does, that lets other threads run when Python calls it."""
    return _kernel(function, _nrt=False, nogil=True)


def jit_inline(function: Function) -> Function:
    """Return a kernel as `jit_no_alloc` does, which is inlined wherever it is called: passing arrays takes time."""
    return _kernel(function, _nrt=False, forceinline=True)


_intrinsic: Callable[[Callable[..., Any]], Any] = intrinsic  # its own type leaves the context among the arguments


@_intrinsic
def unlikely(context: Any, flag: Any) -> Any:  # noqa: ARG001
    """Return a flag, which compiled code expects to be false: what it leads to is laid out of the way of the rest."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        boolean = ir.IntType(1)
        kind = ir.FunctionType(boolean, [boolean, boolean])
        expect = builder.module.declare_intrinsic("llvm.expect", [boolean], kind)
        return builder.call(expect, [*arguments, boolean(0)])

    return types.boolean(types.boolean), generate
