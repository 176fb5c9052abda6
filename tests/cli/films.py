"""Helpers of the tests of commands about films: contents of folders and of films."""

from pathlib import Path
from typing import Any

from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.film import open_film


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def frames_and_description(film: str | Path) -> tuple[list[Frame], dict[str, Any] | None]:
    with open_film(str(film)) as opened:
        return list(opened.frames()), opened.description
