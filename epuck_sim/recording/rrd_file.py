"""A recording's file, which appears under its name only when it is whole."""

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Full, Queue

from rerun.chunk import Chunk, LazyChunkStream

from epuck_sim.errors import RecordingError
from epuck_sim.recording.chunks import APPLICATION
from epuck_sim.recording.viewer.process import run_rerun
from epuck_sim.util.atomic_write import check_target, temporary_path, write_errors

ENDING = ".rrd"

WAITING = 64
"""Chunks that may wait to be written; where a disk is slower than the simulation, that waits, too."""


@contextmanager
def rrd_file(path: Path, recording_id: str, layout: bytes) -> Iterator["ChunkWriter"]:
    """Yield what writes chunks into a recording, which takes the name `path` when the block ends without an error.

    layout: a layout's file; it becomes a part of the recording. Where the block ends with an error, nothing is left.
    Raises EpuckSimError where the file cannot be written.
    """
    check_recording_target(path)
    path = path.resolve()
    with temporary_path(path) as folder:
        layout_part, data_part, whole = (folder / name for name in ("layout.rbl", "data.rrd", "whole.rrd"))
        with _blaming(path):
            folder.mkdir()
            layout_part.write_bytes(layout)
        writer = ChunkWriter(data_part, recording_id, path)
        try:
            yield writer
        finally:
            writer.end()
        writer.check()
        with _blaming(path):
            run_rerun("rrd", "route", str(layout_part), str(data_part), "-o", str(whole))
            whole.replace(path)


@contextmanager
def _blaming(path: Path) -> Iterator[None]:
    """Have what goes wrong be told of the file that is to be."""
    try:
        with write_errors(path):
            yield
    except RecordingError as error:
        raise RecordingError(f"{path}: cannot be written: {error}") from error


def check_recording_target(path: Path) -> None:
    """Raise EpuckSimError where no recording can be written: as `check_target` does, and without its ending."""
    if path.suffix != ENDING:
        raise RecordingError(f"{path}: a recording's name must end in {ENDING}, by which the viewer knows it")
    check_target(path)


class ChunkWriter:
    """Writes chunks as they come, so that memory does not grow.

    Rerun itself takes the next chunk whenever it has written one, until there is no more: that needs a thread.
    """

    def __init__(self, part: Path, recording_id: str, target: Path) -> None:
        """Begin to write `part`; errors are told of `target`, the file that is to be."""
        self._part = part
        self._target = target
        self._chunks: Queue[Chunk | None] = Queue(WAITING)
        self._stream = LazyChunkStream.from_iter(iter(self._chunks.get, None))
        self._problem: Exception | None = None
        self._thread = threading.Thread(target=self._write, args=(recording_id,), daemon=True)
        self._thread.start()

    def _write(self, recording_id: str) -> None:
        try:
            self._stream.write_rrd(self._part, application_id=APPLICATION, recording_id=recording_id)
        except Exception as error:  # it is raised by `check`, in the thread that runs the trial
            self._problem = error

    def __call__(self, chunks: Iterable[Chunk]) -> None:
        """Have chunks written, soon; raises as `check` does."""
        for chunk in chunks:
            self._put(chunk)
        self.check()

    def _put(self, chunk: Chunk | None) -> None:
        """Wait until there is room, unless nothing is written any more."""
        while self._thread.is_alive():
            with suppress(Full):
                self._chunks.put(chunk, timeout=0.1)
                return

    def check(self) -> None:
        """Raise RecordingError if something could not be written."""
        if self._problem is not None:
            raise RecordingError(f"{self._target}: cannot be written: {self._problem}") from self._problem

    def end(self) -> None:
        """Wait until everything is written."""
        self._put(None)
        self._thread.join()
