"""Settings of all tests."""

import atexit
import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from epuck_sim.sweep import scheduler
from epuck_sim.util.machine import signals
from tests.processes import end_all
from tests.sweep.pool_here import pool_here

_state = tempfile.TemporaryDirectory(prefix="epuck-sim-tests-")
atexit.register(_state.cleanup)
os.environ["XDG_STATE_HOME"] = _state.name  # not what the user trusts

settings.register_profile("same", deadline=None, max_examples=50, derandomize=True, print_blob=True)
settings.register_profile("search", deadline=None, max_examples=500, print_blob=True)
# without bytecode, hundreds of processes read the sources of numba and of all else that they import
os.environ["PYTHONDONTWRITEBYTECODE"] = ""
sys.dont_write_bytecode = False
# what `nohup` ignores is heard by the processes that tests start
for _number in signals("SIGHUP"):
    signal.signal(_number, signal.SIG_DFL)

settings.load_profile("same")  # --hypothesis-profile search looks for what nobody has seen yet


@pytest.fixture(autouse=True)
def _no_process_outlives_its_test() -> Iterator[None]:
    yield
    end_all()


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """Return the current folder, which is empty."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def sweeps_run_here() -> Iterator[None]:
    """Have commands run their sweeps in this process; pools of processes are looked at in tests/sweep."""
    with pytest.MonkeyPatch.context() as patches:
        patches.setattr(scheduler, "local_pool", pool_here)
        yield
