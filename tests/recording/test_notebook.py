"""Recordings and films in notebooks."""

import sys
from types import SimpleNamespace

import pytest
from rerun import notebook

from epuck_sim import EpuckSimError, RecordingError, load_scenario, read_recording, show
from epuck_sim.recording import Level
from tests.recording.recordings import recorded


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


@pytest.mark.parametrize(
    ("name", "said"),
    [("none.rrd", "there is no such file"), ("t.txt", r"unknown format '\.txt'; allowed: \.rrd, \.mp4")],
)
def test_what_cannot_be_shown_is_refused(tmp_path, name: str, said: str) -> None:
    (tmp_path / "t.txt").touch()
    with pytest.raises(EpuckSimError, match=said):
        show(tmp_path / name)


def test_what_is_missing_is_named(recording, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(notebook, "HAS_NOTEBOOK", False)
    with pytest.raises(EpuckSimError, match=r'pip install "epuck-sim\[notebook\]"'):
        show(recording)
    monkeypatch.setitem(sys.modules, "IPython.display", None)
    (tmp_path / "t.mp4").touch()
    with pytest.raises(EpuckSimError, match=r'pip install "epuck-sim\[notebook\]"'):
        show(tmp_path / "t.mp4")
    (tmp_path / "broken.rrd").write_bytes(b"no recording")
    with pytest.raises(RecordingError):
        show(tmp_path / "broken.rrd")


@pytest.mark.parametrize("level", Level)
def test_recordings_of_every_level_show_what_they_hold(tmp_path, level: Level) -> None:
    recorded(tmp_path / "t.rrd", load_scenario("particles", ["stop.max_cycles=2"]), 1, level)
    html = read_recording(tmp_path / "t.rrd")._repr_html_()
    assert f"<td>{level}</td>" in html
    assert html.count("<circle") == (0 if level is Level.SUMMARY else 20)
