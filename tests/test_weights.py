"""What is too heavy is named; the tree itself is within its limits."""

from pathlib import Path

import pytest

from tests import weights

LIMITS = '[tool.weights]\nlines = 4\nfiles = 3\ntests = 1\nwords = 3\n\n[tool.weights.rooms]\nroot = 1\n"one+two" = 3\n'
FILES = {
    "pyproject.toml": LIMITS,
    "README.md": "one\n",
    "docs/deep/page.md": "and\ntwo\n",
    "epuck_sim/__init__.py": "a = 1\n",
    "epuck_sim/one/inner/part.py": "a = 1\n# c\n",
    "epuck_sim/one/inner/data.json": "{\n}\n",
    "epuck_sim/two/part.py": "a = 1\nb = 2",
    "epuck_sim/empty/data.json": "{}\n",
    "tests/deep/test_one.py": "a = 1\n",
}


def weigh(root: Path, files: dict[str, str]) -> int:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return weights.main(root)


def test_each_room_is_weighed_with_the_folders_below_it(tmp_path: Path, capsys) -> None:
    assert weigh(tmp_path, FILES) == 0
    printed = capsys.readouterr()
    _, *rows = [line.rsplit(maxsplit=3) for line in printed.out.splitlines()]
    assert rows[:2] == [["root", "1", "1", "1"], ["one+two", "3", "3", "2"]]
    assert rows[2:4] == [["lines of all rooms", "4", "4", "3"], ["files of all rooms", "3", "3", "3"]]
    assert rows[4:] == [["lines of tests", "1", "1", "1"], ["words of docs", "3", "3", "2"]]
    assert printed.err == ""


@pytest.mark.parametrize(
    ("added", "why"),
    [
        ({"epuck_sim/__init__.py": "\n\n"}, ["root: weighs 2; allowed: 1", "lines of all rooms: weighs 5; allowed: 4"]),
        ({"tests/two.py": "\n", "docs/page.md": "more"}, ["lines of tests: weighs 2", "words of docs: weighs 4"]),
        ({"epuck_sim/four/more.py": ""}, ["four: weighs 0, and has no limit", "files of all rooms"]),
        ({"pyproject.toml": f"{LIMITS}three = 1\n"}, ["three: is not there"]),
    ],
)
def test_what_is_too_heavy_is_named(tmp_path: Path, added: dict[str, str], why: list[str], capsys) -> None:
    assert weigh(tmp_path, FILES | added) == 1
    for line, expected in zip(capsys.readouterr().err.splitlines(), why, strict=True):
        assert line.startswith(f"error: {expected}")


def test_this_tree_is_within_its_limits() -> None:
    assert weights.main() == 0
