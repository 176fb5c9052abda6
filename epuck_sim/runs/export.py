"""The results of a sweep as one table, for pandas, R or a spreadsheet."""

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import csv, parquet

from epuck_sim.errors import EpuckSimError
from epuck_sim.measures.measure import Value
from epuck_sim.runs.database import BLOCK, RESULT, as_column, measures_in, reading
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.provenance import PROVENANCE

WRITERS = {".parquet": parquet.write_table, ".csv": csv.write_csv}
"""Functions that write a table, by the suffix of the file."""

COLUMNS = {
    "seed": pa.int64(),
    **{name: pa.from_numpy_dtype(kind) for name, kind in RESULT.items()},
    "censored": pa.bool_(),
    "point": pa.int64(),
    "trial": pa.int64(),
    **dict.fromkeys(PROVENANCE, pa.string()),
}
"""Columns after those of the axes, and their types; `point` is the point's number in the sweep."""

_AS_STORED = pa.schema({**COLUMNS, "censored": pa.int8(), "measured": pa.string(), "events": pa.string()})


def export(folder: Path, target: Path) -> None:
    """Write a row for each trial that has a result, ordered by point and trial.

    The columns are those of `read_table`; a series is its JSON in CSV.
    """
    if target.suffix not in WRITERS:
        raise EpuckSimError(f"{target}: unknown format {target.suffix!r}; allowed: .parquet or .csv")
    table = read_table(folder, is_text=target.suffix == ".csv")
    with atomic_write(target) as part, part.open("wb") as file:  # pyarrow opens no file whose name is not UTF-8
        WRITERS[target.suffix](table, file)


def read_table(folder: Path, *, is_text: bool = False) -> Any:
    """Return a table of pyarrow with a row for each trial that has a result, ordered by point and trial.

    The columns are the axes, by their dotted keys, `COLUMNS`, and `measures.NAME` for each measure. A series is a list,
    or its JSON if `is_text`. Where trials have events, `events` holds them as JSON.
    """
    with reading(folder) as connection:
        numbered = connection.execute("SELECT number, axes FROM points ORDER BY number")
        points = {number: json.loads(axes) for number, axes in numbered}
        wanted = ", ".join("number" if name == "point" else name for name in COLUMNS)
        names = measures_in(connection)
        rows = connection.execute(
            f"SELECT {wanted}, measured, events FROM trials JOIN points ON point = key "
            "WHERE error IS NULL ORDER BY number, trial"
        )
        blocks = []
        while found := rows.fetchmany(BLOCK):
            blocks.append(pa.table(dict(zip(_AS_STORED.names, zip(*found, strict=True), strict=True)), _AS_STORED))
    read = pa.concat_tables(blocks or [_AS_STORED.empty_table()])  # beside others, CSV would have its head twice
    numbers = read["point"].to_pylist()
    axes = {key: _axis([as_column(points[number][key]) for number in numbers]) for key in points[0]}
    arrays = {**axes, **{name: read[name].cast(kind) for name, kind in COLUMNS.items()}}
    trials = [json.loads(text or "{}") for text in read["measured"].to_pylist()] if names else []
    arrays |= {f"measures.{name}": _measure([trial.get(name) for trial in trials], is_text) for name in names}
    if read["events"].null_count < len(read):
        arrays["events"] = read["events"]
    return pa.table(arrays)


def _axis(values: list[Any]) -> Any:
    """Return a column of axis values; if some are numbers and some text, all become text."""
    kinds = {str if isinstance(value, str) else type(value) for value in values if value is not None}
    if len(kinds) > 1 and kinds != {int, float}:
        values = [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
    return pa.array(values)


def _measure(values: list[Value], is_text: bool) -> Any:
    """Return a column of a measure's values.

    If trials differ in kind, all numbers become floats; numbers beside series become series of one.
    """
    if any(isinstance(value, list) for value in values):
        values = [value if value is None or isinstance(value, list) else [value] for value in values]
        if is_text:
            return pa.array([None if value is None else json.dumps(value) for value in values], pa.string())
    try:
        found = pa.array(values)
    except (pa.ArrowInvalid, pa.ArrowTypeError):  # truth values beside numbers, or numbers that no float is equal to
        found = pa.array([_as_floats(value) for value in values])
    floats = {pa.null(): pa.float64(), pa.list_(pa.null()): pa.list_(pa.float64())}
    return found.cast(floats.get(found.type, found.type))


def _as_floats(value: Any) -> Any:
    if isinstance(value, list):
        return [_as_floats(each) for each in value]
    return None if value is None else float(value)
