"""A fixture for tests of controllers, which pytest finds where epuck-sim is installed."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:  # every run of pytest loads this module
    from epuck_sim.testing import TestRobot


@pytest.fixture(params=["interpreted", "compiled"])
def make_robot(request: pytest.FixtureRequest) -> "Callable[..., TestRobot]":
    """Return `epuck_sim.testing.TestRobot`; a test that uses it runs twice, interpreted and compiled.

    Files of controllers and sensors are looked for beside the test's file first, then in the working directory.
    """
    from epuck_sim.testing import TestRobot  # noqa: PLC0415 it loads numba

    def find(file: Any) -> Any:
        if isinstance(file, str | Path) and (beside := request.path.parent / file).is_file():
            return beside
        return file  # which `TestRobot` finds elsewhere, or refuses

    def make(controller: str | Path, *arguments: Any, sensors: Sequence[str | Path] = (), **options: Any) -> TestRobot:
        own = sensors if isinstance(sensors, str | Path) else list(map(find, sensors))
        settings = {"interpret": request.param == "interpreted", "sensors": own, **options}
        return TestRobot(find(controller), *arguments, **settings)

    return make
