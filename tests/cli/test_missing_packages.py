"""Claims about a small install, without viewer, films and plots: sweeps run, and other commands say what they lack."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

from epuck_sim.cli.errors import EXTRAS

ROOT = Path(__file__).parent.parent.parent

WITHOUT = f"""
import json, sys
sys.modules.update(dict.fromkeys({list(EXTRAS)}))
from epuck_sim.sweep import executors
from tests.cli.commands import call
from tests.sweep.pool_here import pool_here
executors.local_pool = pool_here
print(json.dumps([(done.exit_code, done.stderr) for done in (call(*words.split()) for words in json.load(sys.stdin))]))
"""
"""Calls commands in a process that cannot import any of the optional packages."""

SWEEP = (
    "run pair --sweep robots.0.parameters.speed_cm_s=4,8 --trials 5 --set stop.max_cycles=5 --out runs "
    "--measure component_count"
)

LACKING = {
    "plot runs": ("matplotlib", "plot"),
    "report runs --to page.html": ("matplotlib", "plot"),
    "export runs --to trials.csv": ("pyarrow", "table"),
    "run pair --trace trace.parquet": ("pyarrow", "table"),
    "run pair --record pair.rrd": ("rerun-sdk", "view"),
    "run pair --film pair.mp4": ("opencv-python-headless", "film"),
    "run pair --set arena.floor.picture=runs/scenario.yaml": ("opencv-python-headless", "film"),
    "run pair --live": ("rerun-sdk", "view"),
    "track film.mp4": ("opencv-python-headless", "film"),
}
"""Which package each command lacks, and the extra that installs it."""


def test_sweeps_and_statistics_need_none_of_them_and_other_commands_say_what_they_lack(tmp_path) -> None:
    whole = [SWEEP, "summarize runs", "status runs", "fit runs", "plan runs"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    given = {"cwd": tmp_path, "env": environment, "input": json.dumps([*whole, *LACKING])}
    done = subprocess.run([sys.executable, "-c", WITHOUT], **given, stdout=subprocess.PIPE, text=True, check=True)
    ended = json.loads(done.stdout)
    assert [code for code, _ in ended[: len(whole)]] == [0] * len(whole), ended
    assert ended[len(whole) :] == [
        [2, f'error: this needs {package}, which is not installed: pip install "epuck-sim[{extra}]"\n']
        for package, extra in LACKING.values()
    ]


def test_every_extra_installs_what_it_is_named_for_and_the_docs_name_it() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for package, extra in EXTRAS.values():
        assert package not in {re.split("[<>=]", each)[0] for each in project["dependencies"]}
        assert package in [re.split("[<>=]", each)[0] for each in extras[extra]]
    (everything,) = extras["all"]
    assert everything == f"epuck-sim[{','.join(sorted(set(extras) - {'all', 'docs', 'page', 'test', 'train'}))}]"
    page = (ROOT / "docs/small_install.md").read_text()
    assert set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == set(extras) - {"docs", "test"}
