"""Programs that some tests need and not every system has: without one its tests are skipped, counted and named."""

import os
import shutil
from collections import Counter
from typing import Any

import pytest

from epuck_sim.recording.rerun import NO_GRAPHICS

PACKAGES = {
    "there is no chromium": "chromium",
    "there is no C compiler": "gcc libc6-dev",
    NO_GRAPHICS: "mesa-vulkan-drivers",
    "there is no node": "nodejs",
}
"""Debian's packages, by what the reason of a test that is skipped without them says."""

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
needs_browser = pytest.mark.skipif(shutil.which("chromium") is None, reason="there is no chromium")


def count_missing(skipped: list[Any]) -> Counter[str]:
    """Return how many tests were skipped for lack of each package, from their reports."""
    return Counter(
        package for report in skipped for reason, package in PACKAGES.items() if reason in str(report.longrepr)
    )


class MissingTools:
    """Plugin of pytest: says at the end what to install for the tests that were skipped; with CI=true they fail."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Let the tests fail where nothing may be missing."""
        reporter = session.config.pluginmanager.get_plugin("terminalreporter")
        if reporter is not None and os.environ.get("CI") == "true" and count_missing(reporter.stats.get("skipped", [])):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Say what to install."""
        for package, count in count_missing(terminalreporter.stats.get("skipped", [])).items():
            terminalreporter.write_line(f"{count} tests were skipped; for them: apt-get install {package}", yellow=True)
