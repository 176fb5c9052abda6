"""What not every system has: users with numbers, limits of a process, signals. Where one is missing, none applies."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import resource
except ImportError:  # on Windows
    resource = None  # type: ignore[assignment]

USER = os.getuid() if hasattr(os, "getuid") else None
"""Number of the user who runs this process; None where users have none."""


def is_ours(path: Path) -> bool:
    """Return whether a file or folder, not what a link leads to, belongs to this user."""
    return USER is None or path.lstat().st_uid == USER


def is_open_to_others(path: Path) -> bool:
    """Return whether other users can write to a file or folder, as its mode has it."""
    return USER is not None and bool(path.lstat().st_mode & 0o022)


def signals(*names: str) -> tuple[signal.Signals, ...]:
    """Return the signals of these names that this system has."""
    return tuple(signal.Signals[name] for name in names if hasattr(signal, name))


@contextmanager
def blocked(*names: str) -> Iterator[None]:
    """Leave signals to this process: processes started in the block, and their children, do not receive them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals(*names))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def address_space() -> int | None:
    """Return how many bytes of addresses this process may take in all (`ulimit -v`); None if there is no limit."""
    if resource is None:
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def allow_files(needed: int) -> int | None:
    """Have this process keep this many files open, if it may; return how many it may where that is less."""
    if resource is None:
        return None
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if resource.RLIM_INFINITY != hard < needed:
        return hard
    if resource.RLIM_INFINITY != soft < needed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
    return None
