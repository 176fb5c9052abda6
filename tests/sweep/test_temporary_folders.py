"""What a killed sweep leaves in the temporary folder, what a closed terminal makes it print, and who cleans up."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from epuck_sim.sweep import executors
from epuck_sim.sweep.executors import LOCK, remove_stale_folders
from epuck_sim.util import machine
from tests.processes import COMMAND, start, wait_until
from tests.sweep.short_sweeps import stored

SWEEP = ("run", "pair", "--trials", "100000", "--workers", "2", "--set", "stop.max_cycles=2", "--out")


def running(out: Path, folder: Path) -> subprocess.Popen:
    """Start a sweep whose temporary files lie in `folder`, and wait until it has stored a trial."""
    process = start([*COMMAND, *SWEEP, out], mark=folder.name, env={"TMPDIR": str(folder)})
    wait_until(lambda: stored(out) > 0, 120)
    return process


def folders_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("pymp-*"))


@pytest.fixture
def folder() -> Iterator[Path]:
    """A temporary folder with a short name: names of sockets in it may have 107 characters."""
    with TemporaryDirectory(prefix="e") as name:
        yield Path(name)


@pytest.mark.parametrize("request_", [signal.SIGHUP, signal.SIGTERM])
def test_a_request_to_all_processes_of_a_sweep_leaves_no_traceback_and_no_folder(folder, tmp_path, request_) -> None:
    process = running(tmp_path / "run", folder)
    os.killpg(process.pid, request_)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert stderr.splitlines()[-1].startswith("stopped; ")
    assert not {"Traceback", "Warning"} & set(stderr.replace(":", " ").split())
    assert folders_in(folder) == []


def test_the_folder_of_a_killed_sweep_is_removed_by_the_next_one_and_that_of_a_running_one_is_not(
    folder, tmp_path
) -> None:
    (folder / "pymp-of-another-program").mkdir()
    killed = running(tmp_path / "killed", folder)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate(timeout=60)
    left = set(folders_in(folder)) - {"pymp-of-another-program"}
    assert len(left) == 1
    running(tmp_path / "one", folder)
    ours = set(folders_in(folder)) - {"pymp-of-another-program"}
    assert len(ours) == 1
    assert not ours & left
    running(tmp_path / "another", folder)
    assert ours < set(folders_in(folder))
    assert "pymp-of-another-program" in folders_in(folder)


def test_links_and_the_folders_of_others_stay(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(executors.tempfile, "gettempdir", lambda: str(tmp_path))
    outside = tmp_path / "outside"
    for folder in (outside, tmp_path / "pymp-ours", tmp_path / "pymp-linked"):
        folder.mkdir()
    (outside / LOCK).touch()
    (tmp_path / "pymp-link").symlink_to(outside)
    (tmp_path / "pymp-linked" / LOCK).symlink_to(outside / LOCK)
    (tmp_path / "pymp-ours" / LOCK).touch()
    monkeypatch.setattr(machine, "USER", -1)
    remove_stale_folders()
    assert (tmp_path / "pymp-ours").is_dir()
    monkeypatch.undo()
    monkeypatch.setattr(executors.tempfile, "gettempdir", lambda: str(tmp_path))
    remove_stale_folders()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["outside", "pymp-link", "pymp-linked"]
    assert (outside / LOCK).exists()
