"""The trials that claims are tested on, as tables: `python -m docs.trials` tests the claims on them, in a fresh clone.

It makes docs/replication-tests.csv again from the tables in docs/trials, and ends with 1 if that differs. `python -m
docs.trials FOLDER` writes the tables, from the run folders of `epuck-sim replicate --quick --out FOLDER`.

The rows of a point are its trials 0, 1, ... in order. Seeds, which would take four fifths of the room, are not in them:
`epuck_sim.points(scenario)[point].seed(trial)` gives each.
"""

import csv
import gzip
import io
import json
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim.measures.interface import Value
from epuck_sim.replication.claims import SHIPPED, Check, Claims, read_claims
from epuck_sim.replication.looks import counted_looks
from epuck_sim.replication.page import Contents, check_table
from epuck_sim.replication.sweeps import Version, is_asked, needed_sweeps, sweep_folder
from epuck_sim.replication.verdicts import Finding, judge_claims, reduced, run_check
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.scenario.points import Point, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.atomic_write import atomic_write

DOCS = Path(__file__).parent
TABLES, TESTS = DOCS / "trials", DOCS / "replication-tests.csv"

COLUMNS = ("point", "cycles", "censored")
"""Columns before those of measures: number of the point, cycle at which the trial ended, 1 if it is censored."""


def reduction(check: Check) -> str | None:
    """Return the name of what stands for the series that a test takes."""
    return "mean" if check.test == "collapse" else check.take


def column(check: Check) -> str:
    """Return the name of the column of a test's measure, or of what stands for its series."""
    return " ".join(filter(None, (check.of, reduction(check))))


def write_tables(claims: Claims, folder: Path) -> None:
    """Write a table for each sweep of the quick version, with a row for each trial."""
    TABLES.mkdir(exist_ok=True)
    for sweep, scenario in needed_sweeps(claims, claims.claims, Version.QUICK).items():
        stored = sweep_folder(folder, sweep, Version.QUICK)
        checks = [check for claim in claims.claims if claim.sweep == sweep for check in claim.checks if check.of]
        measures = {column(check): _measured(stored, check) for check in checks}
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([*COLUMNS, *measures])
        for ends, *values in zip(_ends(read_points(stored), points(scenario)), *measures.values(), strict=True):
            writer.writerow([*ends, *map(json.dumps, values)])
        with atomic_write(TABLES / f"{sweep}.csv.gz") as part:
            part.write_bytes(gzip.compress(text.getvalue().encode(), mtime=0))


def _ends(stored: Sequence[PointTrials], swept: Sequence[Point]) -> Iterator[tuple[int | str, ...]]:
    for trials, point in zip(stored, swept, strict=True):
        if trials.seeds and trials.seeds[-1] != point.seed(len(trials.seeds) - 1):
            raise SystemExit(f"trials of point {point.number} of {point.scenario.name} are missing or failed")
        for cycles, observed in zip(trials.times, trials.observed, strict=True):
            censored = int(not observed) if trials.has_t_sync else ""
            yield point.number, "" if np.isnan(cycles) else int(cycles), censored


def _measured(folder: Path, check: Check) -> list[Value]:
    name = reduction(check)
    stored = (point if name is None else reduced(point, name) for point in read_points(folder, check.of))
    return [value for point in stored for value in point.measured]


@cache
def read_table(sweep: str) -> dict[int, list[dict[str, str]]]:
    """Return the rows of a table by the number of their point."""
    with gzip.open(TABLES / f"{sweep}.csv.gz", "rt", encoding="utf-8", newline="") as file:
        by_point = groupby(csv.DictReader(file), lambda row: int(row["point"]))
        return {number: list(rows) for number, rows in by_point}


def read_trials(sweep: str, scenario: Scenario, check: Check) -> list[PointTrials]:
    """Return the points of a sweep with the trials of its table, and what a test takes of them."""
    table = read_table(sweep)
    return [
        PointTrials(
            number=point.number,
            key=point.key,
            axes=point.axes,
            scenario=point.scenario,
            times=np.array([float(row["cycles"] or "nan") for row in table[point.number]]),
            observed=np.array([row["censored"] == "0" for row in table[point.number]]),
            seeds=[],  # no test takes them
            measured=tuple(_value(row, check) for row in table[point.number] if check.of),
            of=check.of,
            has_t_sync=all(row["censored"] for row in table[point.number]),
        )
        for point in points(scenario)
    ]


def _value(row: dict[str, str], check: Check) -> Any:
    value = json.loads(row[column(check)])
    return [value] if check.test == "collapse" else value


def find(check: Check, sweep: str | None, scenarios: dict[str, Scenario]) -> Finding:
    """Return what a test finds in the table of its sweep, in which one value stands for a series."""
    if sweep is None or check.test == "formula":
        return run_check(check, [])
    of_values = check.model_copy(update={"take": None})
    return run_check(of_values, read_trials(sweep, scenarios[sweep], check))._replace(check=check)


def table_of_tests(claims: Claims) -> str:
    """Return the table of all tests of the quick version, as `replicate` writes it, from the tables of trials."""
    scenarios = needed_sweeps(claims, claims.claims, Version.QUICK)
    asked = {claim.id for claim in claims.claims if is_asked(claims, claim, Version.QUICK)}
    found = [
        (claim, [find(check, claim.sweep, scenarios) for check in claim.checks if claim.id in asked])
        for claim in claims.claims
    ]
    looks = counted_looks(
        (scenario, max(map(len, read_table(sweep).values()))) for sweep, scenario in scenarios.items()
    )
    return check_table(Contents(Version.QUICK, DOCS, (), judge_claims(found, looks), {}, claims, looks)).to_csv()


def main(*folders: str) -> None:
    """Write the tables from a folder, or test the claims on them."""
    claims = read_claims(SHIPPED)
    if folders:
        write_tables(claims, Path(folders[0]))
        return
    before, now = TESTS.read_text(encoding="utf-8").splitlines(), table_of_tests(claims).splitlines()
    different = [pair for pair in zip(before, now, strict=False) if pair[0] != pair[1]]
    for written, found in different:
        print(f"- {written}\n+ {found}")
    print(f"{len(now) - 1} tests, {len(different)} differ")
    sys.exit(bool(different) or len(before) != len(now))


if __name__ == "__main__":
    main(*sys.argv[1:])
