"""A trial to be run, the outcome of one that has ended, and how far a sweep is."""

from typing import NamedTuple
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.result import TrialResult


class Task(NamedTuple):
    """A trial to be run."""

    point: int
    """The number of its point in the sweep."""
    trial: int
    seed: int
    scenario: Scenario
    interpret: bool
    """Whether its controllers run as plain Python."""


class Outcome(NamedTuple):
    """A trial that has ended, one way or the other."""

    point: int
    trial: int
    seed: int
    result: TrialResult | None
    """None if it failed."""
    error: str | None
    """Why it failed."""
    provenance: dict[str, str]
    """Versions, and the host that ran it."""


class SweepProgress(NamedTuple):
    """How far a sweep is."""

    trials: int
    """All that are to be."""
    stored: int
    """Those that have a result."""
    censored: int
    """Of these, the ones that were not synchronised."""
    failed: int
    """Those that failed in this run."""
    ended: int
    """Those that ended in this run, one way or the other."""
