"""Notebooks: what things show there; the one in the docs runs to what it holds, and nothing of a machine is in it."""

import json
import os
import re
import subprocess
import sys
from base64 import b64encode
from pathlib import Path
from types import SimpleNamespace

import pytest
from rerun import notebook

from epuck_sim import EpuckSimError, Simulation, load_scenario, read_points, read_recording, run_trial, show, summarize
from epuck_sim.errors import RecordingError
from epuck_sim.recording import Level
from tests.recording.recordings import recorded
from tests.runs.made_folders import SPEED, store, sweep, weibull

SCRIPT = Path(__file__).parent.parent / "docs/run_notebook.py"
NOTEBOOK = SCRIPT.with_name("notebook.ipynb")


def shown_in(notebook: Path) -> list[dict[str, str]]:
    """Return what each cell of code shows, by format; cells are left out that need the extra `notebook`."""
    cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
    run = [cell["outputs"] for cell in cells if "notebook-extra" not in cell["metadata"].get("tags", [])]
    return [{kind: "".join(text) for each in outputs for kind, text in each["data"].items()} for outputs in run]


def test_things_films_results_points_and_recordings_of_every_level_show_themselves_and_no_paths(tmp_path) -> None:
    shown = (formats.get("text/html", "") for formats in shown_in(NOTEBOOK))
    scenario, simulation, step, result, recording, film, of_slider, points, _ = shown
    assert "near_walls" in scenario
    assert simulation.count("<circle") == recording.count("<circle") == 10
    assert 'class="lit"' in recording
    assert step.count("<svg") == 10
    assert "t_sync_cycles" in result
    assert "censored</th><td>False" in of_slider
    assert "<video controls" in film
    assert "data:video/mp4;base64," in film
    assert points.count("<tr>") == 6
    assert "image/png" in shown_in(NOTEBOOK)[-1]
    assert re.findall(r"/(?:home|root|tmp|work|Users)\b", NOTEBOOK.read_text()) == []
    (tmp_path / "t.mp4").write_bytes(b"film")
    film = show(tmp_path / "t.mp4")._repr_html_()
    assert "<video controls" in film
    assert f"data:video/mp4;base64,{b64encode(b'film').decode()}" in film
    assert "t_sync_cycles" in run_trial(Simulation("pair", 1))._repr_html_()
    folder = store(tmp_path / "run", sweep({SPEED: [1, 2, 4]}, trials=6), lambda point: weibull(point, 30))
    assert read_points(folder)._repr_html_().count("<tr>") == 4
    assert "mean" in summarize(read_points(folder))._repr_html_()
    for level in Level:
        recorded(tmp_path / "t.rrd", load_scenario("particles", ["stop.max_cycles=2"]), 1, level)
        html = read_recording(tmp_path / "t.rrd")._repr_html_()
        assert f"<td>{level}</td>" in html
        assert html.count("<circle") == (0 if level is Level.SUMMARY else 20)


@pytest.mark.slow
def test_the_notebook_runs_to_what_it_holds(tmp_path) -> None:
    environment = {**os.environ, "IPYTHONDIR": str(tmp_path / "ipython")}
    command = [sys.executable, SCRIPT, tmp_path / "run.ipynb"]
    subprocess.run(command, cwd=tmp_path, env=environment, check=True, timeout=300, stdout=subprocess.DEVNULL)
    kept, shown = shown_in(NOTEBOOK), shown_in(tmp_path / "run.ipynb")
    assert [each.keys() for each in kept] == [each.keys() for each in shown]
    assert kept[1] == shown[1]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("notebook") / "t.rrd"
    recorded(path, load_scenario("pair", ["stop.max_time_s=2"]))
    return path


def test_a_viewer_is_given_the_whole_recording(recording, monkeypatch) -> None:
    given = {}

    def viewer(**options):
        given.update(options)
        given["memory"] = options["recording"].memory_recording()
        return SimpleNamespace(name="viewer")

    monkeypatch.setattr(notebook, "HAS_NOTEBOOK", True)
    monkeypatch.setattr(notebook, "Viewer", viewer)
    assert show(recording).name == "viewer"
    assert given["blueprint"] is not None
    assert given["memory"].num_msgs() > 5


def test_what_cannot_be_shown_is_refused_and_what_is_missing_named(recording, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(notebook, "HAS_NOTEBOOK", False)
    monkeypatch.setitem(sys.modules, "IPython.display", None)
    for name in ("t.txt", "t.mp4", "broken.rrd"):
        (tmp_path / name).touch()
    for path, error, said in (
        (tmp_path / "none.rrd", EpuckSimError, "there is no such file"),
        (tmp_path / "t.txt", EpuckSimError, r"unknown format '\.txt'; allowed: \.rrd, \.mp4"),
        (recording, EpuckSimError, r'pip install "epuck-sim\[notebook\]"'),
        (tmp_path / "t.mp4", EpuckSimError, r'pip install "epuck-sim\[notebook\]"'),
        (tmp_path / "broken.rrd", RecordingError, "broken.rrd"),
    ):
        with pytest.raises(error, match=said):
            show(path)
