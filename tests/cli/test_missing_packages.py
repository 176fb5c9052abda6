"""Claims about a small install, without viewer, films and plots: sweeps run, and other commands say what they lack."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from epuck_sim.cli.errors import EXTRAS

ROOT = Path(__file__).parent.parent.parent

WITHOUT = f"import sys\nsys.modules.update(dict.fromkeys({list(EXTRAS)}))\nfrom epuck_sim.cli.app import main\nmain()"


def call_without(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Call the command in a process that cannot import any of the optional packages."""
    return subprocess.run(
        [sys.executable, "-c", WITHOUT, *words], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Return a folder with a run folder `runs`, which a sweep without the optional packages made."""
    made = tmp_path_factory.mktemp("small")
    axes = ["--sweep", "robots.0.parameters.speed_cm_s=4,8", "--trials", "5", "--workers", "1"]
    short = ["--set", "stop.max_cycles=5", "--measure", "component_count"]
    done = call_without(made, "run", "pair", *axes, *short, "--out", "runs")
    assert done.returncode == 0, done.stderr
    return made


@pytest.mark.parametrize("command", ["summarize", "status", "fit", "plan"])
def test_sweeps_and_statistics_need_none_of_them(folder: Path, command: str) -> None:
    done = call_without(folder, command, "runs")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("words", "package", "extra"),
    [
        (("plot", "runs"), "matplotlib", "plot"),
        (("report", "runs", "--to", "page.html"), "matplotlib", "plot"),
        (("export", "runs", "--to", "trials.csv"), "pyarrow", "table"),
        (("run", "pair", "--trace", "trace.parquet"), "pyarrow", "table"),
        (("run", "pair", "--record", "pair.rrd"), "rerun-sdk", "view"),
        (("run", "pair", "--film", "pair.mp4"), "opencv-python-headless", "film"),
        (("run", "pair", "--set", "arena.floor.picture=runs/scenario.yaml"), "opencv-python-headless", "film"),
        (("run", "pair", "--live"), "rerun-sdk", "view"),
        (("track", "film.mp4"), "opencv-python-headless", "film"),
    ],
)
def test_other_commands_say_in_a_line_what_they_lack(
    folder: Path, words: tuple[str, ...], package: str, extra: str
) -> None:
    done = call_without(folder, *words)
    assert done.returncode == 2
    message = f"error: this needs {package}, which is not installed: pip install 'epuck-sim[{extra}]'\n"
    assert done.stderr == message


def test_every_extra_installs_what_it_is_named_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for package, extra in EXTRAS.values():
        assert package not in {re.split("[<>=]", each)[0] for each in project["dependencies"]}
        own = [re.split("[<>=]", each)[0] for each in extras[extra]]
        assert package in own
    (everything,) = extras["all"]
    assert everything == f"epuck-sim[{','.join(sorted(set(extras) - {'all', 'docs', 'page', 'test', 'train'}))}]"


def test_the_docs_name_every_extra() -> None:
    page = (ROOT / "docs/small_install.md").read_text()
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == set(extras) - {"docs", "test"}
