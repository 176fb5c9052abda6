"""Programs that some tests need and not every system has: without one its tests are skipped, but in CI they fail."""

import os
import shutil

import pytest

MAY_LACK = os.environ.get("CI") != "true"


def needs(program: str, package: str) -> pytest.MarkDecorator:
    """Return the mark of tests that need a program, which is in a package of Debian."""
    is_lacking = MAY_LACK and shutil.which(program) is None
    return pytest.mark.skipif(is_lacking, reason=f"there is no {program}; apt-get install {package}")


needs_compiler = needs("cc", "gcc libc6-dev")
needs_browser = needs("chromium", "chromium")
