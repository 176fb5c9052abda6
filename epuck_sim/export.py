"""The results of a sweep as one table, for pandas, R or a spreadsheet."""

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import csv, parquet

from epuck_sim.database import quoted, reading
from epuck_sim.errors import EpuckSimError
from epuck_sim.files import written_whole
from epuck_sim.provenance import PROVENANCE
from epuck_sim.results import database_of

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
        (first,) = connection.execute("SELECT axes FROM points ORDER BY number LIMIT 1").fetchone()
        axes = list(json.loads(first))
        wanted = ["number" if name == "point" else quoted(name) for name in [*axes, *COLUMNS]]
        rows = connection.execute(
            f"SELECT {', '.join(wanted)} FROM trials JOIN points ON point = key WHERE error IS NULL "
            "ORDER BY number, trial"
        ).fetchall()
        (failed,) = connection.execute("SELECT count(*) FROM trials WHERE error IS NOT NULL").fetchone()
    columns = list(zip(*rows, strict=True)) or [()] * len(wanted)
    arrays = [_axis(column) for column in columns[: len(axes)]]
    arrays += [
        pa.array([bool(value) for value in column] if kind == pa.bool_() else column, kind)
        for kind, column in zip(COLUMNS.values(), columns[len(axes) :], strict=True)
    ]
    with written_whole(target) as part:
        WRITERS[target.suffix](pa.table(arrays, [*axes, *COLUMNS]), part)
    return int(failed)


def _axis(values: tuple[Any, ...]) -> Any:
    """Return a column of axis values; where some are numbers and some text, all as text."""
    if len({isinstance(value, str) for value in values if value is not None}) > 1:
        values = tuple(None if value is None else str(value) for value in values)
    return pa.array(values)
