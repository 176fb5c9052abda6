"""Who holds a run folder: also where it is moved or replaced, and where the file system has no locks."""

import errno
import fcntl
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from epuck_sim.errors import StoreError
from epuck_sim.runs import folder as folders
from epuck_sim.runs.folder import HOLDER, LEASE_S, current_holder, own_name, take_over
from epuck_sim.runs.reader import read_status
from epuck_sim.runs.store import Store
from epuck_sim.scenario.points import points
from epuck_sim.util.provenance import host
from tests.cli.commands import call
from tests.processes import wait_until
from tests.runs.test_store import DEMO, FILES, contents, fill, outcome, refused, stored
from tests.sweep.short_sweeps import short_sweep


def moved(folder: Path) -> None:
    folder.rename(folder.with_name("elsewhere"))


def replaced_by_a_killed_run(folder: Path) -> None:
    moved(folder)
    with Store(folder.with_name("other"), DEMO, points(DEMO)) as store:
        store.add([outcome(points(DEMO)[0], 0)])
        shutil.copytree(folder.with_name("other"), folder)


@pytest.mark.parametrize("change", [shutil.rmtree, moved, replaced_by_a_killed_run])
def test_a_sweep_ends_when_its_folder_is_no_longer_there_and_leaves_alone_what_is(
    tmp_path: Path, change: Callable[[Path], None]
) -> None:
    folder, found = tmp_path / "run", points(DEMO)
    with Store(folder, DEMO, found) as store:
        store.add([outcome(found[0], 0)])
        change(folder)
        before = contents(folder) if folder.exists() else {}
        with pytest.raises(StoreError, match=f"{folder}: was moved, deleted, replaced"):
            store.add([outcome(found[0], 1)])
    assert (contents(folder) if folder.exists() else {}) == before
    if before:
        assert [row["trial"] for row in stored(folder)] == [0]
    if folder.with_name("elsewhere").exists():
        with Store(folder.with_name("elsewhere"), DEMO, found) as store:
            assert (0, 0) in set(store.finished())


@pytest.fixture
def _no_locks(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    def fail(*_: object) -> None:
        raise OSError(getattr(request, "param", errno.ENOSYS), "no locks")

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
        message = refused(tmp_path, DEMO)
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
    ids=["at work", "not renewed", "gone from this host"],
)
def test_a_lease_ends_when_it_is_not_renewed_or_its_process_is_gone(
    tmp_path: Path, process: str, age_s: float, is_free: bool
) -> None:
    fill(tmp_path)
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        ended.wait()
    name = f"process {ended.pid} {process}"
    lease_of_another(tmp_path, name, age_s)
    assert current_holder(tmp_path) == (None if is_free else name)
    if is_free:
        fill(tmp_path)
        return
    assert f"{name} is at work on it" in refused(tmp_path, DEMO)
    with pytest.raises(StoreError, match="its file system has no locks; read it when that has ended"):
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
    with Store(tmp_path, DEMO, points(DEMO)):
        lease = tmp_path / HOLDER
        os.utime(lease, (0, 0))
        wait_until(lambda: time.time() - lease.stat().st_mtime < LEASE_S)


def test_a_lock_is_not_taken_over(tmp_path: Path) -> None:
    with Store(tmp_path, DEMO, points(DEMO)):
        assert take_over(tmp_path) is None
        assert f"{own_name()} is at work on it" in refused(tmp_path, DEMO)


@pytest.mark.usefixtures("_no_locks", "sweeps_run_here")
def test_a_command_takes_over_with_a_word(tmp_path: Path) -> None:
    arguments = ("run", short_sweep(tmp_path, 1), "--out", tmp_path / "run")
    assert call(*arguments).exit_code == 0
    lease_of_another(tmp_path / "run", "process 1 on elsewhere", 5)
    refusal = call(*arguments)
    assert (refusal.exit_code, "process 1 on elsewhere is at work" in refusal.stderr) == (2, True)
    taken = call(*arguments, "--take-over")
    assert taken.exit_code == 0
    assert "taken over from process 1 on elsewhere" in taken.stderr
