"""Removes the temporary folders that processes left which were killed.

Python's multiprocessing makes a folder pymp-* for the sockets of a pool, and removes it if its process ends by itself.
A file in it that the process keeps locked says that the folder is ours, and for how long it is in use: the system
releases the lock when the process is gone, however that comes about.
"""

import fcntl
import os
import shutil
import tempfile
from contextlib import suppress
from functools import lru_cache
from multiprocessing.util import get_temp_dir
from pathlib import Path

PATTERN = "pymp-*"
"""Names of the folders that multiprocessing makes."""

LOCK = "epuck-sim.lock"
"""Name of the file that is locked."""


@lru_cache
def mark_temporary_folder() -> None:
    """Mark the temporary folder of this process, until it ends, as in use."""
    folder = Path(get_temp_dir())
    with suppress(OSError):  # on a file system without locks the folder stays unmarked, and nobody removes it
        unlocked = folder / f"{LOCK}.new"
        file = os.open(unlocked, os.O_CREAT | os.O_RDWR, 0o600)  # stays open, and is in no process that we start
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        unlocked.rename(folder / LOCK)  # whoever sees it finds it locked


def remove_stale_folders() -> None:
    """Remove the marked folders of this user's processes that are gone, and no others."""
    for lock in Path(tempfile.gettempdir()).glob(f"{PATTERN}/{LOCK}"):
        with suppress(OSError):  # it is another user's, in use, or was removed just now
            if not lock.parent.is_symlink() and lock.parent.stat().st_uid == os.getuid():
                _remove_if_unlocked(lock)


def _remove_if_unlocked(lock: Path) -> None:
    file = os.open(lock, os.O_RDWR | os.O_NOFOLLOW)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        shutil.rmtree(lock.parent)
    finally:
        os.close(file)
