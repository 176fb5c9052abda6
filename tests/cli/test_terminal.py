"""Terminals: keys are read from one that is then as it was, and the debugger of a controller has it to itself."""

import os
import pty
import select
import sys
import termios
import time
from contextlib import suppress

import pytest

from epuck_sim.cli.keys import pressed_keys
from tests.control.bench import with_step
from tests.processes import COMMAND, start, wait_until

READS = """
import sys
from epuck_sim.cli.keys import pressed_keys
with pressed_keys(echo={echo}) as wait:
    print("ready", flush=True)
    keys = ""
    while "q" not in keys:
        keys += wait(0.5)
    print(repr(keys), flush=True)
"""


def test_what_is_no_terminal_is_left_alone() -> None:
    with pressed_keys(echo=False) as wait:
        assert wait is None


@pytest.mark.parametrize("echo", [False, True])
def test_keys_are_read_one_by_one_and_the_terminal_is_set_back(echo: bool) -> None:
    controller, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)
    session = f"import os, fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0){READS.format(echo=echo)}"
    process = start([sys.executable, "-c", session], stdin=terminal)
    assert process.stdout.readline() == "ready\n"
    flags = termios.tcgetattr(terminal)[3]
    assert not flags & termios.ICANON
    assert bool(flags & termios.ECHO) == echo
    assert flags & termios.ISIG  # Ctrl-C does what it always does
    os.write(controller, b" n")
    time.sleep(0.1)
    os.write(controller, b"q")
    assert process.stdout.readline() == "' nq'\n"
    wait_until(lambda: process.poll() is not None)
    assert process.returncode == 0
    assert termios.tcgetattr(terminal) == before
    with suppress(OSError):
        os.close(controller)
    os.close(terminal)


SCENE = "name: halt\nrobots: [{controller: halt.py, count: 1}]\nstop: {max_time_s: 0.5}\n"


def test_the_debugger_has_the_terminal_to_itself_and_leaving_it_ends_the_command_quietly(tmp_path) -> None:
    (tmp_path / "halt.py").write_text(with_step("breakpoint(); memory.x = 7"))
    (tmp_path / "scene.yaml").write_text(SCENE)
    ours, theirs = pty.openpty()
    command = [*COMMAND, "run", tmp_path / "scene.yaml", "--interpret", "--trace", tmp_path / "t.parquet"]
    process = start(command, stdin=theirs, stdout=theirs, stderr=theirs)
    os.close(theirs)
    assert "(Pdb) " in read_until_silent(ours, 60)
    time.sleep(0.3)
    assert not select.select([ours], [], [], 0)[0]
    os.write(ours, b"p 6 * 7\n")
    assert read_until_silent(ours, 10).replace("\r", "").endswith("p 6 * 7\n42\n(Pdb) ")
    os.write(ours, b"q\n")
    said = read_until_silent(ours, 10)
    assert "interrupted" in said
    assert "BdbQuit" not in said
    assert process.wait(timeout=20) == 130
    assert sorted(path.name for path in tmp_path.iterdir()) == ["halt.py", "scene.yaml"]
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
