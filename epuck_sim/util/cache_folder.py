"""The folder in which compiled code is kept."""

import os
import tempfile
from functools import lru_cache
from pathlib import Path

import platformdirs

UNUSED_S = 30 * 24 * 3600.0
"""Time in seconds after which compiled code that no process has used is removed."""

USER = os.getuid() if hasattr(os, "getuid") else 0
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
        return Path(tempfile.gettempdir()) / f"epuck-sim-{USER}"
