"""The entities and properties in a recording's file."""

import warnings
from collections import defaultdict
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from rerun.chunk import Chunk, RrdReader

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import RecordingError
from epuck_sim.recording.chunks import APPLICATION, TIMELINE
from epuck_sim.recording.rrd_file import ENDING, is_whole
from epuck_sim.recording.viewer.process import crashes_on


class Entities:
    """The properties in a recording's file, and some of its entities."""

    def __init__(self, path: Path, *entities: str) -> None:
        self._properties: dict[str, dict[str, Any]] = defaultdict(dict)
        self._batches: dict[str, list[pa.RecordBatch]] = defaultdict(list)
        for chunk in _read_chunks(path, ["/__properties/**", *entities]):
            if chunk.is_static:
                self._properties[chunk.entity_path] |= chunk.to_record_batch().to_pydict()
            else:
                self._batches[chunk.entity_path].append(chunk.to_record_batch())
        for batches in self._batches.values():
            batches.sort(key=lambda batch: batch.column(TIMELINE)[0].value)

    def properties(self, name: str) -> dict[str, Any]:
        """Return the values of a property by key; none if there is no such property."""
        columns = self._properties[f"/__properties/{name}"]
        return {key: value[0][0] for key, value in columns.items() if isinstance(value[0], list)}

    def times(self, entity: str) -> FloatArray:
        """Return (rows,) s: the times of an entity's rows."""
        times = [batch.column(TIMELINE).cast(pa.int64()).to_numpy() for batch in self._batches[entity]]
        return np.concatenate([np.empty(0), *times]) / 1e9

    def values(self, entity: str, component: str) -> FloatArray:
        """Return the numbers of a component in all rows, one after the other."""
        columns = [batch.column(component).flatten() for batch in self._batches[entity]]
        numbers = [column.flatten() if pa.types.is_fixed_size_list(column.type) else column for column in columns]
        return np.concatenate([np.empty(0), *(number.to_numpy() for number in numbers)])

    def texts(self, entity: str, component: str) -> list[str]:
        """Return the texts of a component in all rows, one after the other."""
        columns = [batch.column(component).flatten() for batch in self._batches[entity]]
        return [text for column in columns for text in column.to_pylist()]

    def lengths(self, entity: str, component: str) -> IntArray:
        """Return (rows,) how many values a component has in each row."""
        counts = [pc.fill_null(pc.list_value_length(batch.column(component)), 0) for batch in self._batches[entity]]
        return np.concatenate([np.empty(0, np.int64), *(count.to_numpy() for count in counts)])


@lru_cache(maxsize=64)
def _is_damaged(path: Path, _mtime_ns: int) -> bool:
    """Return whether a file is not what was written; asked once for each state of a file, as all of it is read."""
    whole = is_whole(path)
    return crashes_on(path) if whole is None else not whole


def _read_chunks(path: Path, entities: list[str]) -> list[Chunk]:
    if not path.is_file():
        raise RecordingError(f"{path}: {'is not a file' if path.exists() else 'there is no such file'}")
    if path.suffix != ENDING:  # which the viewer requires, too
        raise RecordingError(f"{path}: is not a recording: the name must end in {ENDING}")
    if path.stat().st_size and _is_damaged(path.resolve(), path.stat().st_mtime_ns):
        raise RecordingError(f"{path}: is not a complete recording: it is damaged; record the trial again")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a truncated file, which is refused below
        try:
            reader = RrdReader(path)
            found = reader.recordings()
            if len(found) == 1 and found[0].application_id == APPLICATION:
                return reader.store().stream().filter(content=entities).to_chunks()
        except (RuntimeError, ValueError) as error:
            if "Not an RRD file" in str(error):
                raise RecordingError(f"{path}: is not a recording, though its name ends in {ENDING}") from error
            reason = "its end is missing" if "footer" in str(error) else error
            raise RecordingError(f"{path}: is not a complete recording: {reason}; record the trial again") from error
    programs = ", ".join(sorted({entry.application_id for entry in found})) or "no program"
    raise RecordingError(
        f"{path}: holds {len(found)} recordings, made by {programs}; allowed: one made by {APPLICATION}"
    )
