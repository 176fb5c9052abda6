"""Runs rerun's own program, which comes with its package: to its end, or in the background as a viewer."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import IO

import rerun_cli

from epuck_sim.errors import RecordingError
from epuck_sim.util.machine import HOST

_PATHS = [Path(rerun_cli.__file__).with_name(name) for name in ("Rerun.app", "rerun")]
PROGRAM = (str(_PATHS[0] / "Contents/MacOS/Rerun" if _PATHS[0].exists() else _PATHS[1]),)
"""The program itself, in rerun's package: the package's own launcher hides how it ends."""

ENVIRONMENT = {"RERUN_ANALYTICS": "0", "RUST_LOG": "warn"}
"""Default environment of rerun: no telemetry, and no log but warnings. The user's own settings take precedence."""

START_S = 30  # longest time until a viewer answers
END_S = 10  # longest time until a viewer ends after SIGTERM; then it is killed

NO_GRAPHICS = (
    "the viewer finds no graphics driver; install one (Debian, Ubuntu: apt install mesa-vulkan-drivers), or give --web"
)

_ENDS_WITH_PARENT = """
import ctypes, os, signal, sys
ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
if os.getppid() == int(sys.argv[1]):  # it has not ended already
    os.execv(sys.argv[2], sys.argv[2:])
"""
"""A program that becomes another one, which Linux kills when the thread that started it ends.

Python of our own after a fork could wait for ever for threads that the fork has left behind, such as those of PyAV."""


def run_rerun(*arguments: str) -> None:
    """Run rerun's program to its end; raise RecordingError with its output if it fails."""
    done = _run(*arguments)
    if done.returncode:
        raise RecordingError(f"rerun {' '.join(arguments[:2])} failed: {done.stderr.strip()}")


def crashes_on(recording: Path) -> bool:
    """Return whether rerun's program crashes on a recording, as this process might if it read the recording."""
    return _run("rrd", "verify", str(recording)).returncode not in (0, 1)  # 1: it reports a mistake


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command, environment = [*PROGRAM, *arguments], {**ENVIRONMENT, **os.environ}
    return subprocess.run(command, env=environment, capture_output=True, text=True, errors="replace", check=False)


@contextmanager
def in_background(*arguments: str) -> Iterator["ViewerProcess"]:
    """Yield rerun's program, running in the background; it ends with the block.

    SIGINT and SIGTERM raise KeyboardInterrupt in the block, even if the parent process had them ignored. A handler that
    the calling program has installed stays; outside the main thread, Python allows no handlers.
    """
    replaced = {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) in (signal.SIG_IGN, signal.SIG_DFL):
                replaced[number] = signal.signal(number, signal.default_int_handler)
    try:
        with tempfile.TemporaryFile("w+") as log, closing(ViewerProcess(log, *arguments)) as started:
            yield started
    finally:
        for number, handler in replaced.items():
            signal.signal(number, handler)


class ViewerProcess:
    """A running viewer, in a process group of its own: Ctrl-C in the terminal reaches only us, and we end it."""

    def __init__(self, log: IO[str], *arguments: str) -> None:
        self._log = log
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)  # the viewer leaves files in it
        starter = [sys.executable, "-I", "-S", "-c", _ENDS_WITH_PARENT, str(os.getpid())]
        self._process = subprocess.Popen(
            [*starter * (sys.platform == "linux"), *PROGRAM, *arguments, "--bind", HOST],
            env={**ENVIRONMENT, **os.environ, "TMPDIR": self._folder.name},
            stdout=log,
            stderr=log,
            process_group=None if sys.platform == "win32" else 0,
        )

    def wait_for(self, port: int) -> None:
        """Wait until it answers at a port; raise RecordingError if it does not."""
        until = time.monotonic() + START_S
        while not self.has_ended and time.monotonic() < until:
            with socket.socket() as attempt:
                if attempt.connect_ex((HOST, port)) == 0:
                    return
            time.sleep(0.05)
        raise self.error()

    @property
    def has_ended(self) -> bool:
        """Whether its window was closed, or it broke down."""
        return self._process.poll() is not None

    def wait(self) -> None:
        """Wait until it ends, by itself or because its window is closed; raise RecordingError if it fails."""
        if self._process.wait():
            raise self.error()

    def error(self) -> RecordingError:
        """Return the error to raise if it does not work, with its last output, or with what to install."""
        self._log.seek(0)
        output = self._log.read()
        if "No graphics adapter" in output or "render context" in output:
            return RecordingError(NO_GRAPHICS)
        return RecordingError(f"the viewer does not work: {output.strip()[-1000:] or 'it does not answer'}")

    def close(self) -> None:
        """End it, if it has not ended yet."""
        self._process.terminate()
        try:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(END_S)
        finally:  # also if Ctrl-C is pressed once more while we wait
            if not self.has_ended:
                self._process.kill()
                self._process.wait()
            self._folder.cleanup()


def proxy_url(port: int) -> str:
    """Return the address at which a viewer receives chunks."""
    return f"rerun+http://{HOST}:{port}/proxy"
