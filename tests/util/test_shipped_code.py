"""Compiled code that comes with a release is used wherever the release lies, until an edit makes it stale."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from epuck_sim.util.jit import kernel_digest

PACKAGE = Path(__file__).parents[2] / "epuck_sim"
PROGRAM = "from epuck_sim.util.elementary import sin; print(sin(1.0).hex())"


def sine(folder: Path, cache: Path) -> str:
    """Return the sine of 1 that the package in a folder computes in a process of its own."""
    environment = os.environ | {"PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(cache)}
    program = [sys.executable, "-c", PROGRAM]
    return subprocess.run(program, env=environment, cwd=folder, check=True, capture_output=True, text=True).stdout


def test_it_is_used_elsewhere_until_a_kernel_is_edited(tmp_path: Path) -> None:
    here, elsewhere, cache = (tmp_path / name for name in ("here", "elsewhere", "cache"))
    for folder in (here, elsewhere):
        shutil.copytree(PACKAGE, folder / "epuck_sim", ignore=shutil.ignore_patterns("__pycache__", "compiled"))
        (folder / "epuck_sim" / "compiled").mkdir()  # so that both compile for the same processors
    expected = sine(here, here / "epuck_sim" / "compiled")
    shutil.copytree(here / "epuck_sim" / "compiled", elsewhere / "epuck_sim" / "compiled", dirs_exist_ok=True)
    assert sine(elsewhere, cache) == expected
    assert not list(cache.rglob("*.nbc"))
    package = elsewhere / "epuck_sim"
    assert {folder.name for folder in (package / "compiled").iterdir()} == {kernel_digest("util", package)}
    with (package / "elementary.py").open("a") as file:
        file.write("\n# an edit\n")
    kernel_digest.cache_clear()
    assert not (package / "compiled" / kernel_digest("util", package)).exists()
