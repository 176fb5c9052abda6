"""The folder in which compiled code is kept."""

import os
import stat
import tempfile
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
