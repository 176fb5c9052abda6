"""A run folder: the names of its files, and its lock, with which one command at a time writes to it."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from epuck_sim.errors import StoreError
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.util.atomic_write import is_leftover
from epuck_sim.util.provenance import host

DATABASE = "results.sqlite"
"""Name of the file that holds a row for each trial."""

STORED = ".stored"
"""Name of the file that says how many trials a run has stored, until SQLite's log is in the database."""

LOCK = ".lock"
"""Name of the file that is locked; the lock ends with the process at the latest."""

HOLDER = ".lock-holder"
"""Name of the file that names the process which holds the lock.

It is a file of its own because filelock versions before 3.21 empty the locked file on every attempt to lock it.
"""

WAIT_S = 0.2
"""Time in seconds for which a lock is tried: `current_holder` of another process may have it for a moment."""


def database_of(folder: Path | str) -> Path:
    """Return the run folder's database; raise StoreError if there is none."""
    if not (Path(folder) / DATABASE).is_file():
        raise StoreError(f"{folder}: is not a run folder: there is no {DATABASE} in it")
    return Path(folder) / DATABASE


@contextmanager
def acquire(folder: Path) -> Iterator[None]:
    """Make the folder if it does not exist, and hold its lock while the block lasts.

    Raises:
        StoreError: The folder cannot be made, is not a run folder, or is locked by another process.
    """
    from filelock import FileLock, Timeout  # noqa: PLC0415 it loads asyncio, and results are read without locks

    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _check_no_foreign_files(folder)
            stack.enter_context(FileLock(folder / LOCK, timeout=WAIT_S, thread_local=False))
            for path in folder.iterdir():
                if is_leftover(path.name, DATABASE) or is_leftover(path.name, RUN_SCENARIO):
                    path.unlink()  # nobody else writes here: a killed command has left it
            stack.callback((folder / HOLDER).unlink, missing_ok=True)
            (folder / HOLDER).write_text(f"process {os.getpid()} on {host()}", encoding="utf-8")
        except Timeout as error:
            raise StoreError(f"{folder}: {_holder(folder)} is at work on it; wait until it ends, or stop it") from error
        except OSError as error:
            raise StoreError(f"{folder}: cannot be used as a run folder: {error.strerror}") from error
        yield


def _check_no_foreign_files(folder: Path) -> None:
    names = sorted(path.name for path in folder.iterdir())
    # a command that was killed at once leaves these
    foreign = [name for name in names if name not in (LOCK, HOLDER) and not is_leftover(name, DATABASE)]
    if foreign and DATABASE not in names:
        raise StoreError(
            f"{folder}: is not a run folder: it holds {foreign[0]!r} but no {DATABASE}; give a new or empty one"
        )


def current_holder(folder: Path) -> str | None:
    """Return the process that holds the lock of a run folder.

    Returns:
        None if no process holds it, or if this user may not lock files there and so cannot find out.
    """
    if not (folder / LOCK).is_file():
        return None
    from filelock import FileLock, Timeout  # noqa: PLC0415 see `acquire`

    try:
        with FileLock(folder / LOCK).acquire(blocking=False):
            return None
    except Timeout:
        return _holder(folder)
    except OSError:
        return None


def _holder(folder: Path) -> str:
    try:
        return (folder / HOLDER).read_text(encoding="utf-8") or "another process"
    except OSError:
        return "another process"
