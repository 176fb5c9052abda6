"""What commands print of results: tables for people, JSON and CSV for programs."""

import json
import shutil
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from epuck_sim.display.table import Row, Table, plain
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.provenance import versions

if TYPE_CHECKING:
    from epuck_sim.statistics.measured import Measured


def show(tables: Sequence[Table], found: Any, *, as_json: bool, as_csv: bool = False) -> None:
    """Print tables on stdout, or what was found as JSON, or the first table as CSV."""
    if as_json:
        print(json.dumps(plain(found)))
    elif as_csv:
        print(tables[0].to_csv(), end="")
    else:
        print("\n\n".join(table.to_text(terminal_width()) for table in tables))


def terminal_width() -> int | None:
    """Return how many letters a line of stdout has; None if it is no terminal."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def print_trials(results: Sequence[TrialResult], max_cycles: int) -> None:
    """Print a table of trials of one scenario on stdout, and of several a line of statistics.

    Args:
        results: The trials.
        max_cycles: Limit of cycles at which they are censored.
    """
    if not results:
        return
    headings = {
        "t_sync": "T_sync (cycles)",
        "simulated_s": "simulated (s)",
        "wall_s": "wall (s)",
        "real_time": "x real time",
        **{name: name for name in results[0].measures},
    }
    has_order = any(result.order_parameter is not None for result in results)
    rows = [Row({"seed": each.seed}, _cells(each, has_order=has_order)) for each in results]
    print(Table(results[0].scenario, rows, (), headings).to_text(terminal_width()))
    if len(results) > 1 and results[0].censored is not None:
        print(_summary(results, max_cycles))


def _cells(result: TrialResult, *, has_order: bool) -> dict[str, Any]:
    """Return the cells that apply to a trial of its scenario: without oscillators there is no T_sync."""
    cells: dict[str, Any] = {}
    if result.censored is not None:
        cells["t_sync"] = result.t_sync_cycles
        cells["censored"] = f"yes, at {result.cycles}" if result.censored else "no"
    if result.censored is not None or has_order:
        cells["order_parameter"] = result.order_parameter
    times = {"simulated_s": result.simulated_s, "wall_s": result.wall_s, "real_time": result.real_time_factor}
    return {**cells, **times, **result.measures}


def _summary(results: Sequence[TrialResult], max_cycles: int) -> str:
    from epuck_sim.statistics.measured import Statistic  # what follows takes scipy
    from epuck_sim.statistics.statistic import estimate

    measured = _measured(results, max_cycles)
    mean, median = (estimate(measured, statistic) for statistic in (Statistic.MEAN, Statistic.MEDIAN))
    ends = f"{mean.name} {mean} cycles, {median.name} {median}"
    return f"T_sync of {len(results)} trials: {ends}; {100 * measured.censored:.0f} % censored"


def _measured(results: Sequence[TrialResult], max_cycles: int) -> "Measured":
    import numpy as np

    from epuck_sim.statistics.measured import Measured

    times = np.array([result.cycles for result in results], float)
    return Measured(times, np.array([not result.censored for result in results]), max_cycles, results[0].seed)


def print_trial_json(result: TrialResult) -> None:
    """Print a trial as one JSON object on a line of stdout, at once."""
    events = [event._asdict() for event in result.events]
    print(json.dumps({**result._asdict(), "events": events, "versions": versions()}), flush=True)
