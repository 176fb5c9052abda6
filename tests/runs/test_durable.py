"""What was reported as stored is on the disk: shown by the calls that wait for it."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.runs.test_store import DATABASE

STORE_THREE = """
import os, sys
from pathlib import Path
from epuck_sim.runs.store import Store
from epuck_sim.scenario.points import points
from tests.runs.test_store import DEMO, outcome
found = points(DEMO)
with Store(Path(sys.argv[1]), DEMO, found) as store:
    for trial in range(3):
        os.write(2, b"adding\\n")
        store.add([outcome(found[0], trial)])
        os.write(2, b"stored\\n")
"""


def synced_files(folder: Path) -> tuple[list[str], list[list[str]]]:
    """Return the files that were synced before the first trial was added, and while each was."""
    log = folder.parent / "calls.txt"
    trace = ("strace", "-f", "-y", "-qq", "-e", "trace=fsync,fdatasync,write", "-o", str(log))
    command = [*trace, sys.executable, "-c", STORE_THREE, str(folder)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if "ptrace" in done.stderr:
        pytest.skip("processes may not be traced here")
    assert done.returncode == 0, done.stderr
    phases: list[list[str]] = [[]]
    for line in log.read_text().splitlines():
        if '"adding' in line or '"stored' in line:
            phases.append([])
        elif found := re.search(r"\b(?:fsync|fdatasync)\(\d+<(.*?)>", line):
            phases[-1].append(found[1])
    return phases[0], phases[1::2]


@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")
def test_a_store_waits_for_the_disk_before_a_trial_counts_as_stored(tmp_path) -> None:
    folder = tmp_path / "run"
    before, while_adding = synced_files(folder)
    log = str(folder / f"{DATABASE}-wal")
    assert [log in files for files in while_adding] == [True] * 3
    # the names of the new files, and of the folder, are on the disk, too
    assert {str(folder), str(folder.parent)} <= set(before) | set(while_adding[0])
