"""The results of a sweep as one table, for pandas, R or a spreadsheet."""

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import csv, parquet

from epuck_sim.runs.database import as_column, reading
from epuck_sim.errors import EpuckSimError
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.provenance import PROVENANCE
from epuck_sim.runs.reader import database_of

WRITERS = {".parquet": parquet.write_table, ".csv": csv.write_csv}

COLUMNS = {
    "seed": pa.int64(),
    "t_sync_cycles": pa.int64(),
    "censored": pa.bool_(),
    "order_parameter": pa.float64(),
    "simulated_s": pa.float64(),
    "wall_s": pa.float64(),
    "steps": pa.int64(),
    "cycles": pa.int64(),
    "point": pa.int64(),
    "trial": pa.int64(),
    **dict.fromkeys(PROVENANCE, pa.string()),
}
"""What follows the axes; `point` is the point's number in the sweep."""


def export(folder: Path, target: Path) -> int:
    """Write a row for each trial that has a result, ordered by point and trial; return how many have failed.

    target: FILE.parquet or FILE.csv. Columns: each axis by its dotted key, then `COLUMNS`.
    Raises StoreError for what is no run folder, EpuckSimError where the file cannot be written.
    """
    if target.suffix not in WRITERS:
        raise EpuckSimError(f"{target}: unknown format {target.suffix!r}; allowed: .parquet or .csv")
    with reading(database_of(folder)) as connection:
        points = {
            number: json.loads(axes)
            for number, axes in connection.execute("SELECT number, axes FROM points ORDER BY number")
        }
        wanted = ", ".join("number" if name == "point" else name for name in COLUMNS)
        rows = connection.execute(
            f"SELECT {wanted} FROM trials JOIN points ON point = key WHERE error IS NULL ORDER BY number, trial"
        ).fetchall()
        (failed,) = connection.execute("SELECT count(*) FROM trials WHERE error IS NOT NULL").fetchone()
    columns = dict(zip(COLUMNS, zip(*rows, strict=True) if rows else [()] * len(COLUMNS), strict=True))
    columns["censored"] = [bool(value) for value in columns["censored"]]
    axes = {key: _axis([as_column(points[number][key]) for number in columns["point"]]) for key in points[0]}
    arrays = {**axes, **{name: pa.array(columns[name], kind) for name, kind in COLUMNS.items()}}
    with atomic_write(target) as part:
        WRITERS[target.suffix](pa.table(arrays), part)
    return int(failed)


def _axis(values: list[Any]) -> Any:
    """Return a column of axis values; where some are numbers and some text, all as text."""
    kinds = {str if isinstance(value, str) else type(value) for value in values if value is not None}
    if len(kinds) > 1 and kinds != {int, float}:
        values = [None if value is None else str(value) for value in values]
    return pa.array(values)
