"""The SQLite file of a run folder: how to make it, and open it, without ever touching a foreign file."""

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from epuck_sim.errors import StoreError
from epuck_sim.runs.checksums import CHECKSUM, Signer, columns_of, find_damaged_row, quoted
from epuck_sim.runs.schema import APPLICATION_ID, ENTER_POINT, FORMAT, LATER_COLUMNS, LOST_POINT, POINTS, STORED, TRIALS
from epuck_sim.runs.share import WHOLE, Share
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.provenance import PROVENANCE

_checked: dict[Path, tuple[int, int, int]] = {}
"""Inode, time of change and size of each database that this process has found undamaged, or has written itself."""


@contextmanager
def new_database(path: Path, axes: Sequence[str], points: Sequence[tuple[Any, ...]]) -> Iterator[sqlite3.Connection]:
    """Yield a database with points and without trials, which appears under its name when the block ends well."""
    columns = "".join(f"{quoted(key)}, " for key in axes)
    provenance = ", ".join(f"{name} TEXT NOT NULL" for name in PROVENANCE)
    with sqlite_errors(path), atomic_write(path) as part, closing(_connect(part, "rwc")) as connection:
        connection.execute("PRAGMA journal_mode = OFF")  # nothing but the file itself, should this be killed
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {FORMAT}")
        connection.execute(POINTS)
        connection.execute(TRIALS.format(axes=columns, provenance=provenance))
        add_later_columns(connection)
        connection.executemany(ENTER_POINT, points)
        Signer(connection, "points").sign()
        connection.commit()
        yield connection
        Signer(connection, "trials").sign(f"{CHECKSUM} IS NULL")
        connection.commit()


def add_later_columns(connection: sqlite3.Connection) -> None:
    """Add the columns that an earlier folder does not have; checksums of its trials become those with them."""
    for table, columns in LATER_COLUMNS.items():
        there = columns_of(connection, table)
        missing = [name for name in columns if name not in there]
        for name in missing:
            connection.execute(f"ALTER TABLE {table} ADD COLUMN {name} {columns[name]}")
        if missing:
            Signer(connection, table).sign()
    connection.execute(f"PRAGMA user_version = {FORMAT}")


def read_share(connection: sqlite3.Connection) -> Share:
    """Return the share of its sweep that a folder is for."""
    if not has_column(connection, "points", "share"):
        return WHOLE
    (text,) = connection.execute("SELECT max(share) FROM points").fetchone()
    return WHOLE if text is None else Share.parse(text)


def has_column(connection: sqlite3.Connection, table: str, name: str) -> bool:
    """Return whether a table has a column, which may be one of `LATER_COLUMNS`."""
    return name in columns_of(connection, table)


def check_database(path: Path) -> None:
    """Check that a file is an undamaged database of ours; every state of a file is checked once a process.

    Raises:
        StoreError: The file is missing, damaged, of another program, or of another version's format.
    """
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
    found = int.from_bytes(header[60:64])
    if not 1 <= found <= FORMAT:
        raise StoreError(f"{path}: has format {found}, this version of epuck-sim reads 1 to {FORMAT}")
    page_size = int.from_bytes(header[16:18])
    verdict = _quick_check(path, has_checksums=found > 1)
    if verdict == "ok" and path.stat().st_size % (65536 if page_size == 1 else page_size):
        verdict = "its end is missing"  # SQLite would take what is missing of the last page for zeros
    if verdict != "ok":
        raise StoreError(f"{path}: is damaged: {verdict}")
    _checked[path.resolve()] = state


def _state(path: Path) -> tuple[int, int, int]:
    stat = path.stat()
    return stat.st_ino, stat.st_mtime_ns, stat.st_size


def _quick_check(path: Path, has_checksums: bool) -> str:
    """Return "ok", or what SQLite finds damaged; it reads the whole file."""
    expected = _noted_trials(path)  # before the moment of which is read: a run at work may add to both
    with sqlite_errors(path), closing(_connect_to_read(path)) as connection:
        connection.execute("BEGIN")
        (verdict,) = connection.execute("PRAGMA quick_check(1)").fetchone()
        if verdict == "ok":
            verdict = _check_rows(connection, has_checksums)
        (found,) = connection.execute("SELECT count(*) FROM trials").fetchone() if verdict == "ok" else (expected,)
    if found < expected:  # SQLite takes what is damaged in its log for the log's end
        return (
            f"its log has lost trials: {expected} were stored, {found} can be read; to go on with these, delete "
            f"{path.with_name(STORED)}"
        )
    return str(verdict)


def note_trials(path: Path, count: int) -> None:
    """Note beside a database how many trials it holds; a note that was cut off says fewer, or nothing."""
    with suppress(OSError):  # the disk is full, say; what is stored is stored
        path.with_name(STORED).write_text(str(count), encoding="ascii")


def _noted_trials(path: Path) -> int:
    try:
        return int(path.with_name(STORED).read_bytes())
    except (OSError, ValueError):
        return 0


def _check_rows(connection: sqlite3.Connection, has_checksums: bool) -> str:
    """Return "ok", or what is missing or wrong in a database that SQLite finds undamaged."""
    for table in LATER_COLUMNS:
        if not columns_of(connection, table):
            return f"it has no table {table}"
        if has_column(connection, table, CHECKSUM):
            if damage := find_damaged_row(connection, table):
                return damage
        elif has_checksums:
            return f"{table} has no checksums"
    if connection.execute("SELECT 1 FROM points LIMIT 1").fetchone() is None:
        return "it has no points"
    if connection.execute(LOST_POINT).fetchone() is not None:
        return "it has trials of a point that is gone"
    return "ok"


@contextmanager
def reading(path: Path) -> Iterator[sqlite3.Connection]:
    """Check a database and yield a connection to it that cannot write.

    All that is read in the block is of one moment, whatever a run that is at work on the database adds meanwhile.
    """
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
        yield connection
        with suppress(sqlite3.OperationalError):
            connection.execute("PRAGMA journal_mode = DELETE")
            path.with_name(STORED).unlink(missing_ok=True)
    with suppress(OSError):  # the folder may be gone by now
        _checked[path.resolve()] = _state(path)


def _connect_to_read(path: Path) -> sqlite3.Connection:
    """Return a connection that cannot write, after the write in which another process may have died was undone."""
    if path.with_name(f"{path.name}-journal").exists():
        with closing(_connect(path, "rw")) as connection:  # a connection that cannot write cannot undo a write either
            connection.execute("SELECT count(*) FROM sqlite_master")
    return _connect(path, "ro")


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    return sqlite3.connect(file_uri(path, mode), uri=True)


def file_uri(path: Path, mode: str) -> str:
    """Return the URI under which SQLite opens a database to read, `ro`, to write, `rw`, or to make it, `rwc`."""
    return f"{path.resolve().as_uri()}?mode={mode}"


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


def as_column(value: Any) -> Any:
    """Return an axis value for a column: numbers and text as they are, any other value as JSON."""
    if isinstance(value, int) and abs(value) >= 2**63:
        return float(value)
    return value if value is None or isinstance(value, bool | int | float | str) else json.dumps(value)
