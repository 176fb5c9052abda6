"""Trials that are simulated again for measures that were added: they must be the stored trials, to the bit."""

import json
from typing import NamedTuple

from epuck_sim.trial.result import TrialResult
from epuck_sim.util.messages import short_repr


class StoredResult(NamedTuple):
    """What is stored of a trial, and must not differ when it is simulated again."""

    t_sync_cycles: int | None
    order_parameter: float | None
    simulated_s: float
    steps: int
    cycles: int
    measured: str | None
    """JSON: value of each measure by its name."""
    events: str | None
    """JSON: what changed; None if nothing did."""


def events_json(result: TrialResult) -> str | None:
    """Return what changed in a trial as JSON; None if nothing did."""
    return json.dumps([event._asdict() for event in result.events]) if result.events else None


def difference(stored: StoredResult, result: TrialResult) -> str | None:
    """Return in what the repetition of a trial differs from what is stored of it; None if it does not."""
    fields = [name for name in stored._fields if name not in ("measured", "events")]
    pairs = [(name, getattr(stored, name), getattr(result, name)) for name in fields]
    pairs.append(("events", stored.events, events_json(result)))
    pairs += [(name, value, result.measures[name]) for name, value in json.loads(stored.measured or "{}").items()]
    for name, before, now in pairs:
        if json.dumps(before) != json.dumps(now):  # 1, 1.0 and true are equal, but not the same
            return (
                f"is not the trial that is stored, so that new measures are not its own: {name} is "
                f"{short_repr(before)} in the folder, {short_repr(now)} now; another version or host made it"
            )
    return None
