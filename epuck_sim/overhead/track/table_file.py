"""Writes tables of columns as CSV or Parquet, by the ending of the file's name."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from epuck_sim.util.atomic_write import atomic_write

Columns = dict[str, npt.NDArray[Any]]
"""Columns of equal length, by their names."""

ENDINGS = (".csv", ".parquet")
"""Endings of the names of tables."""


def write_table(path: Path, columns: Columns, metadata: Mapping[str, str] | None = None) -> None:
    """Write a table; what is not known, NaN, is empty in CSV and null in Parquet, which alone has metadata.

    Raises:
        EpuckSimError: The file cannot be written.
    """
    with atomic_write(path) as part:
        if path.suffix == ".parquet":
            _write_parquet(part, columns, metadata or {})
        else:
            _write_csv(part, columns)


def _write_csv(part: Path, columns: Columns) -> None:
    with part.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(_texts(name, values) for name, values in columns.items()), strict=True))


def _texts(name: str, values: npt.NDArray[Any]) -> list[str]:
    if values.dtype.kind != "f":
        return [str(value) for value in values.tolist()]
    form = ".6f" if name.endswith("_s") and not name.endswith("cm_s") else ".6g"  # microseconds, however long a film is
    return ["" if np.isnan(value) else format(value, form) for value in values.tolist()]


def _write_parquet(part: Path, columns: Columns, metadata: Mapping[str, str]) -> None:
    import pyarrow as pa  # noqa: PLC0415 is for Parquet alone
    from pyarrow import parquet  # noqa: PLC0415

    arrays = {name: pa.array(values, from_pandas=True) for name, values in columns.items()}
    with part.open("wb") as file:  # pyarrow opens no file whose name is not UTF-8
        parquet.write_table(pa.table(arrays).replace_schema_metadata(dict(metadata)), file, compression="zstd")
