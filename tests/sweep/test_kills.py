"""A sweep that is killed, or finds the disk full, at a system call that writes, whichever it is, loses no trial."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from epuck_sim.runs.folder import DATABASE
from epuck_sim.runs.status import read_status
from tests.processes import start
from tests.sweep.die_at_write import FULL
from tests.sweep.short_sweeps import short_sweep

SOURCE = Path(__file__).with_name("die_at_write.c")

WRITES = 50
"""Fewest system calls that write in a sweep: the database, its journals, the scenario, the lock."""


@pytest.fixture(scope="module")
def shim(tmp_path_factory) -> Path:
    """Return the library that kills the process which preloads it."""
    compiler = shutil.which("cc")
    if compiler is None or sys.platform != "linux":
        pytest.skip("there is no C compiler, or no way to preload a library")
    library = tmp_path_factory.mktemp("shim") / "die_at_write.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, SOURCE, "-ldl"], check=True)
    return library


def die(shim: Path, folder: Path, kills: int, fault: int) -> dict[str, int]:
    """Fail sweeps at `kills` calls spread evenly, all if it is 0, and return what `die_at_write.main` reports."""
    arguments = [sys.executable, "-m", "tests.sweep.die_at_write", folder, str(kills), str(fault)]
    process = start(arguments, env={"LD_PRELOAD": str(shim)}, cwd=SOURCE.parents[2])
    stdout, stderr = process.communicate(timeout=1200)
    assert process.returncode == 0, stderr
    return json.loads(stdout)


@pytest.mark.parametrize("torn", [False, True])
def test_a_sweep_killed_at_some_of_its_writes_loses_nothing_and_goes_on(shim, tmp_path, torn: bool) -> None:
    report = die(shim, tmp_path, 12, int(torn))
    assert report["calls"] > WRITES
    assert report["killed"] == 12


@pytest.mark.slow
@pytest.mark.parametrize("torn", [False, True])
def test_a_sweep_killed_at_any_of_its_writes_once_or_twice_loses_nothing_and_goes_on(shim, tmp_path, torn) -> None:
    report = die(shim, tmp_path, 0, int(torn))
    assert report["killed"] == 3 * report["calls"] > 3 * WRITES


def test_a_disk_that_is_full_from_some_call_on_is_named_and_loses_nothing(shim, tmp_path) -> None:
    report = die(shim, tmp_path, 12, FULL)
    assert report["calls"] > WRITES
    assert report["killed"] == 12


@pytest.mark.slow
def test_a_disk_that_is_full_from_any_call_on_is_named_and_loses_nothing(shim, tmp_path) -> None:
    report = die(shim, tmp_path, 0, FULL)
    assert report["killed"] == 3 * report["calls"] > 3 * WRITES


def test_a_write_in_which_a_process_died_is_undone_before_a_folder_is_read(tmp_path) -> None:
    short = short_sweep(tmp_path, 1)
    script = f"""
import os, sqlite3
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points

scenario = load_scenario({str(short)!r})
with Store(__import__("pathlib").Path("run"), scenario, points(scenario)):
    pass
connection = sqlite3.connect("run/{DATABASE}")
connection.execute("PRAGMA cache_size = 1")  # pages reach the file before the commit
connection.execute("BEGIN")
connection.execute("UPDATE points SET scenario = replace(hex(zeroblob(20000)), '0', 'x')")
os._exit(0)
"""
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=True, env=dict(os.environ))
    assert (tmp_path / "run" / f"{DATABASE}-journal").stat().st_size
    assert read_status(tmp_path / "run").scenario == "short"
