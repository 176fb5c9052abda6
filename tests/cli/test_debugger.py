"""Breakpoints in interpreted controllers: the debugger has the terminal to itself, and leaving it ends the command."""

import os
import pty
import select
import subprocess
import time
from pathlib import Path

import pytest

from tests.control.bench import with_step
from tests.processes import COMMAND

SCENE = "name: halt\nrobots: [{controller: halt.py, count: 1}]\nstop: {max_time_s: 0.5}\n"


@pytest.fixture
def scene(tmp_path) -> Path:
    (tmp_path / "halt.py").write_text(with_step("breakpoint(); memory.x = 7"))
    (tmp_path / "scene.yaml").write_text(SCENE)
    return tmp_path / "scene.yaml"


def test_leaving_the_debugger_ends_the_command_quietly(scene) -> None:
    run = subprocess.run(
        [*COMMAND, "run", str(scene), "--interpret", "--trace", str(scene.parent / "t.parquet")],
        input="p sensors.step_ms\nc\nq\n",
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stderr) == (130, "interrupted\n")
    assert "(Pdb)" in run.stdout
    assert "BdbQuit" not in run.stdout
    assert sorted(path.name for path in scene.parent.iterdir()) == ["halt.py", "scene.yaml"]


def test_nothing_is_written_over_the_debugger_s_prompt(scene) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [*COMMAND, "run", str(scene), "--interpret"], stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True
    )
    os.close(theirs)
    try:
        assert "(Pdb) " in read_until_silent(ours, 60)
        time.sleep(0.3)
        assert not select.select([ours], [], [], 0)[0]
        os.write(ours, b"p 6 * 7\n")
        assert read_until_silent(ours, 10).replace("\r", "").endswith("p 6 * 7\n42\n(Pdb) ")
        os.write(ours, b"q\n")
        assert "interrupted" in read_until_silent(ours, 10)
        assert process.wait(timeout=20) == 130
    finally:
        process.kill()
        process.wait()
        os.close(ours)


def read_until_silent(terminal: int, limit_s: float) -> str:
    """Return what is written to a terminal until nothing more comes for half a second."""
    found = b""
    while select.select([terminal], [], [], 0.5 if b"(Pdb) " in found or b"interrupted" in found else limit_s)[0]:
        try:
            found += os.read(terminal, 4096)
        except OSError:  # the program has ended
            break
    return found.decode()
