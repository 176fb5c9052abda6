"""Compiles firmware with the system's C compiler, once for each contents, into the folder of compiled code."""

import hashlib
import os
import re
import shlex
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from epuck_sim.errors import ControllerError
from epuck_sim.util.cache_folder import UNUSED_S, cache_root

HEADERS = Path(__file__).with_name("include")
"""Folder of the header `epuck.h`."""

# no product and sum become one operation, which rounds once instead of twice: so Python computes, and other processors
FLAGS = ("-std=gnu11", "-O2", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-g1")
"""Options of the compiler."""

ERRORS = ("-Werror=implicit-function-declaration", "-Werror=incompatible-pointer-types", "-Werror=int-conversion")
"""Warnings that are errors in newer versions of C."""

OWN_VARIABLES = {"memory", "parameters", "e_swarm", "e_robot", "e_refusal"}
"""Variables of the header, which are the thread's."""

SHARED_RANDOM = {"rand", "srand", "random", "srandom", "drand48", "srand48", "lrand48", "rand_r"}
"""Functions whose random numbers do not come from the robot's own stream."""


class Built(NamedTuple):
    """A library, and what it was made from."""

    library: Path
    sources: Mapping[Path, bytes]
    """Contents of the files that it was made from, but the compiler's own."""


def keep_library(path: Path) -> Built:
    """Return a copy of a library under a name made from its contents: one that was loaded must not change."""
    contents = path.read_bytes()
    return Built(_library([contents], lambda part: part.write_bytes(contents)), {path: contents})


def build_library(path: Path) -> Built:
    """Return the library of a C file; it is compiled unless it was from the same contents by the same compiler.

    Raises:
        ControllerError: There is no compiler, it refuses the file, or robots would share a variable.
    """
    compiler = _find_compiler(path)
    sources = {file: file.read_bytes() for file in _files_of(path, compiler)}
    settings = repr((compiler, _version(compiler), FLAGS, ERRORS)).encode()

    def build(part: Path) -> None:
        code = part.with_name("code.o")
        _run(path, [*compiler, *FLAGS, *ERRORS, "-isystem", HEADERS, "-c", path, "-o", code])
        _reject_shared(path, code, sources[path])
        _run(path, [*compiler, "-shared", "-Wl,-z,defs", code, "-o", part, "-lm"])

    contents = [settings, (HEADERS / "epuck.h").read_bytes(), *sources.values()]
    return Built(_library(contents, build), sources)


def _find_compiler(path: Path) -> tuple[str, ...]:
    command = tuple(shlex.split(os.environ.get("CC", "cc"))) or ("cc",)
    if shutil.which(command[0]) is None:
        raise ControllerError(
            f"{path}: needs a C compiler, and {command[0]} is not found; install gcc or clang, name one in CC, or give "
            "the library (.so) that the file was compiled to elsewhere"
        )
    return command


@lru_cache
def _version(compiler: tuple[str, ...]) -> str:
    return subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False).stdout


def _files_of(path: Path, compiler: Sequence[str]) -> list[Path]:
    rule = _run(path, [*compiler, *FLAGS, "-isystem", HEADERS, "-MM", path])
    _, _, files = rule.replace("\\\n", " ").partition(":")
    own = [Path(file).resolve() for file in shlex.split(files)]
    return [path, *(file for file in own if file != path)]


def _run(path: Path, command: Sequence[str | Path]) -> str:
    """Return what a command prints; raise ControllerError with its own words if it fails."""
    run = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False, errors="replace")
    if run.returncode:
        said = "\n".join(f"  {line}" for line in (run.stderr or run.stdout).splitlines())
        raise ControllerError(f"{path}: {command[0]} cannot compile it:\n{said}")
    return run.stdout


def _reject_shared(path: Path, code: Path, source: bytes) -> None:
    """Raise ControllerError for variables, and for random numbers, that all robots would share."""
    lister = shutil.which("nm")
    if lister is None:
        return
    listed = subprocess.run([lister, "-f", "sysv", code], capture_output=True, text=True, check=False).stdout
    rows = [[part.strip() for part in line.split("|")] for line in listed.splitlines() if line.count("|") == 6]
    for name, _, kind, _, _, _, section in rows:
        plain = name.partition(".")[0]  # `count.0` is a variable inside a function
        is_variable = kind in "bBdDC" and not section.startswith(".data.rel.ro")
        if is_variable and plain not in OWN_VARIABLES:
            raise ControllerError(
                f"{path}:{_line_of(plain, source)}: {plain!r} is a variable that all robots would share; make it "
                "a part of MEMORY, where each robot has its own, or const"
            )
        if kind == "U" and plain in SHARED_RANDOM:
            raise ControllerError(
                f"{path}:{_line_of(plain, source)}: {plain}() is shared by all robots; use e_randint() or e_uniform()"
            )


def _line_of(name: str, source: bytes) -> int:
    lines = source.decode(errors="replace").splitlines()
    return next((number for number, line in enumerate(lines, 1) if re.search(rf"\b{re.escape(name)}\b", line)), 1)


def _library(contents: Iterable[bytes], make: Callable[[Path], object]) -> Path:
    """Return the library that is made from these contents, marked as used now; those unused for a month are removed."""
    folder = cache_root() / "firmware"
    folder.mkdir(parents=True, exist_ok=True)
    name = hashlib.sha256(b"".join(hashlib.sha256(each).digest() for each in contents))
    library = folder / f"{name.hexdigest()[:32]}.so"
    if library.exists():
        os.utime(library)
    else:
        with tempfile.TemporaryDirectory(dir=folder) as own:
            part = Path(own) / "library"
            make(part)
            part.replace(library)
    for other in folder.glob("*.so"):
        with suppress(OSError):  # another process is removing it
            if other.stat().st_mtime < time.time() - UNUSED_S:
                other.unlink()
    return library
