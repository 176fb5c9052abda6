"""What people see of a sweep: how far it is, what a run folder holds, and the statistics of its points."""

import json
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.display.numbers import format_estimate, in_digits, in_words
from epuck_sim.figures.labels import axis_labels, quantity_label
from epuck_sim.measures.interface import Value
from epuck_sim.runs.status import Failure, Status
from epuck_sim.scenario.figure_axes import distinguishing_axes
from epuck_sim.statistics.estimate import MIN_TRIALS
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.provenance import format_versions, versions

if TYPE_CHECKING:  # or every command would wait for scipy
    from epuck_sim.statistics.summary import PointSummary

WIDE = 1000
"""Width in columns of a table that goes to a file: enough for any."""

MOST_FAILURES = 10
"""Maximum number of failed trials that are listed."""


def print_status(status: Status, as_json: bool) -> None:
    """Print how far a sweep is on stdout."""
    if as_json:
        rows = {name: [row._asdict() for row in getattr(status, name)] for name in ("failed", "versions")}
        print(json.dumps({**status._asdict(), **rows}))
        return
    print(f"{status.scenario}: {status.points} points, {status.stored} of {status.trials} trials have a result")
    censored = "" if status.censored is None else f"censored: {status.censored}; "
    print(f"  {censored}failed: {len(status.failed)}; computing time: {in_words(status.wall_s)}")
    if status.unmeasured:
        print(f"  {status.unmeasured} of these results lack measures that were added")
    for row in status.versions:
        print(f"  {row.trials} trials: {format_versions(row.made_by)}")
    if status.at_work:
        print(f"  {status.at_work} is at work on it")
    print_failures(status.failed)


def print_failures(failures: Sequence[Failure]) -> None:
    """Print the first failed trials on stdout, each with the words that run it alone."""
    for failure in failures[:MOST_FAILURES]:
        print(f"  failed: --point {failure.point} --trial {failure.trial}: {failure.error}")
    if len(failures) > MOST_FAILURES:
        print(f"  and {len(failures) - MOST_FAILURES} more")


def print_summary(folder: str, of: str | None, points: "Sequence[PointSummary]", as_json: bool) -> None:
    """Print the statistics of T_sync, or of the measure `of`, at a sweep's points on stdout."""
    from epuck_sim.statistics.summary import applicable_statistics  # which loads scipy

    if as_json:
        print(json.dumps([point._asdict() for point in points]))
        return
    statistics = applicable_statistics(points)
    title = f"{folder}: {quantity_label(of)}, with 95 % intervals"
    table = Table(title=Text(title), title_justify="left")
    shown = distinguishing_axes([point.axes for point in points])
    censored = ["censored"] * (of is None)
    for heading in ("point", *axis_labels(shown[0]), "trials", *censored, *statistics.values()):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for point, axes in zip(points, shown, strict=True):
        table.add_row(
            str(point.point),
            *(Text(str(value)) for value in axes.values()),
            str(point.trials),
            *[f"{point.censored:.0%}"] * len(censored),
            *(format_estimate(*point.estimate(statistic)) for statistic in statistics),
        )
    Console(width=None if sys.stdout.isatty() else WIDE).print(table)
    if any(point.censored for point in points):
        print("Mean: of all trials, where none is censored. Restricted mean: of the lesser of T_sync and the limit of")
        print("cycles, or the longest trial. Weibull mean: extrapolated by Appendix A. -: undetermined.")
    _print_missing_intervals([point.trials for point in points])


def _print_missing_intervals(trials: Sequence[int]) -> None:
    """Print why points have no interval, if some have too few trials for one."""
    few = sum(0 < count < MIN_TRIALS for count in trials)
    if few:
        print(f"No intervals at {few} of {len(trials)} points: one takes {MIN_TRIALS} trials or more.")


def print_trials(results: Sequence[TrialResult]) -> None:
    """Print a readable table of trials of one scenario on stdout."""
    if not results:
        return
    table = Table(title=Text(results[0].scenario), title_justify="left")
    table.add_column("seed", justify="right", no_wrap=True)  # which has to be whole to be given as --seed
    columns = {**_outcome_columns(results), **_TIME_COLUMNS}
    for heading in columns:
        longest = max(map(len, heading.split()))
        table.add_column(Text(heading), justify="right", min_width=longest)  # Text, or [s] would be markup
    for name in results[0].measures:
        table.add_column(Text(name), justify="right", no_wrap=True)
    for result in results:
        cells = (cell(result) for cell in columns.values())
        table.add_row(str(result.seed), *cells, *map(_format_value, result.measures.values()))
    Console(width=None if sys.stdout.isatty() else 120).print(table)


_TIME_COLUMNS: dict[str, Callable[[TrialResult], str]] = {
    "simulated [s]": lambda result: f"{result.simulated_s:.1f}",
    "wall [s]": lambda result: f"{result.wall_s:.2f}",
    "x real time": lambda result: f"{result.real_time_factor:.0f}",
}
"""Columns of every trial, and their cells."""


def _outcome_columns(results: Sequence[TrialResult]) -> dict[str, Callable[[TrialResult], str]]:
    """Return the columns that apply to trials of one scenario, and their cells: without oscillators there are none."""
    columns: dict[str, Callable[[TrialResult], str]] = {}
    if results[0].censored is not None:
        columns["T_sync [cycles]"] = lambda result: _or_dash(result.t_sync_cycles, "d")
        columns["censored"] = lambda result: f"yes, at {result.cycles}" if result.censored else "no"
    if columns or any(result.order_parameter is not None for result in results):
        columns["order par."] = lambda result: _or_dash(result.order_parameter, ".3f")
    return columns


def _or_dash(number: float | None, form: str) -> str:
    return "-" if number is None else format(number, form)


def _format_value(value: Value) -> str:
    """Return the value of a measure as a table shows it; of a series, how long it is."""
    if isinstance(value, list):
        return f"{len(value)} values"
    if value is None or isinstance(value, bool):
        return "-" if value is None else "yes" if value else "no"
    return in_digits(value)


def print_trial_json(result: TrialResult) -> None:
    """Print a trial as one JSON object on a line of stdout, at once."""
    events = [event._asdict() for event in result.events]
    print(json.dumps({**result._asdict(), "events": events, "versions": versions()}), flush=True)
