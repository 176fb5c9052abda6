"""Processes that tests start: they hear Ctrl-C whoever runs the tests, and none outlives its test."""

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import psutil

COMMAND = [sys.executable, "-m", "epuck_sim"]

_MARK = "EPUCK_SIM_STARTED_BY_TESTS"

_started: list[tuple[subprocess.Popen, str]] = []


def start(arguments: Sequence[str | Path], mark: str = "", **options: Any) -> subprocess.Popen:
    """Start a process in a session, and so in a process group, of its own; its output goes to pipes, as text.

    SIGINT has its default effect there, even if these tests run where it is ignored: in the background, or under nohup.
    The process, and all that it has started, is ended after the test.

    Args:
        arguments: Program and arguments.
        mark: Value of EPUCK_SIM_TEST in the environment of all its processes; see `processes_marked`.
        options: Options of `subprocess.Popen` that differ from these.

    """
    token = uuid.uuid4().hex
    marks = {"EPUCK_SIM_TEST": mark, _MARK: token} if mark else {_MARK: token}
    environment = {**os.environ, **options.pop("env", {}), **marks}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # what runs first in the process calls nothing that another thread may have locked
    defaults = {**pipes, "start_new_session": True, "preexec_fn": _restore_sigint}
    process = subprocess.Popen([*map(str, arguments)], env=environment, **{**defaults, **options})
    _started.append((process, token))
    return process


def _restore_sigint() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def end_all() -> None:
    """End every process that `start` has started, and all that those have started."""
    while _started:
        process, token = _started.pop()
        process.kill()
        for number in processes_marked(token, _MARK):
            os.kill(number, signal.SIGKILL)
        process.wait()
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe is not None:
                pipe.close()


def wait_until(condition, limit_s: float = 300.0) -> None:
    """Wait until `condition()` holds; fail after `limit_s`."""
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "it never came to that"
        time.sleep(0.01)


def processes_marked(mark: str, name: str = "EPUCK_SIM_TEST") -> list[int]:
    """Return the processes in whose environment `name` is `mark`."""
    running = psutil.process_iter(["environ"])  # None for what is not ours
    return [process.pid for process in running if (process.info["environ"] or {}).get(name) == mark]
