"""What tests rest on: limits of what the tree weighs, and processes that hear Ctrl-C and do not outlive their test."""

import signal
import sys
from pathlib import Path

from tests import weights
from tests.processes import end_all, processes_marked, start, wait_until

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


def test_each_room_is_weighed_what_is_too_heavy_is_named_and_this_tree_is_within_its_limits(tmp_path: Path, capsys):
    assert weigh(tmp_path, FILES) == 0
    printed = capsys.readouterr()
    _, *rows = [line.rsplit(maxsplit=3) for line in printed.out.splitlines()]
    assert rows[:2] == [["root", "1", "1", "1"], ["one+two", "3", "3", "2"]]
    assert rows[2:4] == [["lines of all rooms", "4", "4", "3"], ["files of all rooms", "3", "3", "3"]]
    assert rows[4:] == [["lines of tests", "1", "1", "1"], ["words of docs", "3", "3", "2"]]
    assert printed.err == ""
    for added, *why in (
        ({"epuck_sim/__init__.py": "\n\n"}, "root: weighs 2; allowed: 1", "lines of all rooms: weighs 5; allowed: 4"),
        ({"tests/two.py": "\n", "docs/page.md": "more"}, "lines of tests: weighs 2", "words of docs: weighs 4"),
        ({"epuck_sim/four/more.py": ""}, "four: weighs 0, and has no limit", "files of all rooms"),
        ({"pyproject.toml": f"{LIMITS}three = 1\n"}, "three: is not there"),
    ):
        assert weigh(tmp_path / why[0], FILES | added) == 1
        for line, expected in zip(capsys.readouterr().err.splitlines(), why, strict=True):
            assert line.startswith(f"error: {expected}")
    assert weights.main() == 0


FAMILY = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True)
print("started", flush=True)
time.sleep(600)
"""


def test_ctrl_c_is_heard_even_where_these_tests_ignore_it() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process = start([sys.executable, "-c", "import time; print('started', flush=True); time.sleep(600)"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert process.stdout.readline() == "started\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in errors


def test_all_descendants_are_ended_even_if_the_first_process_has_ended(tmp_path) -> None:
    process = start([sys.executable, "-c", FAMILY], mark=str(tmp_path))
    assert process.stdout.readline() == "started\n"
    wait_until(lambda: len(processes_marked(str(tmp_path))) == 2)  # a child shows its mark once it is on its way
    process.kill()
    process.wait()
    end_all()
    wait_until(lambda: not processes_marked(str(tmp_path)))
