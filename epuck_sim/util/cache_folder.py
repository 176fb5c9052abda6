"""The folder in which compiled code is kept while it is used."""

import os
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import platformdirs

USER = os.getuid() if hasattr(os, "getuid") else None  # number of this process's user; None where users have none

UNUSED_S = 30 * 24 * 3600.0  # time in seconds after which compiled code that no process has used is removed
ROOM_BYTES = 4_000_000  # free space that a folder needs to be used: some more than all kernels take


@lru_cache
def cache_root(*, to_fill: bool = False) -> Path:
    """Return the folder for compiled code: $NUMBA_CACHE_DIR, else the user's cache folder, else a temporary one.

    A folder that others can write to is not used, as its code is run; nor one without room, if it is to be filled.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    try:
        folder = Path(chosen) if chosen else platformdirs.user_cache_path("epuck-sim")
        folder.mkdir(parents=True, exist_ok=True)
        if not chosen:
            folder.chmod(0o700)
        if to_fill:
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(bytes(ROOM_BYTES))
        if _is_private(folder.resolve()):
            return folder
        reason = "other users can write to it"
    except (OSError, RuntimeError) as error:  # there is no home, or no room: compile once a machine, not once a run
        reason = getattr(error, "strerror", None) or str(error)
    instead = Path(tempfile.gettempdir()) / f"epuck-sim-{USER or 0}"  # compiled code of others must never be loaded
    with suppress(OSError):
        instead.mkdir(mode=0o700, exist_ok=True)
    if not _is_private(instead):
        return fleeting_root(f"{chosen or 'cache folder'}: {reason}; {instead}: cannot be used, either")
    if chosen and not (to_fill and cache_root() == instead):  # which has said so
        warnings.warn(f"NUMBA_CACHE_DIR {chosen}: {reason}; compiled code is kept in {instead}", stacklevel=2)
    return instead


@lru_cache
def fleeting_root(why: str) -> Path:
    """Return a new temporary folder, which later processes do not find, and warn that nothing is kept, and why."""
    said = "nothing compiled is kept, every command compiles it anew; name a folder of your own in NUMBA_CACHE_DIR"
    warnings.warn(f"{why}; {said}", stacklevel=3)
    return Path(tempfile.mkdtemp(prefix="epuck-sim-"))


def is_kept() -> bool:
    """Return whether compiled code is in a folder that later processes find."""
    return not fleeting_root.cache_info().currsize


def is_ours(path: Path) -> bool:
    """Return whether a file or folder, not what a link leads to, belongs to this user."""
    return USER is None or path.lstat().st_uid == USER


def _is_private(folder: Path) -> bool:
    """Return whether a folder, which is no link, belongs to this user, and no other can write to it."""
    if folder.is_symlink() or not folder.is_dir():
        return False
    return USER is None or (is_ours(folder) and not folder.lstat().st_mode & 0o022)


def remove_unused(paths: Iterable[Path], is_compiled: Callable[[Path], bool]) -> None:
    """Remove those of these paths that are compiled code, unused for `UNUSED_S`, and not another user's."""
    limit_s = time.time() - UNUSED_S
    for path in paths:
        with suppress(OSError):  # another process is removing it
            if path.lstat().st_mtime < limit_s and is_ours(path) and is_compiled(path):
                shutil.rmtree(path) if path.is_dir() else path.unlink()
