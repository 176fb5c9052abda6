"""The results of a sweep as one table, for pandas, R or a spreadsheet."""

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import csv, parquet

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.database import as_column, reading
from epuck_sim.runs.reader import database_of
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.provenance import PROVENANCE

WRITERS = {".parquet": parquet.write_table, ".csv": csv.write_csv}
"""Functions that write a table, by the suffix of the file."""

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
"""Columns after those of the axes, and their types; `point` is the point's number in the sweep."""


def export(folder: Path, target: Path) -> int:
    """Write a row for each trial that has a result, ordered by point and trial.

    The columns are the axes, by their dotted keys, and `COLUMNS`.

    Args:
        folder: A run folder.
        target: FILE.parquet or FILE.csv.

    Returns:
        The number of trials that have failed, which are left out.

    Raises:
        StoreError: The folder is not a run folder, or its database is damaged.
        EpuckSimError: The file cannot be written, or its suffix is unknown.
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
    """Return a column of axis values; if some are numbers and some text, all become text."""
    kinds = {str if isinstance(value, str) else type(value) for value in values if value is not None}
    if len(kinds) > 1 and kinds != {int, float}:
        values = [None if value is None else str(value) for value in values]
    return pa.array(values)
