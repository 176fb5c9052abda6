"""Programs that some tests need and not every system has: without one its tests are skipped, but in CI they fail; and
disks that are full."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

MAY_LACK = os.environ.get("CI") != "true"


def needs(program: str, package: str) -> pytest.MarkDecorator:
    """Return the mark of tests that need a program, which is in a package of Debian."""
    is_lacking = MAY_LACK and shutil.which(program) is None
    return pytest.mark.skipif(is_lacking, reason=f"there is no {program}; apt-get install {package}")


needs_compiler = needs("cc", "gcc libc6-dev")
needs_browser = needs("chromium", "chromium")


@contextmanager
def no_file_larger_than(size: int) -> Iterator[None]:
    """Have this process write no file beyond so many bytes, as if the disk were full there."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
