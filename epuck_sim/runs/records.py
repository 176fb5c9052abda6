"""A trial to be run, the outcome of one that has ended, which trials have a result, and how far a sweep is."""

import pickle
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, IntArray
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.seeds import point_seed


class Task(NamedTuple):
    """A trial to be run."""

    point: int  # number of the point in the sweep
    trial: int
    key: str  # the point's axis values as text
    scenario: Scenario
    interpret: bool  # whether controllers run as plain Python

    @property
    def seed(self) -> int:
        """Seed of the trial, which its worker derives."""
        return point_seed(self.scenario.seed, self.key, self.trial)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the scenario, which takes longer than all else that is done for a task, once a point."""
        return _unpacked_task, (*self[:3], _packed(self.scenario), self.interpret)


MOST_PACKED = 1000  # most scenarios of which the bytes are kept

_kept: dict[int, tuple[Scenario, bytes]] = {}
"""Scenarios by their `id`, which is theirs as long as they are kept, and their bytes."""


def _packed(scenario: Scenario) -> bytes:
    if id(scenario) not in _kept:
        if len(_kept) >= MOST_PACKED:
            _kept.clear()
        _kept[id(scenario)] = scenario, pickle.dumps(scenario)
    return _kept[id(scenario)][1]


@lru_cache(MOST_PACKED)
def _unpacked(packed: bytes) -> Scenario:
    scenario: Scenario = pickle.loads(packed)
    return scenario


def _unpacked_task(point: int, trial: int, key: str, packed: bytes, interpret: bool) -> Task:
    return Task(point, trial, key, _unpacked(packed), interpret)


class Outcome(NamedTuple):
    """A trial that has ended, with a result or with an error."""

    point: int
    trial: int
    seed: int
    result: TrialResult | None  # its result; None if it failed
    error: str | None  # message of the error with which it failed; None if it has a result
    provenance: dict[str, str]  # versions, and the host that ran it


class SweepProgress(NamedTuple):
    """How far a sweep is."""

    trials: int  # number of trials in the whole sweep
    stored: int  # number of trials that have a result
    censored: int | None
    """Number of stored trials that were not synchronised; None as long as none of them has a T_sync."""
    failed: int  # number of trials that failed in this run, as trials or for a measure that was added
    ended: int  # number of trials that ended in this run, with a result or with an error
    last: Outcome | None = None  # the last of these
    narrow: int | None = None  # number of points whose intervals are narrow enough; None if that was not asked for


class FinishedTrials:
    """The trials that need not be run any more, at a byte for each; iterated, numbers of points and trials."""

    def __init__(self, trials: Iterable[tuple[int, Sequence[int] | IntArray]]) -> None:
        """Take in points, each once, with the numbers of their trials."""
        self._marks = {point: np.bincount(numbers) > 0 for point, numbers in trials}

    def _of(self, point: int, wanted: range) -> BoolArray:
        return self._marks.get(point, np.zeros(0, bool))[wanted.start : wanted.stop : wanted.step]

    def count(self, point: int, wanted: range) -> int:
        """Return how many of the wanted trials of a point are in the set."""
        return int(np.count_nonzero(self._of(point, wanted)))

    def missing(self, point: int, wanted: range) -> Iterator[int]:
        """Yield the indices into `wanted` of those trials of a point that are not in the set."""
        marks = self._of(point, wanted)
        yield from map(int, np.flatnonzero(~marks))
        yield from range(len(marks), len(wanted))

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return ((point, int(trial)) for point, marks in self._marks.items() for trial in np.flatnonzero(marks))
