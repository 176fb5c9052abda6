"""Settings of all tests."""

import os
from collections.abc import Iterator
from importlib import import_module

import pytest
from hypothesis import settings

from tests.processes import end_all
from tests.sweep.pool_here import pool_here

settings.register_profile("here", deadline=None, max_examples=100)
settings.register_profile("ci", deadline=None, max_examples=100, derandomize=True, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")


@pytest.fixture(autouse=True)
def _no_process_outlives_its_test() -> Iterator[None]:
    yield
    end_all()


@pytest.fixture(scope="module")
def sweeps_run_here() -> Iterator[None]:
    """Have commands run their sweeps in this process; pools of processes are looked at in tests/sweep."""
    with pytest.MonkeyPatch.context() as patches:
        for module in ("epuck_sim.sweep.executors", "epuck_sim.cli.trials"):
            patches.setattr(import_module(module), "local_pool", pool_here)
        yield
