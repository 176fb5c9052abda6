"""The numbers of figures as CSV files, beside the pictures."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.statistics.curve_extrema import ExtremaSearch
from epuck_sim.statistics.curves import Curve
from epuck_sim.util.atomic_write import atomic_write

POINT_COLUMNS = ("trials", "censored", "statistic", "estimate", "low", "high")
"""Columns after the axes in a table of curves: number of trials, share of censored ones, what the estimate is,
and cycles."""

EXTREMA_COLUMNS = tuple(f"{name}{end}" for name in ("v_m", "t_m", "v_p", "t_p") for end in ("", "_low", "_high"))
"""Columns of the minimum and the peak in the table of extrema, cm/s and cycles."""

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


def extrema_table(curves: Sequence[Curve], searches: Sequence[ExtremaSearch]) -> Table:
    """Return a table with the minimum and the peak of each curve."""
    return Table((*curves[0].axes, *EXTREMA_COLUMNS, "p_value", "reason"), _extrema_rows(curves, searches))


def _extrema_rows(curves: Sequence[Curve], searches: Sequence[ExtremaSearch]) -> Iterator[list[Any]]:
    """Yield a row for each curve, with the p-value alone where the pair may be noise, or why there is none."""
    for curve, (each, reason) in zip(curves, searches, strict=True):
        numbers = [np.nan] * len(EXTREMA_COLUMNS)
        if each is not None and each.is_found:
            numbers = [n for estimate, ends in zip(each[:4], each.intervals, strict=True) for n in (estimate, *ends)]
        p_value = np.nan if each is None else each.p_value
        yield [*curve.axes.values(), *map(rounded, numbers), rounded(p_value), reason]


def rounded(number: float) -> str:
    """Return a number with the digits of tables, and nothing for one that is not finite.

    >>> rounded(1234.56789), rounded(float("nan"))
    ('1234.57', '')
    """
    return f"{number:.{DIGITS}g}" if np.isfinite(number) else ""
