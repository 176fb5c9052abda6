"""Files that appear under their names only when they are whole."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from epuck_sim.errors import EpuckSimError


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield the path of a file to write, which takes the name `path` when the block ends without an error.

    Raises EpuckSimError where it cannot be written; nothing is left behind then.
    """
    check_target(path)
    part = path.with_name(f"{path.name}.part")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        part.unlink(missing_ok=True)


def check_target(path: Path) -> None:
    """Raise EpuckSimError where nothing can be written: no file's name, no folder for it, or no regular file there."""
    reason = ""
    if path.is_dir():
        reason = "is a directory"
    elif not path.name or path.name == "..":
        reason = "is no file's name"
    elif path.exists() and not path.is_file():
        reason = "is no regular file"
    elif not path.parent.is_dir():
        reason = f"there is no directory {path.parent}"
    elif not os.access(path.parent, os.W_OK):
        reason = f"no permission to write in {path.parent}"
    if reason:
        raise EpuckSimError(f"{path}: cannot be written: {reason}")


def unwritable(path: Path, error: OSError) -> EpuckSimError:
    """Return the error to raise where `path` could not be written."""
    reason = os.strerror(error.errno) if error.errno else str(error)
    return EpuckSimError(f"{path}: cannot be written: {reason}")
