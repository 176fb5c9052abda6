"""A browser without a window, to look at what pages show."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from epuck_sim.arrays import FloatArray

BROWSER = shutil.which("chromium")

needs_browser = pytest.mark.skipif(BROWSER is None, reason="there is no chromium to look at pages with")

OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=30000")


def shown(page: Path, profile: Path, query: str = "") -> str:
    """Return the page's HTML after its scripts have run."""
    return _run(profile, "--dump-dom", page.as_uri() + query).stdout


def picture(page: Path, profile: Path, *, is_dark: bool = False, size: str = "1000,1600") -> FloatArray:
    """Return what a window shows of a page, (height, width, 3), 0 to 255."""
    theme = ["--blink-settings=preferredColorScheme=0"] if is_dark else []
    target = profile.with_suffix(".png")
    _run(profile, f"--window-size={size}", *theme, f"--screenshot={target}", page.as_uri())
    with Image.open(target) as opened:
        return np.asarray(opened.convert("RGB"), float)


def _run(profile: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    assert BROWSER is not None
    command = [BROWSER, *OPTIONS, f"--user-data-dir={profile}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
