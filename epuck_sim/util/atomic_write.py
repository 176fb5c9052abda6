"""Writing files that appear under their names only when they are whole, or that grow line by line."""

import glob
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from epuck_sim.errors import EpuckSimError

LEFT_S = 24 * 3600.0  # age in seconds after which a temporary file counts as left by a killed process, and is removed

_unfinished: set[Path] = set()


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield the path of a temporary file to write, which takes the name `path` when the block ends without an error.

    The temporary file lies in the same folder and has a name of its own, so that neither a user's file nor another
    writer of `path` is touched. It is removed on every error, Ctrl-C included. An existing file keeps its permissions;
    a link stays a link, and the file that it leads to is written.
    """
    check_target(path)
    with write_errors(path), temporary_path(path) as part:
        yield part
        publish(part, path)


@contextmanager
def growing_text(path: Path) -> Iterator[TextIO]:
    """Yield a text file that has its name from the beginning, and whose lines are in it as soon as they are written."""
    check_target(path)
    with write_errors(path), path.open("w", newline="", buffering=1) as file:
        yield file


@contextmanager
def temporary_path(path: Path) -> Iterator[Path]:
    """Yield an unused name beside `path`, FILE.*.part; the file or folder of that name is removed when the block ends.

    The caller creates it, with the permissions that the user's umask gives to new files. Files of this kind that killed
    processes have left are removed.
    """
    path = _behind_links(path)
    with suppress(OSError):
        for left in path.parent.glob(f"{glob.escape(path.name)}.*.part"):
            if is_leftover(left.name, path.name) and time.time() - left.lstat().st_mtime > LEFT_S:
                _remove(left)
    part = path.with_name(f"{path.name}.{os.urandom(4).hex()}.part")
    _unfinished.add(part)
    try:
        yield part
    finally:
        _remove(part)
        _unfinished.discard(part)


def publish(part: Path, path: Path) -> None:
    """Give the finished file `part` the name `path`."""
    target = _behind_links(path)
    with write_errors(path):
        with part.open("r+b") as file:  # contents reach the disk before the name; Windows syncs what is open to write
            os.fsync(file.fileno())
        with suppress(FileNotFoundError):
            shutil.copymode(target, part)
        part.replace(target)
    sync_folder(target.parent)


def _behind_links(path: Path) -> Path:
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def sync_folder(folder: Path) -> None:
    """Write the names of the files in a folder to the disk at once, where the system can do so."""
    with suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


def is_leftover(name: str, target: str) -> bool:
    """Return whether `name` is that of a temporary file for `target`, which a killed process may have left.

    >>> is_leftover("table.csv.0123abcd.part", "table.csv"), is_leftover("table.csv.part", "table.csv")
    (True, False)
    """
    token = name.removeprefix(f"{target}.").removesuffix(".part")
    return name == f"{target}.{token}.part" and len(token) == 8 and set(token) <= set("0123456789abcdef")


def remove_unfinished() -> None:
    """Remove all temporary files and folders of this process, which is about to end without leaving its blocks."""
    for part in list(_unfinished):
        _remove(part)


def _remove(part: Path) -> None:
    try:
        part.unlink()
    except OSError:  # it is a folder, or nothing was written
        shutil.rmtree(part, ignore_errors=True)


def check_target(path: Path) -> None:
    """Check that a file can be written."""
    with write_errors(path):  # a name that is too long, say
        reason = _reason_against(path)
    if reason:
        raise EpuckSimError(f"{path}: cannot be written: {reason}")


def _reason_against(path: Path) -> str:
    path = _behind_links(path)
    if path.is_symlink():
        return "is a link that leads to itself"
    if path.is_dir():
        return "is a directory"
    if not path.name or path.name == "..":
        return "is not a file name"
    if path.exists() and not path.is_file():
        return "is not a regular file"
    if not path.parent.is_dir():
        return f"there is no directory {path.parent}"
    return "" if os.access(path.parent, os.W_OK) else f"no permission to write in {path.parent}"


def trial_path(path: Path, trial: int, trials: int) -> Path:
    """Return the file of a trial: `path` itself if there is one trial, else FILE-0, FILE-1 and so on."""
    return path if trials == 1 else path.with_stem(f"{path.stem}-{trial}")


def check_trial_paths(path: Path, trials: int) -> None:
    """Check that a file can be written for each trial, without trying every name."""
    check_target(path)
    check_target(trial_path(path, trials - 1, trials))  # has the longest name
    for other in path.parent.glob(f"{glob.escape(path.stem)}-*{glob.escape(path.suffix)}"):
        number = other.stem.removeprefix(f"{path.stem}-")
        if number.isdecimal() and int(number) < trials and trials > 1:
            check_target(other)


@contextmanager
def write_errors(path: Path) -> Iterator[None]:
    """Turn an OSError of the block into an EpuckSimError which says that `path` cannot be written."""
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise EpuckSimError(f"{path}: cannot be written: {reason}") from error
