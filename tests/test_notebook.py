"""The notebook in the docs shows what it promises, and still runs to that; nothing of a machine is in it."""

import json
import os
import re
import subprocess
import sys
from base64 import b64encode
from pathlib import Path

import pytest

from epuck_sim import Simulation, read_points, run_trial, show, summarize
from tests.runs.made_folders import SPEED, store, sweep, weibull

SCRIPT = Path(__file__).parent.parent / "docs/run_notebook.py"
NOTEBOOK = SCRIPT.with_name("notebook.ipynb")


def shown_in(notebook: Path) -> list[dict[str, str]]:
    """Return what each cell of code shows, by format; cells are left out that need the extra `notebook`."""
    cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
    run = [cell["outputs"] for cell in cells if "notebook-extra" not in cell["metadata"].get("tags", [])]
    return [{kind: "".join(text) for each in outputs for kind, text in each["data"].items()} for outputs in run]


def test_things_show_themselves_and_no_paths() -> None:
    scenario, simulation, step, result, recording, film, moved, points, _ = (
        formats.get("text/html", "") for formats in shown_in(NOTEBOOK)
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

    assert re.findall(r"/(?:home|root|tmp|work|Users)\b", NOTEBOOK.read_text()) == []


def test_films_results_and_points_show_themselves(tmp_path) -> None:
    (tmp_path / "t.mp4").write_bytes(b"film")
    film = show(tmp_path / "t.mp4")._repr_html_()
    assert "<video controls" in film
    assert f"data:video/mp4;base64,{b64encode(b'film').decode()}" in film
    assert "t_sync_cycles" in run_trial(Simulation("pair", 1))._repr_html_()
    folder = store(tmp_path / "run", sweep({SPEED: [1, 2, 4]}, trials=6), lambda point: weibull(point, 30))
    assert read_points(folder)._repr_html_().count("<tr>") == 4
    assert "mean" in summarize(read_points(folder))._repr_html_()


@pytest.mark.slow
def test_the_notebook_runs_to_what_it_holds(tmp_path) -> None:
    environment = {**os.environ, "IPYTHONDIR": str(tmp_path / "ipython")}
    command = [sys.executable, SCRIPT, tmp_path / "run.ipynb"]
    subprocess.run(command, cwd=tmp_path, env=environment, check=True, timeout=300, stdout=subprocess.DEVNULL)
    kept, shown = shown_in(NOTEBOOK), shown_in(tmp_path / "run.ipynb")
    assert [each.keys() for each in kept] == [each.keys() for each in shown]
    assert kept[1] == shown[1]
