"""Checksums of millions of rows, compared by compiled code that reads the pages of the file itself.

SQLite gives Python one row after the other, which takes ten times as long. What is not understood here, or is damaged,
SQLite is asked for: it has the last word.
"""

import marshal
import mmap
import sqlite3
from pathlib import Path

import numpy as np

from epuck_sim.arrays import ByteArray
from epuck_sim.runs.checksums import CHECKSUM, MARSHAL_VERSION, names_sum, summed_columns
from epuck_sim.runs.page_kernels import GIVEN_UP, Pages, Walk, check_pages, find_frames
from epuck_sim.runs.row_kernels import Columns, make_scratch

PAGES_AT_ONCE = 4096
"""Pages that compiled code looks at before Ctrl-C is heard, and memory is given back."""

LONGEST_RECORD = 1 << 22
"""Bytes of the longest row that is compared here."""

WRITE_AHEAD = 2
"""Byte 18 of a file whose write-ahead log counts."""

BIG_ENDIAN = 1
"""Bit of a log's first word by which its checksums are of big-endian numbers."""

UTF_8 = 1
"""Number of the encoding of text in a database, bytes 56 to 59."""


def has_all_checksums(connection: sqlite3.Connection, path: Path, table: str) -> bool:
    """Return whether all rows of a table certainly have their checksums.

    Args:
        connection: A connection that is reading: it keeps other processes from writing into the file, or from
            starting the log anew.
        path: The database.
        table: The table.
    """
    (rows,) = connection.execute(f"SELECT count(*) FROM {table}").fetchone()
    (root,) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = ?", (table,)).fetchone()
    with path.open("rb") as file:
        memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)  # is unmapped when no array needs it any more
    log = path.with_name(f"{path.name}-wal")
    journal = log.read_bytes() if memory[18] == WRITE_AHEAD and log.exists() else b""
    pages = _read_pages(np.frombuffer(memory, np.uint8), journal)
    # a run that is at work may have added rows since they were counted
    return pages is not None and _count_rows(pages, _read_columns(connection, table), root, memory) >= rows


def _read_pages(file: ByteArray, journal: bytes) -> Pages | None:
    """Return the pages of a database, or None if it cannot be understood."""
    header = bytes(file[:100])
    size = int.from_bytes(header[16:18])
    size = 65536 if size == 1 else size
    if int.from_bytes(header[56:60]) != UTF_8:
        return None
    in_journal = np.zeros((len(file) + len(journal)) // size + 2, np.int64)
    pages = Pages(file, np.frombuffer(bytearray(journal), np.uint8), in_journal, size, size - header[20])
    if len(journal) > 32 and not find_frames(pages, bool(journal[3] & BIG_ENDIAN)):
        return None
    return pages


def _read_columns(connection: sqlite3.Connection, table: str) -> Columns:
    found = connection.execute(f"PRAGMA table_info({table})").fetchall()
    keys = [row[1] for row in sorted(found, key=lambda row: row[5]) if row[5]]
    names = keys + [row[1] for row in found if not row[5]]
    kinds = {row[1]: row[2] for row in found}
    summed = summed_columns(connection, table)
    # a tuple of the sum of the names and the values, as `marshal` begins it
    head = b"(" + (len(summed) + 1).to_bytes(4, "little") + marshal.dumps(names_sum(summed), MARSHAL_VERSION)
    return Columns(
        np.array([names.index(name) for name in summed]),
        np.array([kinds[name] == "REAL" for name in names]),
        names.index(CHECKSUM),
        np.frombuffer(bytearray(head), np.uint8),
    )


def _count_rows(pages: Pages, columns: Columns, root: int, memory: mmap.mmap) -> int:
    """Return how many rows are below a page; `GIVEN_UP` if one does not have its checksum."""
    count = len(pages.in_journal)
    walk = Walk(np.zeros(count, np.int64), np.ones(1, np.int64), np.array([count]), np.zeros(LONGEST_RECORD, np.uint8))
    walk.waiting[0] = root
    scratch = make_scratch(len(columns.is_real), LONGEST_RECORD)
    rows = 0
    while walk.height[0]:
        found = check_pages(pages, walk, columns, scratch, PAGES_AT_ONCE)
        if found == GIVEN_UP:
            return GIVEN_UP
        rows += found
        if hasattr(memory, "madvise"):
            memory.madvise(mmap.MADV_DONTNEED)
    return rows
