"""The weight of the tree, room by room, against the limits in pyproject.toml; `python -m tests.weights` prints it.

A room is a folder of the package with all below it, or several folders (`report+display`); `root` is what lies beside
them. Limits are kept low by hand: who writes more takes as much away elsewhere, or raises a limit and says why.
"""

import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent


def lines(files: Iterable[Path]) -> int:
    """Return the number of lines of files, as `wc -l` counts them."""
    return sum(file.read_bytes().count(b"\n") for file in files)


def weigh(root: Path) -> Iterator[tuple[str, int | None, int | None, int]]:
    """Yield name, weight, limit and number of files of each room, of all rooms, the tests and the docs.

    A weight or limit is None where there is nothing to count, or no limit.
    """
    limits = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["weights"]
    package = root / "epuck_sim"
    folders = {folder.name: sorted(folder.rglob("*.py")) for folder in package.iterdir() if folder.is_dir()}
    folders = {name: files for name, files in folders.items() if files} | {"root": sorted(package.glob("*.py"))}
    for room, limit in limits["rooms"].items():
        found = [folders.pop(name, []) for name in room.split("+")]
        yield room, sum(map(lines, found)) if all(found) else None, limit, sum(map(len, found))
    for name, files in sorted(folders.items()):
        yield name, lines(files), None, len(files)
    every, tests = list(package.rglob("*.py")), list((root / "tests").rglob("*.py"))
    yield "lines of all rooms", lines(every), limits["lines"], len(every)
    yield "files of all rooms", len(every), limits["files"], len(every)
    yield "lines of tests", lines(tests), limits["tests"], len(tests)
    pages = [root / "README.md", *(root / "docs").rglob("*.md")]
    words = sum(len(page.read_text(encoding="utf-8").split()) for page in pages)
    yield "words of docs", words, limits["words"], len(pages)


def main(root: Path = ROOT) -> int:
    """Print what the tree weighs; return 1 if anything is beyond its limit, has none, or is not there, else 0."""
    print(f"{'room':<22}{'weight':>8}{'limit':>8}{'files':>7}")
    wrong = []
    for name, weight, limit, files in weigh(root):
        print(f"{name:<22}{'-' if weight is None else weight:>8}{'-' if limit is None else limit:>8}{files:>7}")
        if weight is None:
            wrong.append(f"{name}: is not there")
        elif limit is None:
            wrong.append(f"{name}: weighs {weight}, and has no limit")
        elif weight > limit:
            wrong.append(f"{name}: weighs {weight}; allowed: {limit}")
    for each in wrong:
        print(f"error: {each}: see [tool.weights]", file=sys.stderr)
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
