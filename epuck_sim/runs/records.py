"""A trial to be run, the outcome of one that has ended, and how far a sweep is."""

from typing import NamedTuple

from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.result import TrialResult


class Task(NamedTuple):
    """A trial to be run."""

    point: int
    """Number of the point in the sweep."""
    trial: int
    seed: int
    scenario: Scenario
    interpret: bool
    """Whether controllers run as plain Python."""


class Outcome(NamedTuple):
    """A trial that has ended, with a result or with an error."""

    point: int
    trial: int
    seed: int
    result: TrialResult | None
    """Its result; None if it failed."""
    error: str | None
    """Message of the error with which it failed; None if it has a result."""
    provenance: dict[str, str]
    """Versions, and the host that ran it."""


class SweepProgress(NamedTuple):
    """How far a sweep is."""

    trials: int
    """Number of trials in the whole sweep."""
    stored: int
    """Number of trials that have a result."""
    censored: int | None
    """Number of stored trials that were not synchronised; None as long as none of them has a T_sync."""
    failed: int
    """Number of trials that failed in this run, as trials or for a measure that was added."""
    ended: int
    """Number of trials that ended in this run, with a result or with an error."""
