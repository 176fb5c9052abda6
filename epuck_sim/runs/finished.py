"""The trials of a sweep that need not be run any more, at a byte for each."""

from collections.abc import Iterable, Iterator, Set
from typing import cast


class FinishedTrials(Set[tuple[int, int]]):
    """A set of numbers of points and trials; millions of them take little memory."""

    def __init__(self, trials: Iterable[tuple[int, int]]) -> None:
        """Take the trials in; those of a point may come in any order."""
        self._marks: dict[int, bytearray] = {}
        for point, trial in trials:
            marks = self._marks.setdefault(point, bytearray())
            if trial >= len(marks):
                marks.extend(bytes(trial + 1 - len(marks)))
            marks[trial] = 1
        self._count = sum(marks.count(1) for marks in self._marks.values())

    def __contains__(self, trial: object) -> bool:
        point, number = cast(tuple[int, int], trial)
        marks = self._marks.get(point, b"")
        return number < len(marks) and marks[number] == 1

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[tuple[int, int]]:
        for point, marks in self._marks.items():
            yield from ((point, trial) for trial, mark in enumerate(marks) if mark)
