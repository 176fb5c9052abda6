"""Rerun's own program, which comes with its package: run to its end, or in the background as a viewer."""

import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import rerun_cli

from epuck_sim.errors import RecordingError

HERE = "127.0.0.1"

_FOLDER = Path(rerun_cli.__file__).parent
_BUNDLED = _FOLDER / "Rerun.app" / "Contents" / "MacOS" / "Rerun"

PROGRAM = (str(_BUNDLED if _BUNDLED.exists() else _FOLDER / "rerun"),)
"""The program in rerun's package, itself: the package's own way to start it hides how it ends."""

QUIETLY = {"RERUN_ANALYTICS": "0", "RUST_LOG": "warn"}
"""Nobody is told of its use, unless the user's environment wants so."""

START_S = 30
"""So long a viewer may take to answer."""

END_S = 10
"""So long it may take to end when it is asked to."""

NO_GRAPHICS = (
    "the viewer finds no graphics driver; install one (Debian, Ubuntu: apt install mesa-vulkan-drivers), or give --web"
)


def run_rerun(*arguments: str) -> None:
    """Run rerun's program to its end; raises RecordingError with what it says where it fails."""
    done = subprocess.run(
        [*PROGRAM, *arguments], env={**QUIETLY, **os.environ}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RecordingError(f"rerun {' '.join(arguments[:2])} failed: {done.stderr.strip()}")


@contextmanager
def in_background(*arguments: str) -> Iterator["Viewer"]:
    """Yield rerun's program in the background; it ends with the block."""
    with tempfile.TemporaryFile("w+") as log:
        started = Viewer(log, *arguments)
        try:
            yield started
        finally:
            started.end()


class Viewer:
    """A viewer at work, in a process group of its own: Ctrl-C in the terminal reaches us, and we end it."""

    def __init__(self, log: IO[str], *arguments: str) -> None:
        self._log = log
        self._process = subprocess.Popen(
            [*PROGRAM, *arguments, "--bind", HERE],
            env={**QUIETLY, **os.environ},
            stdout=log,
            stderr=log,
            process_group=0,
        )

    def wait_for(self, port: int) -> None:
        """Wait until it answers at a port; raises RecordingError where it does not."""
        until = time.monotonic() + START_S
        while not self.has_ended and time.monotonic() < until:
            with socket.socket() as attempt:
                if attempt.connect_ex((HERE, port)) == 0:
                    return
            time.sleep(0.05)
        raise self.problem()

    @property
    def has_ended(self) -> bool:
        """Whether its window was closed, or it broke down."""
        return self._process.poll() is not None

    def wait(self) -> None:
        """Wait until it ends, by itself or by a window that is closed; raises RecordingError where it fails."""
        if self._process.wait():
            raise self.problem()

    def problem(self) -> RecordingError:
        """Return the error to raise where it does not do what it should."""
        self._log.seek(0)
        said = self._log.read()
        if "No graphics adapter" in said or "render context" in said:
            return RecordingError(NO_GRAPHICS)
        return RecordingError(f"the viewer does not work: {said.strip()[-1000:] or 'it does not answer'}")

    def end(self) -> None:
        """End it, if it has not ended yet."""
        self._process.terminate()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def free_port() -> int:
    """Return a port that nobody listens at."""
    with socket.socket() as found:
        found.bind((HERE, 0))
        return int(found.getsockname()[1])


def check_port(port: int) -> None:
    """Raise RecordingError where somebody listens at the port already, or nobody may."""
    with socket.socket() as attempt:
        attempt.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            attempt.bind((HERE, port))
        except OSError as error:
            raise RecordingError(
                f"port {port} cannot be used: {os.strerror(error.errno or 0)}; give another with --port"
            ) from error


def proxy(port: int) -> str:
    """Return the address at which a viewer takes chunks."""
    return f"rerun+http://{HERE}:{port}/proxy"
