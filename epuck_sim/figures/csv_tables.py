"""The numbers of figures as CSV files, beside the pictures."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.statistics.curves import Curve
from epuck_sim.util.atomic_write import atomic_write

POINT_COLUMNS = ("trials", "censored", "statistic", "estimate", "low", "high")
"""Columns after the axes in a table of curves: number of trials, share of censored ones, what the estimate is,
and cycles."""

DIGITS = 6
"""Significant digits of numbers in tables."""


class Table(NamedTuple):
    """What a CSV file holds."""

    columns: Sequence[str]
    rows: Iterable[Sequence[Any]]


def save_table(file: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a CSV file; raise EpuckSimError where it cannot be written."""
    with atomic_write(file) as part, part.open("w", newline="", encoding="utf-8") as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)


def curves_table(axis: str, curves: Sequence[Curve]) -> Table:
    """Return a table with a row for each point of curves over `axis`; their other axes come first."""
    return Table((*curves[0].axes, axis, *POINT_COLUMNS), _point_rows(curves))


def _point_rows(curves: Sequence[Curve]) -> Iterator[list[Any]]:
    for curve in curves:
        columns = (curve.x, curve.trials, curve.censored, curve.names, curve.values, *curve.intervals.T)
        for x, trials, censored, name, *numbers in zip(*columns, strict=True):
            yield [*curve.axes.values(), *map(rounded, (x, trials, censored)), name, *map(rounded, numbers)]


def rounded(number: float) -> str:
    """Return a number with the digits of tables, and nothing for one that is not finite.

    >>> rounded(1234.56789), rounded(float("nan"))
    ('1234.57', '')
    """
    return f"{number:.{DIGITS}g}" if np.isfinite(number) else ""
