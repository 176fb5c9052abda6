"""Table of `epuck-sim summarize --of` for a series: its statistics at some of the cycles."""

import json
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.cli.tables import WIDE
from epuck_sim.display.numbers import in_digits
from epuck_sim.figures.labels import axis_labels
from epuck_sim.scenario.figure_axes import distinguishing_axes
from epuck_sim.statistics.series import PointSeries, SeriesStatistics
from epuck_sim.statistics.summary import finite_or_none

STEPS = (1, 2, 5)
"""Cycles of each decade that the table shows, besides the last one."""


def print_series(title: str, points: Sequence[PointSeries], as_json: bool) -> None:
    """Print the statistics of a series at each point of a sweep on stdout: at all cycles in JSON, else at some."""
    if as_json:
        print(json.dumps([{"axes": point.axes, **_as_object(point.statistics)} for point in points]))
        return
    table = Table(title=Text(f"{title} at cycles, with 95 % intervals"), title_justify="left")
    shown = distinguishing_axes([point.axes for point in points])
    for heading in (*axis_labels(shown[0]), "cycle", "trials", "mean", "median"):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for point, axes in zip(points, shown, strict=True):
        for row in _rows(point.statistics):
            table.add_row(*(Text(str(value)) for value in axes.values()), *row)
    Console(width=None if sys.stdout.isatty() else WIDE).print(table)
    print("Trials: those that reach the cycle and have a value there.")


def _rows(series: SeriesStatistics) -> Iterator[list[str]]:
    last = len(series.cycles)
    cycles = {step * 10**power for power in range(len(str(last))) for step in STEPS} | {last}
    for cycle in sorted(cycles):
        if 0 < cycle <= last:
            estimates = (_format(*each[cycle - 1].tolist()) for each in (series.mean, series.median))
            yield [str(cycle), str(series.known[cycle - 1]), *estimates]


def _format(value: float, low: float, high: float) -> str:
    numbers = [in_digits(number) for number in (value, low, high)]
    if "nan" not in numbers:
        return "{} ({} to {})".format(*numbers)
    return numbers[0].replace("nan", "-")


def _as_object(series: SeriesStatistics) -> dict[str, Any]:
    columns = {"cycle": series.cycles, "trials": series.trials, "known": series.known}
    for name, values in (("mean", series.mean), ("median", series.median)):
        columns |= dict(zip((name, f"{name}_low", f"{name}_high"), values.T, strict=True))
    return {
        name: [finite_or_none(number) if isinstance(number, float) else number for number in values.tolist()]
        for name, values in columns.items()
    }
