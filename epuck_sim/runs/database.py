"""The SQLite file of a run folder: its tables, a checksum in each row, and how it is made, checked and opened.

SQLite checks only the structure of its file, so each row has a CRC-32 of its other columns and of their names.
"""

import json
import marshal
import sqlite3
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.errors import StoreError
from epuck_sim.runs.folder import STORED, current_holder, database_of, has_locks, is_at, own_name
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.provenance import PROVENANCE

APPLICATION_ID = int.from_bytes(b"epck")  # marks a SQLite file as ours (its header, bytes 68 to 71)
FORMAT = 2  # version of the tables (bytes 60 to 63)

RESULT = {
    "t_sync_cycles": int,
    "censored": int,
    "order_parameter": float,
    "simulated_s": float,
    "wall_s": float,
    "steps": int,
    "cycles": int,
}
"""Columns that hold fields of a TrialResult, and the kind of their values."""

REPEATED = ("t_sync_cycles", "order_parameter", "simulated_s", "steps", "cycles")
"""Columns of `RESULT`, besides `censored`, that are the same whenever a trial is repeated."""

KEYS = {"points": ("key",), "trials": ("point", "trial")}  # primary key of each table

TABLES = """
CREATE TABLE points (
    key TEXT PRIMARY KEY, -- the axis values as text
    number INTEGER NOT NULL, -- its place in the sweep
    trials INTEGER NOT NULL, -- how many there are to be
    axes TEXT NOT NULL, -- JSON: value by dotted key
    scenario TEXT NOT NULL, -- JSON: everything that its trials depend on
    controllers TEXT NOT NULL, -- JSON: each group's controller, and the digest of a user's file
    measures TEXT NOT NULL DEFAULT '{{}}', -- JSON: see `compatibility.StoredPoint.measures`
    share TEXT, -- the share of the sweep that the folder is for, the same in all rows; NULL for the whole
    checksum INTEGER
) WITHOUT ROWID;
CREATE TABLE trials (
    point TEXT NOT NULL REFERENCES points (key), trial INTEGER NOT NULL, {axes}
    seed INTEGER NOT NULL, t_sync_cycles INTEGER, censored INTEGER, order_parameter REAL, simulated_s REAL, wall_s REAL,
    steps INTEGER, cycles INTEGER, {provenance},
    error TEXT, -- of a trial that failed; it has no result then
    measured TEXT, -- JSON: value of each measure by its name; NULL without measures
    events TEXT, -- JSON: what changed in the trial, see `scenario.changes.TrialEvent`; NULL if nothing did
    measuring_error TEXT, -- why a stored trial could not be measured again for new measures; NULL if it could
    checksum INTEGER,
    PRIMARY KEY (point, trial)
) WITHOUT ROWID;
"""

ENTER_POINT = (
    "INSERT INTO points (key, number, trials, axes, scenario, controllers, measures, share) "
    "VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (key) DO UPDATE SET number = excluded.number, "
    "trials = excluded.trials, scenario = excluded.scenario, measures = excluded.measures, share = excluded.share"
)

UNMEASURED = """
    EXISTS (SELECT 1 FROM json_each((SELECT measures FROM points WHERE key = point)) AS one
            WHERE NOT EXISTS (SELECT 1 FROM json_each(measured) AS value WHERE value.key = one.key))
"""
"""Condition on a trial: it lacks the value of a measure of its point."""

BLOCK = 10_000  # trials that are read at once: as text or objects of Python they take some ten times the memory
NULL = -1  # number that stands for NULL in a column of numbers that are never negative

MARSHAL_VERSION = 2
"""Marshal format for checksums: the first with floats in binary, without references, and never changed again."""

_checked: dict[Path, tuple[int, int, int]] = {}
"""Inode, time of change and size of each database that this process has found undamaged, or has written itself."""


@contextmanager
def new_database(path: Path, axes: Sequence[str], points: Sequence[tuple[Any, ...]]) -> Iterator[sqlite3.Connection]:
    """Yield a database with points and no trials, which appears under its name if the block ends without an error."""
    columns = "".join(f"{quoted(key)}, " for key in axes)
    provenance = ", ".join(f"{name} TEXT NOT NULL" for name in PROVENANCE)
    with sqlite_errors(path), atomic_write(path) as part, closing(_connect(part, "rwc")) as connection:
        connection.execute("PRAGMA journal_mode = OFF")  # if this is killed, only the file itself is left
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {FORMAT}")
        connection.executescript(TABLES.format(axes=columns, provenance=provenance))
        connection.executemany(ENTER_POINT, points)
        sign(connection, "points")
        connection.commit()
        yield connection
        connection.commit()


@contextmanager
def reading(folder: Path | str) -> Iterator[sqlite3.Connection]:
    """Check the database of a run folder, and yield a read-only connection to it.

    The block reads one snapshot, whatever a run that is at work on the database adds meanwhile.
    """
    path = database_of(folder)
    check_database(path)
    with sqlite_errors(path), closing(_connect_to_read(path)) as connection:
        connection.execute("BEGIN")
        yield connection


@contextmanager
def writing(path: Path) -> Iterator[sqlite3.Connection]:
    """Yield a connection to a database that was checked or made by this process.

    Each commit waits for the disk. Afterwards only the one file is left, unless somebody is reading it.
    """
    with closing(_connect(path, "rw")) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        opened = path.stat()
        yield connection
        if not is_at(path, opened):  # the file with this name, and its log, are now another's
            return
        with suppress(sqlite3.OperationalError):
            connection.execute("PRAGMA journal_mode = DELETE")
            path.with_name(STORED).unlink(missing_ok=True)
    with suppress(OSError):  # the folder may be gone by now
        _checked[path.resolve()] = _state(path)


def note_trials(path: Path, count: int) -> None:
    """Write the number of trials in a database to a file beside it; if cut off, it is lower, or missing."""
    with suppress(OSError):  # such as a full disk; stored trials are not affected
        path.with_name(STORED).write_text(str(count), encoding="ascii")


def check_database(path: Path) -> None:
    """Check that a file is an undamaged database of ours; a process checks each state of a file once."""
    try:
        state = _state(path)
        if _checked.get(path.resolve()) == state:
            return
        with path.open("rb") as file:
            header = file.read(100)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    if not header.startswith(b"SQLite format 3\0") or int.from_bytes(header[68:72]) != APPLICATION_ID:
        raise StoreError(f"{path}: is not a database of epuck-sim; give another folder")
    if (found := int.from_bytes(header[60:64])) != FORMAT:
        older = "; to convert it, go on with the run in version 0.1.0" if found == 1 else ""
        raise StoreError(f"{path}: has format {found}, this version of epuck-sim reads {FORMAT}{older}")
    damage = _damage(path)
    if damage is None and path.stat().st_size % int.from_bytes(header[16:18]):
        damage = "its end is missing"  # SQLite would read the missing part of the last page as zeros
    if damage is not None:
        raise StoreError(f"{path}: is damaged: {damage}")
    _checked[path.resolve()] = state


def _state(path: Path) -> tuple[int, int, int]:
    stat = path.stat()
    return stat.st_ino, stat.st_mtime_ns, stat.st_size


def _damage(path: Path) -> str | None:
    """Read all of a database, and return its damage; None if there is none."""
    expected = 0
    with suppress(OSError, ValueError):  # before the snapshot begins: a run at work may add to both
        expected = int(path.with_name(STORED).read_bytes())
    with sqlite_errors(path), closing(_connect_to_read(path)) as connection:
        connection.execute("BEGIN")
        (verdict,) = connection.execute("PRAGMA quick_check(1)").fetchone()
        if verdict != "ok":
            return str(verdict)
        for table in KEYS:
            if damage := _damage_of_rows(connection, table):
                return damage
        if connection.execute("SELECT 1 FROM points LIMIT 1").fetchone() is None:
            return "it has no points"
        if connection.execute("SELECT point FROM trials EXCEPT SELECT key FROM points").fetchone() is not None:
            return "it has trials of a point that is gone"
        (found,) = connection.execute("SELECT count(*) FROM trials").fetchone()
    if found < expected:  # SQLite takes damage in its log for the log's end
        said = f"its log has lost trials: {expected} were stored, {found} can be read"
        return f"{said}; to go on with these, delete {path.with_name(STORED)}"
    return None


def _damage_of_rows(connection: sqlite3.Connection, table: str) -> str | None:
    columns = columns_of(connection, table)
    if "checksum" not in columns:
        return f"{table} has no checksums" if columns else f"it has no table {table}"
    order = ", ".join(KEYS[table])
    rows = connection.execute(f"SELECT {_summed(connection, table)}, checksum FROM {table} ORDER BY {order}")
    try:
        for row in rows:
            if _sum(row[:-1]) != row[-1]:
                found = dict(zip(_named(connection, table)[0], row[1:-1], strict=True))
                key = ", ".join(f"{name} {found[name]}" for name in KEYS[table])
                return f"{table} has a row with a wrong checksum, {key}"
    except sqlite3.OperationalError as error:
        if "decode" not in str(error):
            raise
        return f"{table} holds text that is not UTF-8"
    return None


def sign(connection: sqlite3.Connection, table: str, rows: Iterable[Sequence[Any]] | None = None) -> None:
    """Store the checksums of the rows that have these keys, or of all rows.

    Rows are read again, as SQLite may store other values than it was given. Sums are not computed in a function that
    SQLite calls: Ctrl-C would be lost in it.
    """
    keys = KEYS[table]
    if rows is None:
        rows = connection.execute(f"SELECT {', '.join(keys)} FROM {table}").fetchall()
    which = f"WHERE {' AND '.join(f'{key} = ?' for key in keys)}"
    select = f"SELECT {_summed(connection, table)} FROM {table} {which}"
    sums = ((_sum(connection.execute(select, row).fetchone()), *row) for row in rows)
    connection.executemany(f"UPDATE {table} SET checksum = ? {which}", sums)


def summing(
    connection: sqlite3.Connection, table: str, columns: Sequence[str]
) -> Callable[[tuple[Any, ...]], tuple[Any, ...]]:
    """Return a function that appends its checksum to a row of these columns; the row's other columns are NULL.

    The values must be as SQLite stores them.
    """
    names, of_names = _named(connection, table)
    place = {name: number for number, name in enumerate(columns)}
    in_order = itemgetter(*(place.get(name, len(columns)) for name in names))
    return lambda row: (*row, _sum((of_names, *in_order((*row, None)))))


def _summed(connection: sqlite3.Connection, table: str) -> str:
    """Return SQL for the values that a checksum covers: a number for the columns' names, and the columns by name."""
    names, of_names = _named(connection, table)
    return ", ".join([str(of_names), *map(quoted, names)])


def _named(connection: sqlite3.Connection, table: str) -> tuple[list[str], int]:
    names = sorted(set(columns_of(connection, table)) - {"checksum"})
    return names, zlib.crc32("\n".join(names).encode())


def _sum(row: tuple[Any, ...]) -> int:
    return zlib.crc32(marshal.dumps(row, MARSHAL_VERSION))


def measures_in(connection: sqlite3.Connection) -> list[str]:
    """Return the names of the measures of a folder's points, in their order."""
    rows = connection.execute("SELECT measures FROM points ORDER BY number")
    return list(dict.fromkeys(name for (text,) in rows for name in json.loads(text)))


def columns_of(connection: sqlite3.Connection, table: str) -> list[str]:
    """Return the names of a table's columns."""
    return [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]


def quoted(name: str) -> str:
    """Return a column's name in quotes, for SQL."""
    return '"' + name.replace('"', '""') + '"'


def as_column(value: Any) -> Any:
    """Return an axis value for a column: numbers and text as they are, any other value as JSON."""
    if isinstance(value, int) and abs(value) >= 2**63:
        return float(value)
    return value if value is None or isinstance(value, bool | int | float | str) else json.dumps(value)


def as_stored(value: Any, kind: type | None = None) -> Any:
    """Return a value as SQLite returns it from a column of a kind of numbers or text, by default the value's own.

    >>> as_stored(True), as_stored(1, float), as_stored(-0.0), as_stored(float("nan")), as_stored("a")
    (1, 1.0, 0.0, None, 'a')
    """
    if value is None or value != value:  # noqa: PLR0124 as NaN
        return None
    kind = kind or next((number for number in (int, float) if isinstance(value, number)), str)
    return float(value) + 0.0 if kind is float else kind(value)


def read_numbers(text: str | None) -> IntArray:
    """Return the whole numbers in a text from `group_concat`, which is faster than a Python object for each."""
    return np.fromstring(text or "", np.int64, sep=",")


def _connect_to_read(path: Path) -> sqlite3.Connection:
    """Return a read-only connection, after a write in which another process may have died was undone."""
    if not has_locks(path.parent) and (holder := current_holder(path.parent)) not in (None, own_name()):
        said = f"{holder} is at work on it, and its file system has no locks; read it when that work ends"
        raise StoreError(f"{path.parent}: {said}")
    if path.with_name(f"{path.name}-journal").exists():
        with closing(_connect(path, "rw")) as connection:  # a read-only connection cannot undo a write
            connection.execute("SELECT count(*) FROM sqlite_master")
    return _connect(path, "ro")


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    return sqlite3.connect(file_uri(path, mode), uri=True)


def file_uri(path: Path, mode: str) -> str:
    """Return the URI under which SQLite opens a database to read, `ro`, to write, `rw`, or to make it, `rwc`."""
    return f"{path.resolve().as_uri()}?mode={mode}{'' if has_locks(path.parent) else '&nolock=1'}"


@contextmanager
def sqlite_errors(path: Path) -> Iterator[None]:
    """Turn SQLite's errors into StoreErrors that name the file."""
    try:
        yield
    except sqlite3.OperationalError as error:  # a full disk, no permission, locked by another program
        raise StoreError(f"{path}: {error}; stored results are intact; fix this and run the command again") from error
    except sqlite3.DatabaseError as error:
        raise StoreError(f"{path}: is damaged: {error}") from error
    except UnicodeDecodeError as error:  # SQLite's message names what is damaged
        raise StoreError(f"{path}: is damaged: its tables have no readable names") from error
