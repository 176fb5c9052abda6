"""The faults that began and ended in a trial, as events."""

from itertools import groupby

from epuck_sim.embodied.faults import BEGUN, KINDS, RESTART, Faults
from epuck_sim.scenario.schedule import TrialEvent


def take_events(faults: Faults, step_ms: int) -> list[TrialEvent]:
    """Return what has begun and ended since the last call, one event for all robots in which a fault did so at once."""
    count = int(faults.log_length[0])
    changes = sorted((time_ms, fault, change, robot) for time_ms, fault, robot, change in faults.log[:count].tolist())
    faults.log_length[0] = 0
    events = []
    for (time_ms, fault, change), robots in groupby(changes, lambda each: each[:3]):
        what = _what(int(faults.kinds[int(fault)]), int(change))
        numbers = tuple(int(robot) for *_, robot in robots)
        events.append(TrialEvent(int(time_ms) // step_ms, time_ms / 1000, f"faults.{int(fault)}", what, numbers))
    return events


def _what(kind: int, change: int) -> str:
    """Return in words what a fault of a kind did."""
    name = next(name for name, number in KINDS.items() if number == kind)
    if kind == RESTART:
        return name
    return f"{name} {'begins' if change == BEGUN else 'ends'}"
