"""What the tests of the commands of films share: folders and films looked into."""

import os
from pathlib import Path
from typing import Any

from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.film.reader import open_film


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def sample(film: str | Path) -> tuple[list[Frame], dict[str, Any] | None]:
    """Return a film's frames, and what it says of itself."""
    with open_film(str(film)) as opened:
        return list(opened.frames()), opened.description


def shut(monkeypatch, folder: Path) -> None:
    """Make a folder in which this user may not write, even if it is root."""
    folder.mkdir()
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).absolute() != folder and may(path, mode))
