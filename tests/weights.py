"""The weight of the tree, room by room, against the limits in pyproject.toml; `python -m tests.weights` prints it.

A room is a folder of the package with all below it, or several folders (`report+display`); `root` is what lies beside
them. Limits are kept low by hand: who writes more takes as much away elsewhere, or raises a limit and says why.
"""

import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
PACKAGE = "epuck_sim"


class Weight(NamedTuple):
    """What is weighed, and what it may weigh; None where there is no limit, or nothing to count."""

    name: str
    weight: int | None
    limit: int | None
    files: int

    @property
    def is_allowed(self) -> bool:
        """Whether it is within a limit that there is."""
        return self.weight is not None and self.limit is not None and self.weight <= self.limit


def lines(files: Iterable[Path]) -> int:
    """Return the number of lines of files, as `wc -l` counts them."""
    return sum(file.read_bytes().count(b"\n") for file in files)


def weigh(root: Path) -> Iterator[Weight]:
    """Yield the weight of each room, of all rooms, of the tests and of the docs."""
    limits = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["weights"]
    package = root / PACKAGE
    folders = {folder.name: sorted(folder.rglob("*.py")) for folder in package.iterdir() if folder.is_dir()}
    folders = {name: files for name, files in folders.items() if files}
    for room, limit in limits["rooms"].items():
        names = room.split("+")
        known = [folders.pop(name) for name in names if name in folders]
        files = sorted(package.glob("*.py")) if room == "root" else [file for each in known for file in each]
        is_there = room == "root" or len(known) == len(names)
        yield Weight(room, lines(files) if is_there else None, limit, len(files))
    for name, files in sorted(folders.items()):
        yield Weight(name, lines(files), None, len(files))
    every = list(package.rglob("*.py"))
    yield Weight("lines of all rooms", lines(every), limits["lines"], len(every))
    yield Weight("files of all rooms", len(every), limits["files"], len(every))
    tests = list((root / "tests").rglob("*.py"))
    yield Weight("lines of tests", lines(tests), limits["tests"], len(tests))
    pages = [root / "README.md", *(root / "docs").rglob("*.md")]
    words = sum(len(page.read_text(encoding="utf-8").split()) for page in pages)
    yield Weight("words of docs", words, limits["words"], len(pages))


def main(root: Path = ROOT) -> int:
    """Print what the tree weighs; return 1 if anything is beyond its limit, has none, or is not there, else 0."""
    print(f"{'room':<22}{'weight':>8}{'limit':>8}{'files':>7}")
    weights = list(weigh(root))
    for name, weight, limit, files in weights:
        print(f"{name:<22}{weight if weight is not None else '-':>8}{limit if limit is not None else '-':>8}{files:>7}")
    wrong = [each for each in weights if not each.is_allowed]
    for name, weight, limit, _ in wrong:
        found = "is not there" if weight is None else f"weighs {weight}, and has no limit" if limit is None else ""
        print(f"error: {name}: {found or f'weighs {weight}; allowed: {limit}'}: see [tool.weights]", file=sys.stderr)
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
