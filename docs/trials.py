"""The trials that claims are tested on, as tables: `python -m docs.trials` tests the claims on them, in a fresh clone.

It writes the page docs/replication.md with its tables and figures anew from the tables in docs/trials, and ends with 1
if a text was another before. `python -m docs.trials FOLDER` first writes the tables of the sweeps that have run folders
in FOLDER, that of `epuck-sim replicate --out FOLDER`.

The rows of a point are its trials 0, 1, ... in order. Seeds, which would take four fifths of the room, are not in them:
`epuck_sim.points(scenario)[point].seed(trial)` gives each.
"""

import csv
import gzip
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.display.table import csv_text
from epuck_sim.replication.claims import Check, Claims, read_claims
from epuck_sim.replication.page import read_contents, write_replication
from epuck_sim.replication.sweeps import Trials, needed_sweeps, sweep_folder
from epuck_sim.replication.verdicts import reduction
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.loader import Point, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.atomic_write import atomic_write

DOCS = Path(__file__).parent
TABLES = DOCS / "trials"
TIMES = TABLES / "computing_s.csv"  # computing time of each sweep, s

PAGE = [DOCS / f"replication{ending}" for ending in (".md", ".csv", "-tests.csv", "-sweeps.csv")]
WRITTEN_BY = Path("runs/replication")  # the folder of a replication that the page names

COLUMNS = ("point", "cycles", "censored")
"""Columns before those of measures: number of the point, cycle at which the trial ended, 1 if it is censored."""


def column(check: Check) -> str:
    """Return the name of the column of a test's measure, or of what stands for its series."""
    return " ".join(filter(None, (check.of, reduction(check))))


class Tables(Trials):
    """The trials in docs/trials."""

    def __init__(self, scenarios: dict[str, Scenario]) -> None:
        """Take the scenario of each sweep."""
        super().__init__(dict.fromkeys(scenarios, TABLES))
        self._points = {sweep: points(scenario) for sweep, scenario in scenarios.items()}
        self._times = read_times()

    def read(self, sweep: str, check: Check | None = None) -> list[PointTrials]:
        """Return the points of a sweep, with the results of the measure that a check uses."""
        table, of = read_table(sweep), None if check is None else check.of
        measured = [json.loads(value) for value in table.columns[column(check)]] if check and of else None
        swept = self._points[sweep]
        places = np.searchsorted(table.points, np.arange(len(swept) + 1))
        return [
            PointTrials(
                number=point.number,
                key=point.key,
                axes=point.axes,
                scenario=point.scenario,
                times=table.times[first:end],
                observed=table.observed[first:end],
                seeds=[],  # no test takes them
                measured=tuple(measured[first:end]) if measured else (),
                of=of,
                has_t_sync=table.has_t_sync,
            )
            for point, (first, end) in zip(swept, pairwise(places), strict=True)
        ]

    def effort(self, sweep: str) -> tuple[float, int]:
        """Return the computing time of a sweep's trials; a table has none that failed."""
        return self._times[sweep], 0


class Table(NamedTuple):
    """A table of trials."""

    points: IntArray  # (trials,) numbers of points, rising
    times: FloatArray  # (trials,) cycles at which they ended; NaN if it is not known
    observed: BoolArray  # (trials,) whether they are not censored
    has_t_sync: bool
    columns: dict[str, tuple[str, ...]]  # as they are written


def table_file(sweep: str) -> Path:
    """Return the file of the table of a sweep."""
    return TABLES / f"{sweep}.csv.gz"


@cache
def read_table(sweep: str) -> Table:
    """Return the table of a sweep."""
    with gzip.open(table_file(sweep), "rt", encoding="utf-8", newline="") as file:
        csv.field_size_limit(2**31 - 1)  # series of a long trial are longer than the 131,072 characters of the default
        names, *rows = csv.reader(file)
    columns = dict(zip(names, zip(*rows, strict=True), strict=True))
    return Table(
        points=np.array(columns["point"], int),
        times=np.array([cycles or "nan" for cycles in columns["cycles"]], float),
        observed=np.array(columns["censored"]) == "0",
        has_t_sync=all(columns["censored"]),
        columns=columns,
    )


def read_times() -> dict[str, float]:
    """Return the computing time of each sweep, s."""
    rows = csv.DictReader(TIMES.read_text(encoding="utf-8").splitlines())
    return {row["sweep"]: float(row["computing_s"]) for row in rows}


def write_tables(claims: Claims, scenarios: dict[str, Scenario], trials: Trials) -> None:
    """Write a table for each sweep of some trials, and their computing times."""
    times = read_times()
    for sweep in trials.folders:
        checks = [check for claim in claims.claims if claim.sweep == sweep for check in claim.checks if check.of]
        measures = {
            column(check): [value for point in trials.read(sweep, check) for value in point.measured]
            for check in checks
        }
        write_table(sweep, trials.read(sweep), points(scenarios[sweep]), measures)
        times[sweep] = trials.effort(sweep)[0]
    with atomic_write(TIMES) as part:
        part.write_text(csv_text(["sweep", "computing_s"], ([name, round(times[name])] for name in scenarios)))


def write_table(
    sweep: str, stored: Sequence[PointTrials], swept: Sequence[Point], columns: Mapping[str, Iterable[Any]]
) -> None:
    """Write the table of a sweep, with a row for each trial: its end, and what further columns have of it, as JSON."""
    ends = []
    for trials, point in zip(stored, swept, strict=True):
        if trials.seeds and trials.seeds[-1] != point.seed(len(trials.seeds) - 1):
            raise SystemExit(f"trials of point {point.number} of {point.scenario.name} are missing or failed")
        for cycles, observed in zip(trials.times, trials.observed, strict=True):
            censored = int(not observed) if trials.has_t_sync else ""
            ends.append((point.number, "" if np.isnan(cycles) else int(cycles), censored))
    rows = ([*end, *map(json.dumps, values)] for end, *values in zip(ends, *columns.values(), strict=True))
    with atomic_write(table_file(sweep)) as part:
        part.write_bytes(gzip.compress(csv_text([*COLUMNS, *columns], rows).encode(), mtime=0))


def write_page(claims: Claims, scenarios: dict[str, Scenario], folder: Path) -> None:
    """Write the page, with its tables and figures, into a folder."""
    tables = Tables(scenarios)
    contents = read_contents(claims, claims.claims, scenarios, tables, WRITTEN_BY)
    write_replication(contents, tables, folder)


def main(*folders: str) -> None:
    """Write the tables of the run folders in a folder, if one is given; then the page, and say what is new in it."""
    claims = read_claims()
    scenarios = needed_sweeps(claims, claims.claims)
    for given in folders:
        found = {sweep: sweep_folder(Path(given), sweep) for sweep in scenarios}
        write_tables(claims, scenarios, Trials({name: path for name, path in found.items() if path.exists()}))
    before = {file: file.read_text(encoding="utf-8") for file in PAGE}
    write_page(claims, scenarios, DOCS)
    changed = [file.name for file in PAGE if file.read_text(encoding="utf-8") != before[file]]
    print(f"{len(scenarios)} tables; changed: {', '.join(changed) or 'nothing'}")
    sys.exit(bool(changed))


if __name__ == "__main__":
    main(*sys.argv[1:])
