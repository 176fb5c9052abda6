"""The folder in which compiled code is kept while it is used."""

import os
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import platformdirs

UNUSED_S = 30 * 24 * 3600.0
"""Time in seconds after which compiled code that no process has used is removed."""

USER = os.getuid()
"""Number of the user who runs this process."""


@lru_cache
def cache_root() -> Path:
    """Return the folder for compiled code: $NUMBA_CACHE_DIR, else the user's cache folder, else a temporary one."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(chosen) if chosen else platformdirs.user_cache_path("epuck-sim")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:  # a home that cannot be written to: compile once a machine, not once a run
        return _temporary_root()


def _temporary_root() -> Path:
    """Return the user's own folder among temporary files; compiled code of others must never be loaded."""
    folder = Path(tempfile.gettempdir()) / f"epuck-sim-{USER}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if stat.S_ISDIR(found.st_mode) and found.st_uid == USER and not found.st_mode & 0o022:
            return folder
    return Path(tempfile.mkdtemp(prefix="epuck-sim-"))


def remove_unused(paths: Iterable[Path], is_ours: Callable[[Path], bool]) -> None:
    """Remove files and folders of compiled code that no process has used for `UNUSED_S`, but those of other users.

    A process that uses one meanwhile finds nothing there and compiles anew.

    Args:
        paths: Files and folders.
        is_ours: Whether one of them, which has not been used, is compiled code of this program.
    """
    limit_s = time.time() - UNUSED_S
    for path in paths:
        with suppress(OSError):  # another process is removing it
            status = path.lstat()
            if status.st_mtime < limit_s and status.st_uid == USER and is_ours(path):
                shutil.rmtree(path) if path.is_dir() else path.unlink()
