"""Keys that are pressed in the terminal while a command runs."""

import os
import select
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

try:
    import termios
except ImportError:  # there are none on Windows
    termios = None  # type: ignore[assignment]

_at_start: list[Any] | None = None  # how the terminal was set before keys were read; None while none are read


@contextmanager
def pressed_keys(*, echo: bool) -> Iterator[Callable[[float], str] | None]:
    """Yield a function that waits for a number of seconds, or until keys are pressed, and returns these.

    It is None where stdin is no terminal, or not this command's: then nothing is read or changed.
    """
    global _at_start  # noqa: PLW0603 there is one terminal
    if not _is_ours():
        yield None
        return
    _at_start = termios.tcgetattr(0)
    settings = termios.tcgetattr(0)
    settings[3] &= ~termios.ICANON if echo else ~(termios.ICANON | termios.ECHO)
    termios.tcsetattr(0, termios.TCSADRAIN, settings)
    try:
        yield _wait
    finally:
        restore_terminal()


def restore_terminal() -> None:
    """Set the terminal as it was before keys were read."""
    global _at_start  # noqa: PLW0603 there is one terminal
    if _at_start is not None:
        with suppress(termios.error):  # it was closed
            termios.tcsetattr(0, termios.TCSADRAIN, _at_start)
        _at_start = None


def _is_ours() -> bool:
    """Return whether stdin is a terminal and this process in its foreground; others are stopped if they touch it."""
    if termios is None or sys.stdin is None or not sys.stdin.isatty() or sys.stdin.fileno() != 0:
        return False
    with suppress(OSError):
        return os.tcgetpgrp(0) == os.getpgrp()
    return False


def _wait(seconds: float) -> str:
    """Wait for keys; where the command was sent to the background, for the time alone."""
    ready, _, _ = select.select([0], [], [], seconds)
    if not ready or not _is_ours():
        time.sleep(seconds if ready else 0.0)
        return ""
    with suppress(OSError):  # the terminal was closed
        if keys := os.read(0, 64):
            return keys.decode(errors="replace")
    time.sleep(seconds)
    return ""
