"""Compiled code reads pages of a database as SQLite does: it finds whole what is whole, and never what is not."""

import math
import sqlite3
from contextlib import closing
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.errors import StoreError
from epuck_sim.runs import database
from epuck_sim.runs.checksums import Signer, find_damaged_row
from epuck_sim.runs.large_check import has_all_checksums
from epuck_sim.runs.schema import DATABASE
from tests.runs.test_checksums import check_flips, flipped, unchecked, whole  # noqa: F401 - the last two are fixtures
from tests.runs.test_store import fill, scenario_of

VALUES = st.one_of(
    st.none(),
    st.integers(-(2**63), 2**63 - 1),
    st.sampled_from([0, 1, -1, 127, 128, -129, 2**23, 2**31, -(2**31), -(2**31) - 1, 2**47, 2**63 - 1, -(2**63)]),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(st.characters(exclude_categories=["Cs"]), max_size=40),
    st.binary(max_size=20),
)


def make_table(path: Path, rows: list[tuple], page_size: int = 4096) -> sqlite3.Connection:
    connection = sqlite3.connect(path)
    connection.execute(f"PRAGMA page_size = {page_size}")
    connection.execute(
        "CREATE TABLE trials (z, point TEXT, y REAL, trial INTEGER, checksum INTEGER, x TEXT, "
        "PRIMARY KEY (point, trial)) WITHOUT ROWID"
    )
    connection.executemany("INSERT INTO trials (z, point, y, trial, x) VALUES (?, ?, ?, ?, ?)", rows)
    Signer(connection, "trials").sign()
    connection.commit()
    return connection


def agrees(connection: sqlite3.Connection, path: Path) -> bool:
    """Return what compiled code finds, which SQLite must find, too."""
    connection.execute("BEGIN")
    found = has_all_checksums(connection, path, "trials")
    assert not found or find_damaged_row(connection, "trials") is None
    connection.rollback()
    return found


@settings(max_examples=60, deadline=None)
@given(values=st.lists(st.tuples(VALUES, VALUES, VALUES), max_size=30))
def test_every_kind_of_value_is_summed_as_sqlite_gives_it(tmp_path_factory, values) -> None:
    path = tmp_path_factory.mktemp("kinds") / "some.sqlite"
    rows = [(z, f"point {number % 3}", y, number, x) for number, (z, y, x) in enumerate(values)]
    with closing(make_table(path, rows)) as connection:
        assert agrees(connection, path)


@pytest.mark.parametrize("page_size", [512, 4096, 65536])
def test_rows_of_many_pages_and_trees_of_many_levels_are_read(tmp_path, page_size: int) -> None:
    path = tmp_path / "some.sqlite"
    random = Random(1)
    rows = [
        (random.random(), f"point {n % 7}", float(n), n, "x" * int(10 ** random.uniform(0, 4.5))) for n in range(3000)
    ]
    with closing(make_table(path, rows, page_size)) as connection:
        assert agrees(connection, path)
        connection.execute("UPDATE trials SET x = x || 'y' WHERE trial = 2999")
        connection.commit()
        assert not agrees(connection, path)


def test_an_infinite_value_is_left_to_sqlite(tmp_path) -> None:
    path = tmp_path / "some.sqlite"
    with closing(make_table(path, [(math.inf, "a", 1.0, 1, "b")])) as connection:
        assert not agrees(connection, path)
        assert find_damaged_row(connection, "trials") is None


def test_the_log_of_a_run_that_is_at_work_counts(tmp_path) -> None:
    path = tmp_path / "some.sqlite"
    rows = [(n, "a", 0.5 * n, n, "text") for n in range(2000)]
    with closing(make_table(path, rows)) as writer, closing(sqlite3.connect(path)) as reader:
        writer.execute("PRAGMA journal_mode = WAL")
        assert agrees(reader, path)
        for number in range(2000, 2100):
            with writer:
                writer.execute("INSERT INTO trials (z, point, y, trial) VALUES (1, 'b', 0.5, ?)", (number,))
                Signer(writer, "trials").sign("trial = ?", (number,))
        assert path.with_name("some.sqlite-wal").stat().st_size > 0
        assert agrees(reader, path)
        with writer:
            writer.execute("UPDATE trials SET z = 2 WHERE trial = 7")
        assert not agrees(reader, path)
        with writer:
            writer.execute("UPDATE trials SET z = 7 WHERE trial = 7")
        assert agrees(reader, path)
        # a log that begins anew over the frames of the one before, and one whose last commit is not whole
        writer.execute("PRAGMA wal_checkpoint(RESTART)")
        with writer:
            writer.execute("UPDATE trials SET z = 7 WHERE trial = 7")
        assert agrees(reader, path)
        writer.execute("BEGIN")
        writer.execute("PRAGMA cache_size = 1")
        writer.execute("UPDATE trials SET z = 8")
        assert agrees(reader, path)
        writer.rollback()


def test_what_is_no_such_table_is_left_to_sqlite(tmp_path) -> None:
    path = tmp_path / "some.sqlite"
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA encoding = 'UTF-16'")
        connection.execute("CREATE TABLE trials (a TEXT PRIMARY KEY, checksum INTEGER) WITHOUT ROWID")
        connection.execute("INSERT INTO trials VALUES ('b', 1)")
        connection.commit()
        assert not agrees(connection, path)


def test_flipped_bytes_never_pass_where_sqlite_finds_damage(whole, tmp_path, monkeypatch) -> None:  # noqa: F811
    monkeypatch.setattr(database, "LARGE", 0)
    assert sum(check_flips(whole, tmp_path, 300)) > 200


def test_flips_in_rows_alone_are_found_without_a_crash(whole, tmp_path) -> None:  # noqa: F811
    """SQLite's own check is not asked first: compiled code gets trees with loops and lengths beyond the page."""
    contents, random, refused = (whole / DATABASE).read_bytes(), Random(3), 0
    for number in range(300):
        path = tmp_path / DATABASE
        path.write_bytes(contents[:4096] + flipped(contents[4096:], random, 1 + number % 3))
        with closing(sqlite3.connect(path)) as connection:
            try:
                refused += not agrees(connection, path)
            except sqlite3.DatabaseError:
                refused += 1
    assert refused > 100


def test_a_large_folder_with_a_wrong_value_is_refused_with_its_row(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(database, "LARGE", 0)
    fill(tmp_path, scenario_of(None, trials=30))
    with closing(sqlite3.connect(tmp_path / DATABASE)) as connection, connection:
        connection.execute("UPDATE trials SET cycles = cycles + 1 WHERE trial = 3")
    monkeypatch.setattr(database, "_checked", {})
    with pytest.raises(StoreError, match="row 3 of trials does not have its checksum"):
        database.check_database(tmp_path / DATABASE)
