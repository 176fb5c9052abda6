"""The terminal of a running command: signals that end it, even while compiled code runs, and keys that are pressed.

Python runs signal handlers between two instructions of Python code, so that a compiled controller in an endless loop
keeps them waiting for ever. Here a thread receives the same signals, and ends the process where the handlers cannot.
"""

import atexit
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from epuck_sim.util.atomic_write import remove_unfinished
from epuck_sim.util.machine import signals

try:
    import termios
except ImportError:  # there are none on Windows
    termios = None  # type: ignore[assignment]

REQUESTS = signals("SIGINT", "SIGTERM", "SIGHUP")
"""Signals that ask the command to end: Ctrl-C, a polite request, a terminal that is closed."""

GRACE_S = 2.0  # time in seconds in which the main thread must react to a signal
AGAIN_S = 0.05  # time in seconds after which KeyboardInterrupt is raised again where Python has dropped it
INSISTENT = 3  # requests within `INSIST_S` that end the process in any case: a controller may catch all exceptions
INSIST_S = 3.0  # time in seconds within which requests count as insistent
EXIT_CODE = 130  # exit code of a command that was interrupted

_at_start: list[Any] | None = None  # the terminal's settings before keys were read; None while none are read


def end_on_request() -> "Watchdog":
    """Make `REQUESTS` raise KeyboardInterrupt in the main thread, and end the process if it does not react.

    Where compiled code runs, SIGTERM and SIGHUP end the process after `GRACE_S`, and so does a second Ctrl-C. The third
    request within `INSIST_S` ends it in any case. Signals that were ignored when the process started, as under nohup,
    stay ignored.
    """
    reader, writer = socket.socketpair()  # Windows writes signals to nothing else
    writer.setblocking(False)
    watchdog = Watchdog(reader, writer)
    for request in REQUESTS:
        if signal.getsignal(request) is not signal.SIG_IGN:
            signal.signal(request, watchdog.interrupt)
    sys.unraisablehook = watchdog.repeat
    # signals are written to it at once, whatever the main thread does
    signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=watchdog.watch, daemon=True).start()
    atexit.register(watchdog.keep_exit_code)  # the first to be registered is the last to be called
    return watchdog


class Watchdog:
    """Compares the times at which signals arrive and at which the main thread reacts."""

    exit_code: int | None = None  # exit code of the command, once it is known

    def __init__(self, reader: socket.socket, writer: socket.socket) -> None:
        self._reader = reader
        self._writer = writer  # stays open
        self._reacted_s = 0.0
        self._number = int(signal.SIGINT)

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Raise KeyboardInterrupt: the main thread has reacted."""
        self._reacted_s = time.monotonic()
        self._number = number
        signal.default_int_handler(number, frame)

    def has_interrupted(self) -> bool:
        """Return whether KeyboardInterrupt has been raised."""
        return self._reacted_s > 0

    def keep_exit_code(self) -> None:
        """Make the process end with the command's exit code, as the last thing that Python does.

        From now on, `REQUESTS` would kill the process. And if KeyboardInterrupt has passed through the `exec` of a
        text, as in many imports, Python kills the process by SIGINT at its very end, even if all has been handled.
        """
        for request in REQUESTS:
            signal.signal(request, signal.SIG_IGN)
        if self.has_interrupted() and self.exit_code is not None:
            for stream in (sys.stdout, sys.stderr):
                with suppress(OSError, ValueError):  # nobody listens, or it has been closed
                    stream.flush()
            os._exit(self.exit_code)

    def repeat(self, dropped: "sys.UnraisableHookArgs") -> None:
        """Raise KeyboardInterrupt a little later if Python has dropped it, as it does in destructors and callbacks.

        Other exceptions that Python drops are printed, unless an interrupt came before: objects may be half made.
        """
        if isinstance(dropped.exc_value, KeyboardInterrupt):
            again = threading.Timer(AGAIN_S, _signal_main_thread, (self._number,))
            again.daemon = True  # the command may have ended by then
            again.start()
        elif not self.has_interrupted():
            sys.__unraisablehook__(dropped)

    def watch(self) -> None:
        """End the process if the main thread does not react to a signal, or has reacted but still runs at the third."""
        read_s, unheard = time.monotonic(), 0
        asked_s: list[float] = []
        while numbers := self._reader.recv(64):
            requests = [number for number in numbers if number in REQUESTS]
            since_s, read_s = read_s, time.monotonic()  # these signals came after the last ones were read
            asked_s = [moment for moment in asked_s if moment > read_s - INSIST_S] + [read_s] * len(requests)
            if len(asked_s) >= INSISTENT:
                _end("ended at the third request to stop")
            while self._reacted_s < since_s and not unheard and time.monotonic() < read_s + GRACE_S:
                time.sleep(0.02)
            unheard = 0 if self._reacted_s >= since_s else unheard + len(requests)
            if unheard > 1 or (unheard and requests != [signal.SIGINT]):
                _end("ended by force: the running code does not react to Ctrl-C")
            if unheard:
                _say("the running code does not react to Ctrl-C; press it again to end at once")


def _signal_main_thread(number: int) -> None:
    if hasattr(signal, "pthread_kill"):  # also interrupts a main thread that waits
        main_thread = threading.main_thread().ident
        assert main_thread is not None  # it has been started
        signal.pthread_kill(main_thread, number)
    else:
        signal.raise_signal(number)


def _end(why: str) -> None:
    try:
        restore_terminal()
        remove_unfinished()
        _say(why)
    finally:
        os._exit(EXIT_CODE)


def _say(line: str) -> None:
    with suppress(OSError):  # nobody listens
        os.write(sys.stderr.fileno(), f"{line}\n".encode())


@contextmanager
def pressed_keys(*, echo: bool) -> Iterator[Callable[[float], str] | None]:
    """Yield a function that waits for a number of seconds, or until keys are pressed, and returns the keys.

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
    """Return whether stdin is a terminal with this process in its foreground: others are stopped if they touch it."""
    if termios is None or sys.stdin is None or not sys.stdin.isatty() or sys.stdin.fileno() != 0:
        return False
    with suppress(OSError):
        return os.tcgetpgrp(0) == os.getpgrp()
    return False


def _wait(seconds: float) -> str:
    """Wait for keys; if the command was sent to the background, only for the time."""
    ready, _, _ = select.select([0], [], [], seconds)
    if not ready or not _is_ours():
        time.sleep(seconds if ready else 0.0)
        return ""
    with suppress(OSError):  # the terminal was closed
        if keys := os.read(0, 64):
            return keys.decode(errors="replace")
    time.sleep(seconds)
    return ""
