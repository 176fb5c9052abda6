"""A checksum in each row of a database, so that a damaged file never gives wrong rows: SQLite checks no contents."""

import marshal
import sqlite3
import zlib
from collections.abc import Sequence
from typing import Any

CHECKSUM = "checksum"
"""Column that holds the checksum of a row's other columns, and of their names."""

KEYS = {"points": ("key",), "trials": ("point", "trial")}
"""Primary key of each table."""

MARSHAL_VERSION = 2
"""Format in which values are summed: the first with floats in binary, without references, and never changed again."""


def columns_of(connection: sqlite3.Connection, table: str) -> list[str]:
    """Return the names of a table's columns."""
    return [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]


def quoted(name: str) -> str:
    """Return a column's name in quotes, for SQL."""
    return '"' + name.replace('"', '""') + '"'


class Signer:
    """Stores the checksums of rows of a table, of the columns that it has when this is made.

    SQLite calls no function of ours for it: Ctrl-C in one would be lost.
    """

    def __init__(self, connection: sqlite3.Connection, table: str) -> None:
        keys = KEYS[table]
        self._connection, self._keys = connection, len(keys)
        self._select = f"SELECT {', '.join(keys)}, {_terms(connection, table)} FROM {table} WHERE "
        self._update = f"UPDATE {table} SET {CHECKSUM} = ? WHERE {' AND '.join(f'{key} = ?' for key in keys)}"

    def sign(self, which: str = "true", values: Sequence[Any] = ()) -> None:
        """Store the checksums of those rows for which a condition, with its values, holds."""
        found = self._connection.execute(self._select + which, values)
        # one row after the other: a folder may have millions, and the keys by which they are found stay as they are
        sums = ((_row_sum(row[self._keys :]), *row[: self._keys]) for row in found)
        self._connection.executemany(self._update, sums)


def find_damaged_row(connection: sqlite3.Connection, table: str) -> str | None:
    """Return what is wrong with the first row of a table that does not have its checksum; None if all have."""
    found = connection.execute(f"SELECT {_terms(connection, table)}, {CHECKSUM} FROM {table}")
    try:
        for number, row in enumerate(found):
            if _row_sum(row[:-1]) != row[-1]:
                return f"row {number} of {table} does not have its checksum"
    except sqlite3.OperationalError as error:
        if "decode" not in str(error):
            raise
        return f"{table} holds text that is not UTF-8"
    return None


def _terms(connection: sqlite3.Connection, table: str) -> str:
    """Return what is summed, as SQL."""
    names = summed_columns(connection, table)
    return ", ".join([str(names_sum(names)), *map(quoted, names)])


def summed_columns(connection: sqlite3.Connection, table: str) -> list[str]:
    """Return the columns that are summed, by name, for earlier folders have them in another order."""
    return sorted(set(columns_of(connection, table)) - {CHECKSUM})


def names_sum(names: Sequence[str]) -> int:
    """Return the number that stands for the names of the columns in each row's checksum."""
    return zlib.crc32("\n".join(names).encode())


def _row_sum(row: tuple[Any, ...]) -> int:
    return zlib.crc32(marshal.dumps(row, MARSHAL_VERSION))
