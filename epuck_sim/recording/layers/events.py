"""A text log of what changed in a trial: entries of its schedule, and faults."""

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.recording.chunks import temporal_chunk
from epuck_sim.scenario.schedule import TrialEvent

EVENTS = "/events"
"""Entity with a text at each change."""


class EventLog:
    """Writes events, each once."""

    def __init__(self) -> None:
        self._written = 0

    def flush(self, events: Sequence[TrialEvent]) -> Iterator[Chunk]:
        """Yield those of a trial's events so far that are new."""
        new = events[self._written :]
        self._written = len(events)
        if new:
            time_ns = np.array([round(event.time_s * 1e9) for event in new])
            yield temporal_chunk(EVENTS, time_ns, *rr.TextLog.columns(text=[in_words(event) for event in new]))


def in_words(event: TrialEvent) -> str:
    """Return an event as one line of text."""
    whom = f" in {', '.join(map(str, event.robots))}" if event.robots else ""
    return f"{event.source}: {event.what}{whom}"
