"""What people see of a sweep: how far it is, what a run folder holds, and the statistics of its points."""

import json
import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table
from rich.text import Text

from epuck_sim.cli.progress import LINE_S, REFRESH_S
from epuck_sim.figures.labels import key_name
from epuck_sim.runs.reader import Failure, Status
from epuck_sim.statistics.curves import told_apart
from epuck_sim.statistics.summary import PointSummary
from epuck_sim.sweep.run import Tally

WIDE = 1000
"""Columns of a table that goes to a file: as many as it takes."""

MOST_FAILURES = 10
"""So many failed trials are listed."""


class SweepProgress:
    """An onlooker of a sweep that shows on stderr how far it is; to be used in a `with` block."""

    def __init__(self) -> None:
        console = Console(stderr=True)
        columns = (BarColumn(), TextColumn("{task.description}"))
        self._bar = Progress(*columns, console=console, auto_refresh=False) if console.is_terminal else None
        self._pause_s = REFRESH_S if self._bar else LINE_S
        self._next = 0.0
        self._began: float | None = None
        self.tally: Tally | None = None

    def __call__(self, tally: Tally) -> None:
        """Show the tally, if it is time to."""
        self.tally = tally
        now = time.monotonic()
        if tally.ended and self._began is None:
            self._began = now  # the first trial waits for workers to start: no measure of the others
        if now < self._next and tally.stored + tally.failed < tally.trials:
            return
        self._next = now + self._pause_s
        self._show(tally, self._words(tally, now))

    def _words(self, tally: Tally, now: float) -> str:
        failed = f", {tally.failed} failed" if tally.failed else ""
        words = f"{tally.stored} of {tally.trials} trials, {tally.censored} censored{failed}"
        left = tally.trials - tally.stored - tally.failed
        if self._began is None or tally.ended < 2:
            return f"{words}; starting workers" if left else words
        a_minute = (tally.ended - 1) / max(now - self._began, 1e-9) * 60
        return f"{words}, {a_minute:.0f} a minute, {in_words(left / a_minute * 60)} left"

    def _show(self, tally: Tally, words: str) -> None:
        if self._bar is None:
            print(words, file=sys.stderr, flush=True)
            return
        if not self._bar.task_ids:
            self._bar.add_task("", total=tally.trials)
        self._bar.update(self._bar.task_ids[0], completed=tally.stored + tally.failed, description=words)
        self._bar.refresh()

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._bar:
            self._bar.stop()


def in_words(seconds: float) -> str:
    """Return a time as people say it.

    >>> in_words(42), in_words(200), in_words(20000)
    ('42 s', '3 min', '5.6 h')
    """
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def print_status(status: Status, as_json: bool) -> None:
    """Print how far a sweep is on stdout."""
    if as_json:
        print(json.dumps({**status._asdict(), "failed": [failure._asdict() for failure in status.failed]}))
        return
    print(f"{status.scenario}: {status.points} points, {status.stored} of {status.trials} trials have a result")
    print(f"  censored: {status.censored}; failed: {len(status.failed)}; computing time: {in_words(status.wall_s)}")
    for versions, count in status.versions.items():
        print(f"  {count} trials: {versions}")
    if status.at_work:
        print(f"  {status.at_work} is at work on it")
    print_failures(status.failed)


def print_failures(failures: Sequence[Failure]) -> None:
    """Print the first failed trials on stdout, each with the words that run it alone."""
    for failure in failures[:MOST_FAILURES]:
        print(f"  failed: --point {failure.point} --trial {failure.trial}: {failure.error}")
    if len(failures) > MOST_FAILURES:
        print(f"  and {len(failures) - MOST_FAILURES} more")


def print_summary(title: str, points: Sequence[PointSummary], as_json: bool) -> None:
    """Print the statistics of a sweep's points on stdout."""
    if as_json:
        print(json.dumps([point._asdict() for point in points]))
        return
    table = Table(title=Text(f"{title}: T_sync [cycles], with 95 % intervals"), title_justify="left")
    told = told_apart([point.axes for point in points])
    for heading in ("point", *map(key_name, told[0]), "trials", "censored", "mean", "median", "restricted mean"):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for point, axes in zip(points, told, strict=True):
        table.add_row(
            str(point.point),
            *(Text(str(value)) for value in axes.values()),
            str(point.trials),
            f"{point.censored:.0%}",
            _estimate(point.mean, point.mean_low, point.mean_high),
            _estimate(point.median, point.median_low, point.median_high),
            "-" if point.restricted_mean is None else in_digits(point.restricted_mean),
        )
    Console(width=None if sys.stdout.isatty() else WIDE).print(table)
    print("Mean: Appendix A; -: undetermined. Restricted mean: up to the limit of cycles, or to the longest trial.")


def _estimate(value: float | None, low: float | None, high: float | None) -> str:
    if value is None or low is None:
        return "-" if value is None else in_digits(value)
    return f"{in_digits(value)} ({in_digits(low)} to {'?' if high is None else in_digits(high)})"


def in_digits(value: float) -> str:
    """Return a number of cycles with four digits, or all that are before the point.

    >>> in_digits(12345.6), in_digits(47.0271)
    ('12346', '47.03')
    """
    return f"{value:.0f}" if value >= 1000 else f"{value:.4g}"
