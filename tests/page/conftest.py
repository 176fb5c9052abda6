from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from epuck_sim.page.writer import write_page
from tests.browsers import Driven


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driven]:
    """The browser of all tests of pages."""
    driven = Driven(tmp_path_factory.mktemp("browser") / "profile")
    yield driven
    driven.close()


@pytest.fixture
def opened(browser: Driven, tmp_path: Path) -> Iterator[Callable[..., Driven]]:
    """A function that opens the page of a scenario, with changes, and returns the browser."""

    def open_page(name: str, changes: Sequence[str] = ()) -> Driven:
        write_page(name, tmp_path / "page.html", changes)
        browser.said.clear()
        browser.open((tmp_path / "page.html").as_uri())
        return browser

    yield open_page
    browser.leave()
