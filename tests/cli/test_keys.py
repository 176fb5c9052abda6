"""Keys are read from a terminal alone, which is then as it was before."""

import os
import pty
import sys
import termios
import time
from contextlib import suppress

import pytest

from epuck_sim.cli.keys import pressed_keys
from tests.processes import start, wait_until

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
