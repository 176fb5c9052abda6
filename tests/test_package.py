"""The built wheel carries what it needs and works from any folder."""

import json
import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
import yaml

import epuck_sim
from epuck_sim.util.builtin import ARENAS, CONTROLLERS, SWEEPS

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """Return the folder with the source distribution and the wheel."""
    folder = tmp_path_factory.mktemp("built")
    build = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    """Return the folder into which the wheel was unpacked."""
    (file,) = built.glob("*.whl")
    with zipfile.ZipFile(file) as archive:
        archive.extractall(built / "unpacked")
    return built / "unpacked"


def test_the_source_distribution_holds_what_its_own_commands_need(built: Path) -> None:
    (file,) = built.glob("*.tar.gz")
    assert file.name == f"epuck_sim-{epuck_sim.__version__}.tar.gz"
    with tarfile.open(file) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    needed = {"Makefile", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "LICENSE", "pyproject.toml"}
    assert needed | {"docs/conf.py", "docs/_ext/reference.py", "arenas/thesis.yaml", "tests/golden.json"} <= held
    old = {str(path.relative_to(ROOT)) for path in (ROOT / "tests" / "old").rglob("*") if path.suffix != ".pyc"}
    assert {name for name in old if (ROOT / name).is_file()} <= held


def test_whoever_cites_this_version_names_it() -> None:
    named = yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"]
    assert named == json.loads((ROOT / "codemeta.json").read_text())["version"] == epuck_sim.__version__


@pytest.mark.slow
def test_the_wheel_runs_in_an_empty_environment_and_both_can_be_published(built: Path, tmp_path: Path) -> None:
    venv.create(tmp_path / "empty", with_pip=True)
    (wheel,) = built.glob("*.whl")

    def run(program: str, *words: str | Path) -> str:
        return output_of("", tmp_path, tmp_path / "empty" / "bin" / program, *words)

    run("python", "-m", "pip", "install", "--quiet", f"{wheel}[view,film,plot]")
    assert run("epuck-sim", "--version") == f"epuck-sim {epuck_sim.__version__}\n"
    for scenario in ("pair", "particles"):
        assert json.loads(run("epuck-sim", "run", scenario, "--json"))["t_sync_cycles"] >= 1
    run("epuck-sim", "run", "pair", "--record", "pair.rrd", "--film", "pair.mp4")
    run("epuck-sim", "plot", "pair.rrd")
    run("python", "-m", "pip", "install", "--quiet", "twine")
    run("twine", "check", "--strict", wheel, *built.glob("*.tar.gz"))


def test_arenas_and_controllers_are_inside(wheel: Path) -> None:
    for kind in (ARENAS, SWEEPS, CONTROLLERS):
        shipped = {path.name for path in (ROOT / kind).iterdir() if path.is_file()}
        assert {path.name for path in (wheel / "epuck_sim" / kind).iterdir() if path.is_file()} == shipped
    assert (wheel / "epuck_sim" / "py.typed").exists()
    assert (wheel / "epuck_sim" / "control" / "include" / "epuck.h").exists()


def output_of(wheel: Path | str, folder: Path, *command: str | Path) -> str:
    """Return what a command prints in a folder where Python imports the package from the wheel, if one is given."""
    environment = {**os.environ, "PYTHONPATH": str(wheel)}
    return subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout


def test_it_is_used_from_any_folder(wheel: Path, tmp_path: Path) -> None:
    script = "import epuck_sim; print(epuck_sim.__file__); from epuck_sim.cli.app import app; app(['list'])"
    file, *listed = output_of(wheel, tmp_path, sys.executable, "-c", script).splitlines()
    assert file.startswith(str(wheel))
    assert any(line.startswith("  pair  ") and "two e-pucks" in line for line in listed)


@pytest.mark.slow
def test_it_runs_from_any_folder(wheel: Path, tmp_path: Path) -> None:
    """Compiled code is kept for the folder of its sources: here, all is compiled anew."""
    ran = output_of(wheel, tmp_path, sys.executable, "-m", "epuck_sim", "run", "pair", "--json")
    assert json.loads(ran)["t_sync_cycles"] >= 1
