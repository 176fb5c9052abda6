from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.browsers import Driven


@pytest.fixture(scope="session")
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driven]:
    driven = Driven(tmp_path_factory.mktemp("browser") / "profile")
    yield driven
    driven.close()


@pytest.fixture
def browser(started: Driven) -> Iterator[Driven]:
    """The browser of all tests of pages."""
    yield started
    started.leave()


@pytest.fixture(scope="session")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for pages."""
    return tmp_path_factory.mktemp("pages")
