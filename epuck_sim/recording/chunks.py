"""Chunks, the pieces of which a recording is made: an entity, times, and the entity's values at those times."""

from collections.abc import Iterator
from contextlib import contextmanager

import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arrays import IntArray

APPLICATION = "epuck-sim"
"""Name by which the viewer matches layouts to recordings."""

TIMELINE = "sim_time"
"""Name of the only timeline of recordings: simulated time."""


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
