"""A file in which bytes have changed never gives other rows than it had: they are read as they were, or not at all."""

import re
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from random import Random

import pytest

from epuck_sim.errors import StoreError
from epuck_sim.runs import database
from epuck_sim.runs.database import reading
from epuck_sim.runs.folder import DATABASE
from epuck_sim.runs.reader import read_status
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.scenario.points import points
from tests.cli.commands import refused
from tests.runs.test_store import COUNT, SPEED, fill, outcome, scenario_of

SWEEP = scenario_of({"grid": {COUNT: [2, 3, 4, 5], SPEED: [1, 0.5, 0.25]}}, trials=20)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    fill(folder, SWEEP)
    return folder


@pytest.fixture(autouse=True)
def unchecked(monkeypatch) -> None:
    """Have every file checked, even if it takes the place of one that was checked in the same instant."""
    monkeypatch.setattr(database, "_state", lambda _: object())


def everything(folder: Path) -> list[list[tuple]]:
    with reading(folder) as connection:
        return [connection.execute(f"SELECT * FROM {table} ORDER BY 1, 2").fetchall() for table in ("points", "trials")]


def flipped(contents: bytes, random: Random, count: int) -> bytes:
    changed = bytearray(contents)
    for _ in range(count):
        changed[random.randrange(len(changed))] ^= random.randrange(1, 256)
    return bytes(changed)


def check_flips(whole: Path, folder: Path, flips: int) -> Iterator[bool]:
    """Yield whether each of some damaged files is refused; those that are not must be read as if they were whole."""
    contents, rows, random = (whole / DATABASE).read_bytes(), everything(whole), Random(7)
    for number in range(flips):
        (folder / DATABASE).write_bytes(flipped(contents, random, 1 + number % 3))
        try:
            found = everything(folder)
        except StoreError:
            yield True
        else:
            assert found == rows, number
            yield False


def test_flipped_bytes_never_give_wrong_rows(whole, tmp_path) -> None:
    refusals = sum(check_flips(whole, tmp_path, 90))
    assert refusals > 60


@pytest.mark.slow
def test_thousands_of_flipped_bytes_never_give_wrong_rows(whole, tmp_path) -> None:
    refusals = sum(check_flips(whole, tmp_path, 5000))
    print(f"\n5,000 damaged databases: {refusals} refused, {5000 - refusals} read as they were, none with wrong rows")


def test_a_database_without_checksums_is_refused(whole, tmp_path) -> None:
    (tmp_path / DATABASE).write_bytes((whole / DATABASE).read_bytes())
    with closing(sqlite3.connect(tmp_path / DATABASE)) as connection, connection:
        connection.execute("ALTER TABLE trials DROP COLUMN checksum")
    assert "is damaged: trials has no checksums" in refused("status", tmp_path)


def killed(folder: Path) -> Path:
    """Make a folder whose run was killed: all its trials are in SQLite's log alone."""
    running = folder / "running"
    with Store(running, SWEEP, points(SWEEP)) as store:
        for point in points(SWEEP):
            store.add([outcome(point, trial) for trial in range(SWEEP.trials)])
        shutil.copytree(running, folder / "killed")
    assert {path.name for path in running.iterdir()} == {".lock", DATABASE, RUN_SCENARIO, "SHA256SUMS"}
    return folder / "killed"


def test_a_damaged_log_of_a_killed_run_is_refused_with_what_was_stored(tmp_path) -> None:
    folder = killed(tmp_path)
    log = folder / f"{DATABASE}-wal"
    whole, random = log.read_bytes(), Random(5)
    for _ in range(8):
        log.write_bytes(flipped(whole, random, 1))
        message = refused("status", folder)
        assert re.search(r"is damaged: its log has lost trials: 240 were stored, \d+ can be read", message)
    assert refused("run", folder).endswith(message.partition("error: ")[2])
    (folder / ".stored").unlink()
    assert read_status(folder).stored < 240
    fill(folder, SWEEP)
    assert read_status(folder).stored == 240
