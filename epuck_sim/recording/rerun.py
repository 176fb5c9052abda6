"""Rerun's own program, which comes with its package and runs to its end or in the background, and its files.

A recording's file is made of chunks, and gets its name only when it is complete.
"""

import hashlib
import mmap
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun_cli
from rerun.chunk import Chunk, LazyChunkStream

from epuck_sim.arrays import IntArray
from epuck_sim.errors import RecordingError
from epuck_sim.util.atomic_write import check_target, publish, temporary_path, write_errors
from epuck_sim.util.machine import HOST
from epuck_sim.util.messages import storable

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

APPLICATION = "epuck-sim"  # name by which the viewer matches layouts to recordings
TIMELINE = "sim_time"
ENDING = ".rrd"  # suffix by which the viewer recognises a recording

SEAL = "/__properties/seal"  # the property that holds the digest and the length of the file

_MARK = b"jV3xQm8kTz5wLr2NgY7u"  # stands before the digest
_BLANK = b"Kd81Xf3aP60cHe95Wb27Js4f0Mq7a2Zc9dT4eR6bV15G83Uy73Bn0eDa9Fc25Lh8ExWk1dQfS0bT43Yv"
"""Placeholder for the digest, of 64 hexadecimal digits, and for the length in bytes, of 16.

It has no four such digits in a row: an id nearby may have the same four, and the file's compression would join the two.
"""

_GUARD = b"oQzTvMwYhN"
"""Guard before and behind mark and placeholder; the file's compression may take its outer bytes for a repetition."""


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


@contextmanager
def strict_mode() -> Iterator[None]:
    """Make rerun raise an error for malformed data in the block, instead of a warning."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def static_chunk(entity: str, values: rr.AsComponents) -> Chunk:
    """Return a chunk that holds at all times."""
    batches = values.as_component_batches()
    columns = [
        rr.ComponentColumn(each.component_descriptor(), each, lengths=[len(each.as_arrow_array())]) for each in batches
    ]
    return Chunk.from_columns(entity, [], columns)


def temporal_chunk(
    entity: str, time_ns: IntArray, columns: rr.ComponentColumnList, lengths: npt.ArrayLike | None = None
) -> Chunk:
    """Return a chunk with a row for each of these times, (rows,) in nanoseconds of simulated time.

    A row has one value, or as many as `lengths` says, for each row or for all of them.
    """
    parts = columns if lengths is None else columns.partition(np.broadcast_to(lengths, len(time_ns)))
    return Chunk.from_columns(entity, [rr.TimeColumn(TIMELINE, duration=time_ns.astype("timedelta64[ns]"))], parts)


@contextmanager
def rrd_file(path: Path, recording_id: str, layout: bytes) -> Iterator[Callable[[Iterable[Chunk]], None]]:
    """Yield a writer of chunks into a recording, which gets its name when the block ends without an error.

    Each call writes its chunks to the disk, as a part in a temporary folder, so that memory does not grow. `layout` has
    the bytes of a layout file: it becomes a part of the recording, and its empty recording gets `recording_id`.
    Raises EpuckSimError if the file cannot be written.
    """
    check_recording_target(path)
    path = path.resolve()
    # a separate thread writes, as rerun would take Ctrl-C for an error of its own
    with temporary_path(path) as folder, ThreadPoolExecutor(1) as thread:
        unnamed, whole, parts = folder / "layout.rrd", folder / "whole.rrd", [folder / "0.rrd"]

        def write(chunks: Iterable[Chunk]) -> None:
            if given := list(chunks):
                parts.append(folder / f"{len(parts)}.rrd")
                with _blaming(path):
                    stream = LazyChunkStream.from_iter(given)
                    names = {"application_id": APPLICATION, "recording_id": recording_id}
                    thread.submit(stream.write_rrd, parts[-1], **names).result()

        with _blaming(path):
            folder.mkdir()
            unnamed.write_bytes(layout)
            run_rerun("rrd", "route", "--recording-id", recording_id, str(unnamed), "-o", str(parts[0]))
        write([static_chunk(SEAL, rr.AnyValues(digest=(_GUARD + _MARK + _BLANK + _GUARD).decode()))])
        yield write
        with _blaming(path):
            run_rerun("rrd", "route", *map(str, parts), "-o", str(whole))
            with whole.open("r+b") as file, mmap.mmap(file.fileno(), 0) as contents:  # is sealed
                place = contents.find(_MARK) + len(_MARK)
                if contents[place : place + len(_BLANK)] != _BLANK:
                    raise RecordingError("rerun has packed its digest")
                contents[place : place + len(_BLANK)] = _digest(contents, place)
            publish(whole, path)


def is_whole(path: Path) -> bool | None:
    """Return whether a file is as it was when it was sealed; None if that is unknown.

    Version 0.1.0 wrote no seal, and a file that rerun's program has filtered or merged since is another file.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as contents:
        place = contents.find(_MARK) + len(_MARK)
        found, made = contents[place : place + len(_BLANK)], _digest(contents, place)
        return found == made if found[64:] == made[64:] else None


def _digest(contents: mmap.mmap, place: int) -> bytes:
    """Return the digest of contents with blank digits at a place, and their length."""
    with memoryview(contents) as view:
        digest = hashlib.sha256(view[:place])
        digest.update(_BLANK)
        digest.update(view[place + len(_BLANK) :])
        return f"{digest.hexdigest()}{len(view):016x}".encode()


@contextmanager
def _blaming(path: Path) -> Iterator[None]:
    """Make errors in the block name the recording instead of its temporary files."""
    try:
        with write_errors(path):
            yield
    except (RecordingError, RuntimeError) as error:  # rerun raises the latter
        raise RecordingError(f"{path}: cannot be written: {error}") from error


def check_recording_target(path: Path) -> None:
    """Raise EpuckSimError if no recording can be written to `path`: a wrong suffix, or an error of `check_target`."""
    if path.suffix != ENDING:
        raise RecordingError(f"{path}: a recording's name must end in {ENDING}, by which the viewer knows it")
    check_target(path)
    if (name := str(path.resolve())) != (shown := storable(name)):  # rerun would break down
        raise RecordingError(f"{shown}: is no name in Unicode; allowed: names, also of its folders, in UTF-8")
