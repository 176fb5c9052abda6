"""The notebook in the docs runs, cell after cell, and shows what it promises; nothing of a machine is in it."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).parent.parent / "docs/run_notebook.py"
NOTEBOOK = SCRIPT.with_name("notebook.ipynb")


def shown_in(notebook: Path) -> list[dict[str, str]]:
    """Return what each cell of code shows, by format; cells are left out that need the extra `notebook`."""
    cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
    run = [cell["outputs"] for cell in cells if "notebook-extra" not in cell["metadata"].get("tags", [])]
    return [{kind: "".join(text) for each in outputs for kind, text in each["data"].items()} for outputs in run]


@pytest.fixture(scope="module")
def shown(tmp_path_factory) -> list[dict[str, Any]]:
    folder = tmp_path_factory.mktemp("notebook")
    environment = {**os.environ, "IPYTHONDIR": str(folder / "ipython")}
    command = [sys.executable, SCRIPT, folder / "run.ipynb"]
    subprocess.run(command, cwd=folder, env=environment, check=True, timeout=300, stdout=subprocess.DEVNULL)
    return shown_in(folder / "run.ipynb")


def test_things_show_themselves(shown) -> None:
    scenario, simulation, step, result, recording, film, moved, points, _ = (
        formats.get("text/html", "") for formats in shown
    )
    assert "near_walls" in scenario
    assert simulation.count("<circle") == recording.count("<circle") == 10
    assert 'class="lit"' in recording
    assert step.count("<svg") == 10
    assert "t_sync_cycles" in result
    assert "<video controls" in film
    assert "data:video/mp4;base64," in film
    assert "data:video/mp4;base64," in moved
    assert points.count("<tr>") == 4


def test_the_notebook_holds_what_it_shows_and_no_paths(shown) -> None:
    kept = shown_in(NOTEBOOK)
    assert [each.keys() for each in kept] == [each.keys() for each in shown]
    assert kept[1] == shown[1]
    assert re.findall(r"/(?:home|root|tmp|work|Users)\b", NOTEBOOK.read_text()) == []
