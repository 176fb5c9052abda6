"""A run folder: the names of its files, and its lock, which lets one command at a time write to it.

The lock is one of the system's, which ends with its process. Where the file system has no locks, the file `HOLDER` is
a lease: its process renews it while it is at work, and a lease that was not renewed for `LEASE_S` has ended.
"""

import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import BinaryIO

from epuck_sim.errors import StoreError
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.util.atomic_write import is_leftover, temporary_path
from epuck_sim.util.provenance import host

try:
    import fcntl
except ImportError:  # on Windows, where every run folder has a lease
    fcntl = None  # type: ignore[assignment]

DATABASE = "results.sqlite"  # name of the file that holds a row for each trial
STORED = ".stored"  # name of the file with the number of stored trials, until SQLite's log is merged into the database
LOCK = ".lock"  # name of the file that is locked; the lock ends with the process at the latest
HOLDER = ".lock-holder"  # name of the file that names the process which holds the lock, or the lease
WAIT_S = 0.2  # time in seconds for which a lock is tried: `current_holder` of another process may have it for a moment
RENEW_S, LEASE_S = 10.0, 60.0  # times in seconds between two renewals of a lease, and from the last one to its end
SETTLE_S = 0.5  # time in seconds after which, if several processes take a lease at once, the last one has it


def database_of(folder: Path | str) -> Path:
    """Return the run folder's database; raise StoreError if there is none."""
    if not (Path(folder) / DATABASE).is_file():
        lacks = f"there is no {DATABASE} in it" if Path(folder).is_dir() else "there is no such folder"
        raise StoreError(f"{folder}: is not a run folder: {lacks}")
    return Path(folder) / DATABASE


@contextmanager
def acquire(folder: Path) -> Iterator[Callable[[], bool]]:
    """Make a run folder if there is none, and lock or lease it in the block; yield a test whether it is still held."""
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _check_no_foreign_files(folder)
            lock = stack.enter_context((folder / LOCK).open("ab"))
            if _is_leased(folder):
                is_held = stack.enter_context(_lease(folder))
            else:
                _lock(lock, WAIT_S)
                (folder / HOLDER).write_text(own_name(), encoding="utf-8")
                is_held = partial(is_at, folder / LOCK, os.fstat(lock.fileno()))

            @stack.callback
            def let_go() -> None:
                with suppress(OSError):  # if it stays, nothing is the matter
                    if is_held():
                        (folder / HOLDER).unlink()

            for path in folder.iterdir():
                if is_leftover(path.name, DATABASE) or is_leftover(path.name, RUN_SCENARIO):
                    path.unlink()  # nobody else writes here: a killed command has left it
        except BlockingIOError as error:
            gone = f"; if it is gone, its lease ends after {LEASE_S:g} s, or at once with --take-over"
            more = gone if _is_leased(folder) else ""
            said = f"{_holder(folder)} is at work on it; wait until it ends, or stop it{more}"
            raise StoreError(f"{folder}: {said}") from error
        except OSError as error:
            raise StoreError(f"{folder}: cannot be used as a run folder: {error.strerror}") from error
        yield is_held


def _check_no_foreign_files(folder: Path) -> None:
    names = sorted(path.name for path in folder.iterdir())
    # a command that was killed at once leaves these
    left = [name for name in names if is_leftover(name, DATABASE) or is_leftover(name, HOLDER)]
    foreign = [name for name in names if name not in (LOCK, HOLDER, *left)]
    if foreign and DATABASE not in names:
        said = f"is not a run folder: it holds {foreign[0]!r} but no {DATABASE}"
        raise StoreError(f"{folder}: {said}; give a new or empty one")


def is_at(path: Path, opened: os.stat_result) -> bool:
    """Return whether a file, whose status was `opened` when it was opened, still has this name."""
    try:
        return os.path.samestat(path.stat(), opened)
    except OSError:
        return False


def _lock(file: BinaryIO, wait_s: float) -> None:
    """Lock an open file until it is closed; raise BlockingIOError if another process has it locked."""
    end_s = time.monotonic() + wait_s
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end_s:
                raise
            time.sleep(0.01)
        else:
            return


def has_locks(folder: Path) -> bool:
    """Return whether the file system of a run folder has locks, of both kinds: our own and that of SQLite."""
    if fcntl is None:
        return True  # SQLite locks files in another way there
    try:
        file = (folder / LOCK).open("rb")
    except OSError:  # nobody writes there, or we may not know
        return True
    with file:
        try:
            for lock in (fcntl.lockf, fcntl.flock):
                with suppress(BlockingIOError, PermissionError):
                    lock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return False
    return True


def _is_leased(folder: Path) -> bool:
    return fcntl is None or not has_locks(folder)


@contextmanager
def _lease(folder: Path) -> Iterator[partial[bool]]:
    """Hold the lease of a folder; yield a test whether it is still held, and not taken over."""
    path = folder / HOLDER
    if _is_lease_running(folder):
        raise BlockingIOError
    with temporary_path(path) as part, part.open("wb") as file:
        file.write(own_name().encode())
        file.flush()
        is_held = partial(is_at, path, part.stat())
        if fcntl is None:
            file.close()  # Windows renames no open file; elsewhere an open one keeps its number for itself
        part.replace(path)
        time.sleep(SETTLE_S)
        if not is_held():
            raise BlockingIOError
        over = threading.Event()

        def renew() -> None:
            while not over.wait(RENEW_S):
                if is_held():
                    with suppress(OSError):
                        os.utime(path)

        thread = threading.Thread(target=renew, daemon=True)
        thread.start()
        try:
            yield is_held
        finally:
            over.set()
            thread.join()


def _is_lease_running(folder: Path) -> bool:
    try:
        renewed = (folder / HOLDER).stat().st_mtime
    except OSError:
        return False
    match = re.fullmatch(r"process (\d+) on (.*)", _holder(folder))
    if match and match[2] == host() and fcntl is not None:  # on Windows this test would end the process
        try:
            os.kill(int(match[1]), 0)
        except ProcessLookupError:
            return False
        except PermissionError:  # it is another user's
            pass
    try:
        os.utime(folder / LOCK)
        now = (folder / LOCK).stat().st_mtime
    except OSError:
        now = time.time()
    return now - renewed < LEASE_S


def take_over(folder: Path) -> str | None:
    """End the lease of a run folder, if it has one; return its process, which stops if it is still at work."""
    holder = current_holder(folder) if _is_leased(folder) else None
    if holder is not None:
        (folder / HOLDER).unlink(missing_ok=True)
    return holder


def current_holder(folder: Path) -> str | None:
    """Return the process that holds a run folder; None if none does, or if this user may not find out."""
    if not (folder / LOCK).is_file():
        return None
    if _is_leased(folder):
        return _holder(folder) if _is_lease_running(folder) else None
    try:
        with (folder / LOCK).open("ab") as lock:
            _lock(lock, 0)
    except BlockingIOError:
        return _holder(folder)
    except OSError:
        pass
    return None


def own_name() -> str:
    """Return the name under which this process holds a run folder."""
    return f"process {os.getpid()} on {host()}"


def _holder(folder: Path) -> str:
    try:
        return (folder / HOLDER).read_text(encoding="utf-8") or "another process"
    except OSError:
        return "another process"
