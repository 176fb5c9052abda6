"""A run folder on the disk: who holds it, what is on the disk when, and what becomes of bytes that have changed."""

import errno
import fcntl
import os
import re
import shutil
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from random import Random
from unittest.mock import Mock

import pytest

from epuck_sim.errors import StoreError
from epuck_sim.runs import database, folder as folders, store
from epuck_sim.runs.compatibility import Share, read_share
from epuck_sim.runs.database import reading
from epuck_sim.runs.folder import HOLDER, LEASE_S, current_holder, own_name, take_over
from epuck_sim.runs.reader import read_status
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario, points
from epuck_sim.util.provenance import host
from tests.cli.commands import call, contents, refused
from tests.processes import wait_until
from tests.runs.made_folders import COUNT, DATABASE, DEMO, FILES, SPEED, fill, outcome, refusal, scenario_of, stored
from tests.sweep.short_sweeps import short_sweep


def moved(folder: Path) -> None:
    folder.rename(folder.with_name("elsewhere"))


def killed(folder: Path, scenario=DEMO, trials: int = 1) -> None:
    """Make a folder whose run was killed: all its trials, so many at each point, are in SQLite's log alone."""
    running, found = folder.with_name("running"), points(scenario)
    with Store(running, scenario, found) as store:
        for point in found:
            store.add([outcome(point, trial) for trial in range(trials)])
        shutil.copytree(running, folder)
    assert set(contents(running)) == FILES


def replaced_by_a_killed_run(folder: Path) -> None:
    moved(folder)
    killed(folder)


@pytest.mark.parametrize("change", [shutil.rmtree, moved, replaced_by_a_killed_run])
def test_a_sweep_ends_when_its_folder_is_no_longer_there_and_leaves_alone_what_is(tmp_path: Path, change):
    folder, found = tmp_path / "run", points(DEMO)
    with Store(folder, DEMO, found) as store:
        store.add([outcome(found[0], 0)])
        change(folder)
        before = contents(folder) if folder.exists() else {}
        with pytest.raises(StoreError, match=f"{folder}: was moved, deleted, replaced"):
            store.add([outcome(found[0], 1)])
    assert (contents(folder) if folder.exists() else {}) == before
    if before:
        assert [row["trial"] for row in stored(folder)] == [0] * 4
    if folder.with_name("elsewhere").exists():
        with Store(folder.with_name("elsewhere"), DEMO, found) as store:
            assert (0, 0) in set(store.finished())


@pytest.fixture
def _no_locks(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    fail = Mock(side_effect=OSError(getattr(request, "param", errno.ENOSYS), "no locks"))
    monkeypatch.setattr(fcntl, "flock", fail)
    monkeypatch.setattr(fcntl, "lockf", fail)
    monkeypatch.setattr(folders, "SETTLE_S", 0.01)


def lease_of_another(folder: Path, name: str, age_s: float) -> None:
    """Leave the lease of a process, renewed so long ago."""
    (folder / HOLDER).write_text(name)
    os.utime(folder / HOLDER, (time.time() - age_s,) * 2)


@pytest.mark.parametrize("_no_locks", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.EIO], indirect=True)
@pytest.mark.usefixtures("_no_locks")
def test_without_locks_a_folder_is_held_by_a_lease_and_is_free_afterwards(tmp_path: Path) -> None:
    with Store(tmp_path, DEMO, points(DEMO)) as store:
        store.add([outcome(points(DEMO)[0], 0)])
        assert current_holder(tmp_path) == own_name()
        assert read_status(tmp_path).stored == 1
        message = refusal(tmp_path, DEMO)
    assert message == (
        f"{tmp_path}: {own_name()} is at work on it; wait until it ends, or stop it; if it is gone, its lease ends "
        f"after {LEASE_S:g} s, or at once with --take-over"
    )
    assert current_holder(tmp_path) is None
    assert set(contents(tmp_path)) == FILES


@pytest.mark.usefixtures("_no_locks")
@pytest.mark.parametrize(
    ("process", "age_s", "is_free"),
    [("on elsewhere", 5, False), ("on elsewhere", LEASE_S + 5, True), (f"on {host()}", 5, True)],
)
def test_a_lease_ends_when_it_is_not_renewed_or_its_process_is_gone(tmp_path, process: str, age_s: float, is_free):
    fill(tmp_path)
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        ended.wait()
    name = f"process {ended.pid} {process}"
    lease_of_another(tmp_path, name, age_s)
    assert current_holder(tmp_path) == (None if is_free else name)
    if is_free:
        fill(tmp_path)
        return
    assert f"{name} is at work on it" in refusal(tmp_path, DEMO)
    with pytest.raises(StoreError, match="its file system has no locks; read it when that work ends"):
        read_status(tmp_path)
    assert take_over(tmp_path) == name
    fill(tmp_path)


@pytest.mark.usefixtures("_no_locks")
def test_who_lost_the_lease_stores_nothing_more_and_leaves_the_new_one_alone(tmp_path: Path) -> None:
    found = points(DEMO)
    with Store(tmp_path, DEMO, found) as store:
        store.add([outcome(found[0], 0)])
        assert take_over(tmp_path) == own_name()
        lease_of_another(tmp_path, "process 1 on elsewhere", 0)
        with pytest.raises(StoreError, match="taken over"):
            store.add([outcome(found[0], 1)])
    assert current_holder(tmp_path) == "process 1 on elsewhere"
    take_over(tmp_path)
    assert [row["trial"] for row in stored(tmp_path)] == [0]


@pytest.mark.usefixtures("_no_locks")
def test_a_lease_is_renewed_while_its_process_is_at_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folders, "RENEW_S", 0.01)
    lease = tmp_path / HOLDER
    with Store(tmp_path, DEMO, points(DEMO)):
        os.utime(lease, (0, 0))
        wait_until(lambda: time.time() - lease.stat().st_mtime < LEASE_S)


LOCK_IT = """
import sys
from pathlib import Path
from epuck_sim.runs.folder import acquire
with acquire(Path(sys.argv[1])):
    print("locked", flush=True)
    sys.stdin.read()
"""


def test_a_lock_ends_with_its_process_even_killed_or_in_an_error_and_is_not_taken_over(tmp_path) -> None:
    command = [sys.executable, "-c", LOCK_IT, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"locked\n"
        name = f"process {process.pid} on {host()}"
        assert f"{name} is at work on it" in refusal(tmp_path, DEMO)
        assert current_holder(tmp_path) == name
        process.kill()
    assert (tmp_path / ".lock-holder").read_text() == name
    assert current_holder(tmp_path) is None
    with Store(tmp_path, DEMO, points(DEMO)):
        assert current_holder(tmp_path) == own_name() == f"process {os.getpid()} on {host()}"
    assert set(contents(tmp_path)) == FILES
    found = points(DEMO)
    with Store(tmp_path, DEMO, found):
        assert take_over(tmp_path) is None
        assert current_holder(tmp_path) is not None
        assert f"{own_name()} is at work on it" in refusal(tmp_path, DEMO)
    assert current_holder(tmp_path) is None
    with pytest.raises(ZeroDivisionError), Store(tmp_path, DEMO, found):
        1 / 0  # noqa: B018
    assert current_holder(tmp_path) is None
    fill(tmp_path)
    refusal(tmp_path, load_scenario(DEMO, ["trials=3", "seed=1"]))
    assert current_holder(tmp_path) is None


@pytest.mark.usefixtures("_no_locks", "sweeps_run_here")
def test_a_command_takes_over_with_a_word(tmp_path: Path) -> None:
    arguments = ("run", short_sweep(tmp_path, 1), "--out", tmp_path / "run")
    assert call(*arguments).exit_code == 0
    lease_of_another(tmp_path / "run", "process 1 on elsewhere", 5)
    assert "process 1 on elsewhere is at work" in refused(*arguments)
    taken = call(*arguments, "--take-over")
    assert taken.exit_code == 0
    assert "taken over from process 1 on elsewhere" in taken.stderr


def test_each_file_of_a_folder_is_on_the_disk_before_its_name_and_then_the_name_is(tmp_path, monkeypatch) -> None:
    calls: list[tuple[str, int]] = []  # each with the number of the file's inode
    sync, name, folder = os.fsync, os.replace, tmp_path / "run"

    def log_sync(number: int) -> None:
        calls.append(("sync", os.fstat(number).st_ino))
        sync(number)

    def log_name(part: Path, target: Path) -> None:
        calls.append(("name", Path(part).stat().st_ino))
        name(part, target)

    monkeypatch.setattr(os, "fsync", log_sync)
    monkeypatch.setattr(os, "replace", log_name)
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
    monkeypatch.setattr(store, "write_sources", Mock(side_effect=InterruptedError))
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


@pytest.mark.parametrize("flips", [90, pytest.param(5000, marks=pytest.mark.slow)])
def test_flipped_bytes_never_give_wrong_rows(whole, tmp_path, flips: int) -> None:
    contents, rows, random, refusals = (whole / DATABASE).read_bytes(), everything(whole), Random(7), 0
    for number in range(flips):
        (tmp_path / DATABASE).write_bytes(flipped(contents, random, 1 + number % 3))
        try:
            found = everything(tmp_path)
        except StoreError:
            refusals += 1
        else:
            assert found == rows, number
    print(f"\n{flips} damaged databases: {refusals} refused, the others read as they were, none with wrong rows")
    assert refusals > flips * 2 / 3


def test_a_damaged_log_of_a_killed_run_is_refused_with_what_was_stored(tmp_path) -> None:
    folder = tmp_path / "killed"
    killed(folder, SWEEP, SWEEP.trials)
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
