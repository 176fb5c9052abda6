"""The trials of a sweep that need not be run any more, at a byte for each."""

import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Set
from typing import Self, cast

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.runs.columns import read_numbers


class FinishedTrials(Set[tuple[int, int]]):
    """A set of numbers of points and trials; millions of them take little memory."""

    def __init__(self, trials: Iterable[tuple[int, int]] = ()) -> None:
        """Take the trials in; those of a point may come in any order."""
        self._marks: dict[int, bytearray] = {}
        for point, trial in trials:
            self._mark(point, np.array([trial]))

    @classmethod
    def read(cls, connection: sqlite3.Connection, which: str, numbers: Mapping[str, int]) -> Self:
        """Return the trials that a part of a query names, from FROM on.

        Args:
            connection: A connection to a database.
            which: The part of a query.
            numbers: Number of each point by its key.
        """
        finished = cls()
        for key, text in connection.execute(f"SELECT point, group_concat(trial) {which} GROUP BY point"):
            finished._mark(numbers[key], read_numbers(text))
        return finished

    def _mark(self, point: int, trials: IntArray) -> None:
        marks = self._marks.setdefault(point, bytearray())
        marks.extend(bytes(max(0, int(trials.max()) + 1 - len(marks))))
        np.frombuffer(marks, np.uint8)[trials] = 1

    def count(self, point: int, wanted: range) -> int:
        """Return how many of the wanted trials of a point are in the set."""
        return self._marks.get(point, bytearray())[wanted.start : wanted.stop : wanted.step].count(1)

    def missing(self, point: int, wanted: range) -> Iterator[int]:
        """Yield the indices into `wanted` of those trials of a point that are not in the set."""
        marks = self._marks.get(point, bytearray())[wanted.start : wanted.stop : wanted.step]
        place = marks.find(0)
        while place >= 0:
            yield place
            place = marks.find(0, place + 1)
        yield from range(len(marks), len(wanted))

    def __contains__(self, trial: object) -> bool:
        point, number = cast(tuple[int, int], trial)
        marks = self._marks.get(point, b"")
        return number < len(marks) and marks[number] == 1

    def __len__(self) -> int:
        return sum(marks.count(1) for marks in self._marks.values())

    def __iter__(self) -> Iterator[tuple[int, int]]:
        for point, marks in self._marks.items():
            yield from ((point, trial) for trial, mark in enumerate(marks) if mark)
