"""A fixture for tests of controllers, which pytest finds where epuck-sim is installed."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:  # every run of pytest loads this module
    from epuck_sim.testing import TestRobot


@pytest.fixture(params=["interpreted", "compiled"])
def make_robot(request: pytest.FixtureRequest) -> "Callable[..., TestRobot]":
    """Return `epuck_sim.testing.TestRobot`; a test that uses it runs twice, interpreted and compiled.

    A controller's file is looked for beside the test's file first, then in the working directory.
    """
    from epuck_sim.testing import TestRobot  # noqa: PLC0415 it loads numba

    def make(controller: str | Path, *arguments: Any, **options: Any) -> TestRobot:
        beside = request.path.parent / controller
        found = beside if beside.is_file() else controller
        return TestRobot(found, *arguments, **{"interpret": request.param == "interpreted", **options})

    return make
