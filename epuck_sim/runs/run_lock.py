"""One command at a time: whoever writes to a run folder holds its lock, which ends with the process at the latest."""

import fcntl
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

from epuck_sim.runs.database import DATABASE
from epuck_sim.errors import StoreError
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.util.atomic_write import is_leftover
from epuck_sim.util.provenance import host

LOCK = ".lock"
"""In a run folder; names the process that holds it."""


def acquire(folder: Path) -> IO[str]:
    """Make the folder if it is not there and return its lock, held until it is closed.

    Raises StoreError where the folder cannot be made, is no run folder, or is held by another process.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / DATABASE).exists():
            names = sorted(path.name for path in folder.iterdir())
            foreign = [name for name in names if name != LOCK and not is_leftover(name, DATABASE)]
            if foreign:
                raise StoreError(
                    f"{folder}: is no run folder: it holds {foreign[0]!r} but no {DATABASE}; give a new or empty one"
                )
        lock = (folder / LOCK).open("a+", encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{folder}: cannot be used as a run folder: {error.strerror}") from error
    try:
        _lock_patiently(lock)
    except BlockingIOError as error:
        lock.seek(0)
        holder = lock.read() or "another process"
        lock.close()
        raise StoreError(f"{folder}: {holder} is at work on it; wait until it ends, or stop it") from error
    for path in folder.iterdir():
        if is_leftover(path.name, DATABASE) or is_leftover(path.name, RUN_SCENARIO):
            path.unlink()  # nobody else writes here: a killed command has left it
    lock.truncate(0)
    lock.write(f"process {os.getpid()} on {host()}")
    lock.flush()
    return lock


def _lock_patiently(lock: IO[str]) -> None:
    """Lock the file; `current_holder` may have it for a moment."""
    for _ in range(3):
        with suppress(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        time.sleep(0.05)
    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)


def current_holder(folder: Path) -> str | None:
    """Return who is at work on the folder; None if nobody is."""
    try:
        with (folder / LOCK).open(encoding="utf-8") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return (folder / LOCK).read_text(encoding="utf-8") or "another process"
    except OSError:
        return None
    return None
