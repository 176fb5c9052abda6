"""The lock of a run folder: one command at a time may write to it. The lock ends with the process at the latest."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from epuck_sim.errors import StoreError
from epuck_sim.runs.schema import DATABASE
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.util.atomic_write import is_leftover
from epuck_sim.util.provenance import host

LOCK = ".lock"
"""Name of the file in a run folder that is locked."""

HOLDER = ".lock-holder"
"""Name of the file in a run folder that names the process that holds the lock.

It is a file of its own because filelock versions before 3.21 empty the locked file on every attempt to lock it.
"""

WAIT_S = 0.2
"""Time in seconds for which a lock is tried: `current_holder` of another process may have it for a moment."""


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
    if (folder / DATABASE).exists():
        return
    foreign = sorted(path.name for path in folder.iterdir() if not _may_be_left(path.name))
    if foreign:
        raise StoreError(
            f"{folder}: is not a run folder: it holds {foreign[0]!r} but no {DATABASE}; give a new or empty one"
        )


def _may_be_left(name: str) -> bool:
    """Return whether a command that was killed at once may have left a file of this name in a new folder."""
    return name in (LOCK, HOLDER) or is_leftover(name, DATABASE)


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
