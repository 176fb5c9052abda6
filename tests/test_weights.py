"""What is too heavy is named; the tree itself is within its limits."""

from pathlib import Path

import pytest

from tests import weights

LIMITS = """
[tool.weights]
lines = 8
files = 4
tests = 2
words = 6

[tool.weights.rooms]
root = 2
"one+two" = 5
three = 1
"""
FILES = {
    "pyproject.toml": LIMITS,
    "README.md": "three small words\n",
    "docs/page.md": "and\ntwo more\n",
    "epuck_sim/__init__.py": "a = 1\nb = 2\n",
    "epuck_sim/one/__init__.py": "",
    "epuck_sim/one/inner/part.py": "a = 1\n\n# c\n",
    "epuck_sim/one/inner/data.json": "{\n}\n",
    "epuck_sim/two/part.py": "a = 1\nb = 2",
    "epuck_sim/empty/data.json": "{}\n",
    "tests/test_one.py": "a = 1\nb = 2\n",
}


def write(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Return a small tree that is within all limits, most of which it reaches."""
    return write(tmp_path, FILES | {"pyproject.toml": LIMITS.replace("three = 1\n", "")})


def test_each_room_is_weighed_with_the_folders_below_it(tree: Path, capsys) -> None:
    assert weights.main(tree) == 0
    printed = capsys.readouterr()
    rows = [line.rsplit(maxsplit=3) for line in printed.out.splitlines()[1:]]
    assert rows == [
        ["root", "2", "2", "1"],
        ["one+two", "4", "5", "3"],
        ["lines of all rooms", "6", "8", "4"],
        ["files of all rooms", "4", "4", "4"],
        ["lines of tests", "2", "2", "1"],
        ["words of docs", "6", "6", "2"],
    ]
    assert printed.err == ""


@pytest.mark.parametrize(
    ("added", "why"),
    [
        (
            {"epuck_sim/__init__.py": "\n" * 3, "epuck_sim/two/part.py": "\n" * 9, "epuck_sim/two/more.py": ""},
            [
                *("root: weighs 3; allowed: 2", "one+two: weighs 12; allowed: 5"),
                *("lines of all rooms: weighs 15; allowed: 8", "files of all rooms: weighs 5; allowed: 4"),
            ],
        ),
        (
            {"tests/deep/test_two.py": "\n", "docs/deep/page.md": "more"},
            ["lines of tests: weighs 3; allowed: 2", "words of docs: weighs 7; allowed: 6"],
        ),
        ({"epuck_sim/four/more.py": "\n", "epuck_sim/two/part.py": ""}, ["four: weighs 1, and has no limit", "files"]),
        ({"pyproject.toml": LIMITS}, ["three: is not there"]),
    ],
)
def test_what_is_too_heavy_is_named(tree: Path, added: dict[str, str], why: list[str], capsys) -> None:
    assert weights.main(write(tree, added)) == 1
    for line, expected in zip(capsys.readouterr().err.splitlines(), why, strict=True):
        assert line.startswith(f"error: {expected}")


def test_this_tree_is_within_its_limits() -> None:
    assert weights.main() == 0
