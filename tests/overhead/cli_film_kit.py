"""What the tests of the commands of films share: commands that end well, and folders and films looked into."""

import os
from pathlib import Path
from typing import Any

from cli_kit import call

from epuck_sim.overhead.film_reader import open_film
from epuck_sim.overhead.frame import Frame


def called(*arguments: str | Path) -> str:
    """Return what a command prints that ends well and has nothing to complain of."""
    result = call(*arguments)
    assert (result.exit_code, result.stderr) == (0, ""), result.exception
    return result.stdout


def contents(folder: Path) -> dict[str, bytes | None]:
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def seen(film: str | Path) -> tuple[list[Frame], dict[str, Any] | None]:
    """Return a film's frames, and what it says of itself."""
    with open_film(str(film)) as opened:
        return list(opened.frames()), opened.description


def shut(monkeypatch, folder: Path) -> None:
    """Make a folder in which this user may not write, even if it is root."""
    folder.mkdir()
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).absolute() != folder and may(path, mode))
