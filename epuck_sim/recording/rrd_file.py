"""The file of a recording: chunks, of which it is made, and how it gets its name only when it is complete."""

import hashlib
import mmap
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Full, Queue

import rerun as rr
from rerun.chunk import Chunk, LazyChunkStream

from epuck_sim.arrays import IntArray
from epuck_sim.errors import RecordingError
from epuck_sim.recording.process import run_rerun
from epuck_sim.util.atomic_write import check_target, publish, temporary_path, write_errors

APPLICATION = "epuck-sim"  # by which the viewer matches layouts to recordings
TIMELINE = "sim_time"
ENDING = ".rrd"  # by which the viewer knows a recording
QUEUE_LENGTH = 64  # most chunks that wait to be written; if the disk is slower than the simulation, that waits, too

SEAL = "/__properties/seal"
"""The property that holds the digest and the length of the file."""

_MARK = b"jV3xQm8kTz5wLr2NgY7u"  # stands before them
_BLANK = b"Kd81Xf3aP60cHe95Wb27Js4f0Mq7a2Zc9dT4eR6bV15G83Uy73Bn0eDa9Fc25Lh8ExWk1d6fS0b4390v"
"""What stands in their place while the digest is computed: 64 hexadecimal digits, and 16 of the length in bytes."""

_GUARD = b"oQzTvMwYhN"
"""What stands before and behind all this: the first and last bytes may go into what the file's compression repeats."""


@contextmanager
def strict_mode() -> Iterator[None]:
    """Have rerun raise an error in the block for malformed data, about which it would only warn."""
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


def temporal_chunk(entity: str, time_ns: IntArray, *columns: rr.ComponentColumn) -> Chunk:
    """Return a chunk with a row for each of these times, (rows,) in nanoseconds of simulated time."""
    return Chunk.from_columns(entity, [rr.TimeColumn(TIMELINE, duration=time_ns.astype("timedelta64[ns]"))], columns)


@contextmanager
def rrd_file(path: Path, recording_id: str, layout: bytes) -> Iterator[Callable[[Iterable[Chunk]], None]]:
    """Yield a writer of chunks into a recording, which gets its name when the block ends without an error.

    Args:
        path: The recording; an older one stays, and nothing else is left, if the block ends with an error.
        recording_id: The recording's name in the viewer.
        layout: Contents of a layout's file, which becomes a part of the recording; its empty recording takes this name.

    Raises:
        EpuckSimError: The file cannot be written.
    """
    check_recording_target(path)
    path = path.resolve()
    with temporary_path(path) as folder:
        layout_part, named_part, data_part, whole = (
            folder / f"{name}.rrd" for name in ("layout", "named", "data", "whole")
        )
        with _blaming(path):
            folder.mkdir()
            layout_part.write_bytes(layout)
            run_rerun("rrd", "route", "--recording-id", recording_id, str(layout_part), "-o", str(named_part))
        with _written(data_part, recording_id, path) as write:
            write([static_chunk(SEAL, rr.AnyValues(digest=(_GUARD + _MARK + _BLANK + _GUARD).decode()))])
            yield write
        with _blaming(path):
            run_rerun("rrd", "route", str(named_part), str(data_part), "-o", str(whole))
            _seal(whole)
            publish(whole, path)


@contextmanager
def _written(part: Path, recording_id: str, target: Path) -> Iterator[Callable[[Iterable[Chunk]], None]]:
    """Yield a writer of chunks into `part`, which will become `target`: each as it comes, so that memory does not grow.

    Rerun pulls chunks from an iterator until that ends, so it runs in a thread of its own.
    """
    chunks: Queue[Chunk | None] = Queue(QUEUE_LENGTH)
    stream = LazyChunkStream.from_iter(iter(chunks.get, None))
    problems: list[Exception] = []

    def pull() -> None:
        try:
            stream.write_rrd(part, application_id=APPLICATION, recording_id=recording_id)
        except Exception as error:  # `write` raises it in the thread that runs the trial
            problems.append(error)

    thread = threading.Thread(target=pull, daemon=True)
    thread.start()

    def put(chunk: Chunk | None) -> None:
        """Queue a chunk when there is room; drop it if the thread has ended, which only an error can make it do."""
        while thread.is_alive():
            with suppress(Full):
                chunks.put(chunk, timeout=0.1)
                return

    def write(given: Iterable[Chunk]) -> None:
        for chunk in given:
            put(chunk)
        for problem in problems:
            raise RecordingError(f"{target}: cannot be written: {problem}") from problem

    try:
        yield write
    finally:
        put(None)
        thread.join()
    write(())  # raises what came last


def _seal(path: Path) -> None:
    """Write the digest and the length of a file into it."""
    with path.open("r+b") as file, mmap.mmap(file.fileno(), 0) as contents:
        place = contents.find(_MARK) + len(_MARK)
        if contents[place : place + len(_BLANK)] != _BLANK:
            raise RecordingError("rerun has packed its digest")
        contents[place : place + len(_BLANK)] = _digest(contents, place)


def is_whole(path: Path) -> bool | None:
    """Return whether a file is as it was when it was sealed; None if that cannot be told.

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
    """Have errors in the block name the recording instead of its temporary files."""
    try:
        with write_errors(path):
            yield
    except RecordingError as error:
        raise RecordingError(f"{path}: cannot be written: {error}") from error


def check_recording_target(path: Path) -> None:
    """Raise EpuckSimError if no recording can be written to `path`: its suffix is wrong, or as `check_target` says."""
    if path.suffix != ENDING:
        raise RecordingError(f"{path}: a recording's name must end in {ENDING}, by which the viewer knows it")
    check_target(path)
