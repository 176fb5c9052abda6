"""The built wheel carries what it needs and works from any folder."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from epuck_sim.util.builtin import ARENAS, CONTROLLERS, SWEEPS

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Return the folder into which the wheel was unpacked."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (file,) = folder.glob("*.whl")
    with zipfile.ZipFile(file) as archive:
        archive.extractall(folder / "unpacked")
    return folder / "unpacked"


def test_arenas_and_controllers_are_inside(wheel: Path) -> None:
    for kind in (ARENAS, SWEEPS, CONTROLLERS):
        shipped = {path.name for path in (ROOT / kind).iterdir() if path.is_file()}
        assert {path.name for path in (wheel / "epuck_sim" / kind).iterdir() if path.is_file()} == shipped
    assert (wheel / "epuck_sim" / "py.typed").exists()
    assert (wheel / "epuck_sim" / "control" / "include" / "epuck.h").exists()


def test_it_runs_from_any_folder(wheel: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(wheel)}
    where = "import epuck_sim; print(epuck_sim.__file__)"
    for script in (["-c", where], ["-m", "epuck_sim", "run", "pair", "--json"]):
        result = subprocess.run(
            [sys.executable, *script], cwd=tmp_path, env=environment, check=True, capture_output=True, text=True
        )
        if script[0] == "-c":
            assert result.stdout.startswith(str(wheel))
        else:
            assert json.loads(result.stdout)["t_sync_cycles"] >= 1
