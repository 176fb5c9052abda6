"""The notebook in the docs runs, cell after cell, and shows what it promises; nothing of a machine is in it."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).parent.parent / "docs/notebook.ipynb"
CELLS = [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]

RUN = """
import json, sys
from traitlets.config import Config
from IPython.core.interactiveshell import InteractiveShell

shell = InteractiveShell(config=Config({"HistoryManager": {"enabled": False}}))
shown = []
for source in json.loads(sys.argv[1]):
    done = shell.run_cell(source)
    done.raise_error()
    formats, _ = shell.display_formatter.format(done.result)
    shown.append(formats)
with open("shown.json", "w") as file:
    json.dump(shown, file)
"""


@pytest.fixture(scope="module")
def shown(tmp_path_factory) -> list[dict[str, Any]]:
    """Return what each cell shows, by format; cells are left out that need the extra `notebook`."""
    folder = tmp_path_factory.mktemp("notebook")
    sources = ["".join(cell["source"]) for cell in CELLS if "notebook-extra" not in cell["metadata"].get("tags", [])]
    environment = {**os.environ, "IPYTHONDIR": str(folder / "ipython")}
    command = [sys.executable, "-c", RUN, json.dumps(sources)]
    subprocess.run(command, cwd=folder, env=environment, check=True, timeout=300, stdout=subprocess.DEVNULL)
    return json.loads((folder / "shown.json").read_text())


def test_things_show_themselves(shown) -> None:
    scenario, simulation, step, result, recording, film, points, _ = (formats.get("text/html", "") for formats in shown)
    assert "near_walls" in scenario
    assert simulation.count("<circle") == recording.count("<circle") == 10
    assert 'class="lit"' in recording
    assert step.count("<svg") == 10
    assert "t_sync_cycles" in result
    assert "<video controls" in film
    assert "data:video/mp4;base64," in film
    assert points.count("<tr>") == 4


def test_the_notebook_holds_no_outputs_and_no_paths() -> None:
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in CELLS)
    assert re.findall(r"/(?:home|root|tmp|work|Users)\b", NOTEBOOK.read_text()) == []
