"""What was reported as stored is on the disk, and says from the first moment what it is: seen by the order of calls."""

import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from epuck_sim.runs import database, store
from epuck_sim.runs.database import reading
from epuck_sim.runs.reader import read_status
from epuck_sim.runs.share import Share, read_share
from epuck_sim.runs.store import Store
from epuck_sim.scenario.points import points
from tests.runs.test_store import DATABASE, DEMO, FILES, fill, outcome


@pytest.fixture
def calls(monkeypatch) -> list[tuple[str, int]]:
    """What waits for the disk, and what gives a file its name, in order, each with the number of the file's inode."""
    made: list[tuple[str, int]] = []
    sync, name = os.fsync, os.replace

    def log_sync(number: int) -> None:
        made.append(("sync", os.fstat(number).st_ino))
        sync(number)

    def log_name(part: Path, target: Path) -> None:
        made.append(("name", Path(part).stat().st_ino))
        name(part, target)

    monkeypatch.setattr(os, "fsync", log_sync)
    monkeypatch.setattr(os, "replace", log_name)
    return made


def test_each_file_of_a_folder_is_on_the_disk_before_its_name_and_then_the_name_is(tmp_path, calls) -> None:
    folder = tmp_path / "run"
    with Store(folder, DEMO, points(DEMO)):
        numbers = {name: (folder / name).stat().st_ino for name in FILES - {".lock"}}
    in_folder, in_parent = (("sync", path.stat().st_ino) for path in (folder, tmp_path))
    for number in numbers.values():
        named = calls.index(("name", number))
        assert ("sync", number) in calls[:named]
        assert in_folder in calls[named:]
    assert in_parent in calls


def test_each_commit_of_a_run_waits_for_the_disk_and_leaves_the_database_alone(tmp_path, monkeypatch) -> None:
    opened: list[sqlite3.Connection] = []
    connect = sqlite3.connect

    def remember(*given, **more) -> sqlite3.Connection:
        opened.append(connect(*given, **more))
        opened[-1].execute("PRAGMA synchronous = NORMAL")  # what some builds of SQLite begin with
        return opened[-1]

    monkeypatch.setattr(database.sqlite3, "connect", remember)
    found = points(DEMO)
    with Store(tmp_path, DEMO, found) as at_work:
        before = (tmp_path / DATABASE).read_bytes()
        at_work.add([outcome(found[0], 0)])
        assert (tmp_path / DATABASE).read_bytes() == before
        assert opened[-1].execute("PRAGMA journal_mode").fetchone() == ("wal",)
        assert opened[-1].execute("PRAGMA synchronous").fetchone() == (2,)  # FULL


def test_a_new_database_is_one_file_and_has_its_share_before_anything_else_can_fail(tmp_path, monkeypatch) -> None:
    def die(*_: object) -> None:
        raise InterruptedError

    monkeypatch.setattr(store, "write_sources", die)
    with pytest.raises(InterruptedError):
        Store(tmp_path, DEMO, points(DEMO), Share(2, 3))
    assert {path.name for path in tmp_path.iterdir()} == {DATABASE, ".lock"}
    with reading(tmp_path) as connection:
        assert read_share(connection) == Share(2, 3)
    with database.new_database(tmp_path / "other", [], []) as connection:
        connection.execute("INSERT INTO points VALUES ('', 0, 1, '', '', '', '', NULL, 0)")
        assert {path.suffix for path in tmp_path.glob("other*")} == {".part"}


def test_a_write_in_which_a_process_died_is_undone_before_a_folder_is_read(tmp_path) -> None:
    fill(tmp_path)
    script = f"""
import os, sqlite3
connection = sqlite3.connect({str(tmp_path / DATABASE)!r})
connection.execute("PRAGMA cache_size = 1")  # pages reach the file before the commit
connection.execute("BEGIN")
connection.execute("UPDATE points SET scenario = replace(hex(zeroblob(20000)), '0', 'x')")
os._exit(0)
"""
    subprocess.run([sys.executable, "-c", script], check=True)
    assert (tmp_path / f"{DATABASE}-journal").stat().st_size
    assert read_status(tmp_path).scenario == "demo"
