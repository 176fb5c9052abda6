"""Files that appear under their names only when they are whole."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from epuck_sim.errors import EpuckSimError


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield the path of a file to write, which takes the name `path` when the block ends without an error.

    Raises EpuckSimError where it cannot be written; nothing is left behind then.
    """
    check_target(path)
    part = path.with_name(f"{path.name}.part")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise write_error(path, error) from error
    finally:
        part.unlink(missing_ok=True)


def check_target(path: Path) -> None:
    """Raise EpuckSimError where nothing can be written: no file's name, no folder for it, or no regular file there."""
    try:
        reason = _reason_against(path)
    except OSError as error:  # of a name that is too long, say
        raise write_error(path, error) from error
    if reason:
        raise EpuckSimError(f"{path}: cannot be written: {reason}")


def _reason_against(path: Path) -> str:
    if path.is_dir():
        return "is a directory"
    if not path.name or path.name == "..":
        return "is no file's name"
    if path.exists() and not path.is_file():
        return "is no regular file"
    if not path.parent.is_dir():
        return f"there is no directory {path.parent}"
    return "" if os.access(path.parent, os.W_OK) else f"no permission to write in {path.parent}"


def trial_paths(path: Path, trials: int) -> list[Path]:
    """Return a file for each trial: `path`, or FILE-0, FILE-1 and so on; raises as `check_target` does."""
    check_target(path)
    paths = [path] if trials == 1 else [path.with_stem(f"{path.stem}-{trial}") for trial in range(trials)]
    for target in paths:
        check_target(target)
    return paths


def write_error(path: Path, error: OSError) -> EpuckSimError:
    """Return the error to raise where `path` could not be written."""
    reason = os.strerror(error.errno) if error.errno else str(error)
    return EpuckSimError(f"{path}: cannot be written: {reason}")
