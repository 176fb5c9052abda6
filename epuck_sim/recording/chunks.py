"""Chunks, the pieces of which a recording is made: an entity, times, and what it held at each of them."""

from collections.abc import Iterator
from contextlib import contextmanager

import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arrays import IntArray

APPLICATION = "epuck-sim"
"""By it the viewer knows which layout belongs to a recording."""

TIMELINE = "sim_time"


@contextmanager
def strictly() -> Iterator[None]:
    """Have rerun raise where it would warn, and leave out what it cannot make sense of."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def still(entity: str, what: rr.AsComponents) -> Chunk:
    """Return a chunk that holds at all times."""
    batches = what.as_component_batches()
    columns = [
        rr.ComponentColumn(each.component_descriptor(), each, lengths=[len(each.as_arrow_array())]) for each in batches
    ]
    return Chunk.from_columns(entity, [], columns)


def moving(entity: str, time_ns: IntArray, *columns: rr.ComponentColumn) -> Chunk:
    """Return a chunk with a row for each of these times, (rows,) in nanoseconds of simulated time."""
    return Chunk.from_columns(entity, [rr.TimeColumn(TIMELINE, duration=time_ns.astype("timedelta64[ns]"))], columns)
