"""Films of trials, by `run --film` and by `film`: what they write and print, and how mistakes end."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from epuck_sim.overhead.film_writer import FilmWriter
from epuck_sim.overhead.frame import Frame
from epuck_sim.recording.reader import read_recording
from tests.cli.commands import call, called, contents, refused
from tests.cli.films import frames_and_description, names, shut
from tests.overhead.small_films import cut_off

THREE = """
name: three
arena: {width_cm: 40, height_cm: 40}
robots: [{count: 3, controller: firefly}]
stop: {max_cycles: 2}
overhead: {width_px: 160, height_px: 128}
"""

BAD_STEP = """
PARAMETERS = {}
MEMORY = {}
def start(memory, parameters, random):
    pass
def step(sensors, memory, actuators, parameters, random):
    raise ValueError("never again")
"""

POSES = ("--record-level", "poses")
"""What cameras see is not recorded: to compile that takes a while."""


def trials(stdout: str) -> list[dict[str, Any]]:
    """Return the trials of a command's JSON, without the time they took."""
    return [{**json.loads(line), "wall_s": 0} for line in stdout.splitlines()]


@pytest.fixture(scope="module")
def shelf(tmp_path_factory) -> Path:
    """Return a folder of a trial's scenario, film and recordings that no test changes."""
    folder = tmp_path_factory.mktemp("shelf")
    (folder / "three.yaml").write_text(THREE)
    run = "run", folder / "three.yaml"
    called(*run, "--record", folder / "three.rrd", *POSES, "--film", folder / "three.mp4")
    called(*run, "--record", folder / "summary.rrd", "--record-level", "summary")
    return folder


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """Return the current folder, which is empty."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def nothing_runs(monkeypatch) -> None:
    """Have no trial simulated."""
    monkeypatch.setattr("epuck_sim.cli.trials.simulate", lambda *_, **__: pytest.fail("it ran"))


# run --film


def test_a_filmed_run_prints_the_same_and_writes_the_film(shelf, here) -> None:
    plain = trials(called("run", shelf / "three.yaml", "--json"))
    filmed = trials(called("run", shelf / "three.yaml", "--json", "--film", "t.mp4"))
    assert filmed == plain
    assert names(here) == ["t.mp4"]
    frames, description = frames_and_description("t.mp4")
    assert frames[0].picture.shape == (128, 160, 3)
    assert len(frames) == pytest.approx(15 * plain[0]["simulated_s"], abs=2)
    assert description is not None
    assert (description["scenario"], description["seed"], description["robots"]) == ("three", plain[0]["seed"], 3)


def test_a_trial_is_filmed_recorded_and_traced_at_once_and_the_film_is_the_same(shelf, here) -> None:
    called("run", shelf / "three.yaml", "--film", "t.mp4", "--record", "t.rrd", *POSES, "--trace", "t.parquet")
    assert names(here) == ["t.mp4", "t.parquet", "t.rrd"]
    assert (here / "t.mp4").read_bytes() == (shelf / "three.mp4").read_bytes()
    assert read_recording(here / "t.rrd").seed == read_recording(shelf / "three.rrd").seed


def test_several_trials_are_filmed_into_a_file_each(shelf, here) -> None:
    rows = trials(called("run", shelf / "three.yaml", "--trials", "2", "--seed", "7", "--json", "--film", "t.mp4"))
    assert names(here) == ["t-0.mp4", "t-1.mp4"]
    described = [frames_and_description(name)[1] for name in names(here)]
    assert [film and film["seed"] for film in described] == [row["seed"] for row in rows]
    assert rows[0]["seed"] != rows[1]["seed"]


def test_a_trial_of_a_sweep_can_be_filmed(here) -> None:
    (here / "swept.yaml").write_text(THREE + "sweep: {grid: {robots.0.parameters.speed_cm_s: [1, 4]}}")
    words = ["run", "swept.yaml", "--point", "1", "--trial", "0", "--json", "--film", "t.mp4"]
    (row,) = trials(called(*words))
    assert names(here) == ["swept.yaml", "t.mp4"]
    description = frames_and_description("t.mp4")[1]
    assert description is not None
    assert description["seed"] == row["seed"]


def test_where_a_trial_fails_an_older_film_stays_and_nothing_else(here) -> None:
    (here / "bad.py").write_text(BAD_STEP)
    (here / "bad.yaml").write_text("robots: [{count: 2, controller: bad.py}]")
    (here / "t.mp4").write_text("older")
    before = contents(here)
    assert "never again" in refused("run", "bad.yaml", "--interpret", "--film", "t.mp4")
    assert contents(here) == before


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("run pair --live --film t.txt", "--film is t.txt; allowed: a name that ends in .mp4"),
        ("run pair --live --film gone/t.mp4", "gone/t.mp4: cannot be written: there is no directory gone"),
        ("run pair --film folder.mp4", "folder.mp4: cannot be written: is a directory"),
        ("run pair --film pipe.mp4", "pipe.mp4: cannot be written: is not a regular file"),
        ("run pair --trials 2 --film several.mp4", "several-1.mp4: cannot be written: is a directory"),
        (f"run pair --film {'x' * 300}.mp4", "File name too long"),
        ("run swept.yaml --out new --film t.mp4", "a sweep keeps no traces, recordings and films"),
        ("run swept.yaml --film t.mp4", "swept.yaml: holds a sweep of 2 points"),
    ],
)
def test_what_cannot_be_filmed_is_refused_before_anything_runs(here, arguments: str, message: str) -> None:
    (here / "swept.yaml").write_text(THREE + "sweep: {grid: {robots.0.parameters.speed_cm_s: [1, 4]}}")
    for name in ("folder.mp4", "several-1.mp4"):
        (here / name).mkdir()
    os.mkfifo(here / "pipe.mp4")
    before = contents(here)
    assert message in refused(*arguments.split())
    assert contents(here) == before


@pytest.mark.usefixtures("nothing_runs")
def test_a_folder_without_permission_is_refused(here, monkeypatch) -> None:
    shut(monkeypatch, here / "shut")
    stderr = refused("run", "pair", "--film", "shut/t.mp4")
    assert "cannot be written: no permission to write in shut" in stderr


# film


def test_a_recording_is_filmed_as_the_trial_was(shelf, here) -> None:
    assert called("film", shelf / "three.rrd", "t.mp4") == ""
    assert names(here) == ["t.mp4"]
    frames, description = frames_and_description("t.mp4")
    original, described = frames_and_description(shelf / "three.mp4")
    assert description == described
    assert [frame.time_s for frame in frames] == [frame.time_s for frame in original]
    assert max(np.abs(a.picture.astype(int) - b.picture).mean() for a, b in zip(frames, original, strict=True)) < 1


@pytest.mark.usefixtures("here")
def test_settings_change_the_camera_and_nothing_else(shelf) -> None:
    called("film", shelf / "three.rrd", "dark.mp4")
    words = "--set overhead.light=lit --set overhead.width_px=200 --set overhead.frames_per_s=5"
    called("film", shelf / "three.rrd", "lit.mp4", *words.split())
    (dark, described), (lit, changed) = frames_and_description("dark.mp4"), frames_and_description("lit.mp4")
    assert lit[0].picture.shape == (128, 200, 3)
    assert len(lit) == pytest.approx(len(dark) / 3, abs=1)
    assert lit[0].picture.mean() > 5 * dark[0].picture.mean()
    assert described is not None
    assert changed is not None
    assert changed["overhead"] == described["overhead"] | {"light": "lit", "width_px": 200, "frames_per_s": 5}
    assert {**changed, "overhead": 0} == {**described, "overhead": 0}


def test_a_film_is_written_over_an_older_one(shelf, here) -> None:
    (here / "t.mp4").write_text("older")
    called("film", shelf / "three.rrd", "t.mp4", "--set", "overhead.frames_per_s=1")
    assert frames_and_description("t.mp4")[0]
    assert names(here) == ["t.mp4"]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("overhead.light=bright", "overhead.light: is 'bright'; allowed: 'dark' or 'lit'"),
        ("overhead.width_px=321", "overhead.width_px: is 321; allowed: a multiple of 2"),
        ("overhead.height_px=62", "overhead.height_px: is 62; allowed: at least 64"),
        ("overhead.width_px=7682", "overhead.width_px: is 7682; allowed: at most 7680"),
        ("overhead.width_px=wide", "overhead.width_px: is 'wide'; allowed: "),
        ("overhead.width=320", "overhead.width: unknown 'width', did you mean 'width_px'?; allowed: height_cm, "),
        ("overhead.frames_per_s=0", "overhead.frames_per_s: is 0; allowed: at least 1"),
        ("overhead.frames_per_s=nan", "overhead.frames_per_s: is 'nan'; allowed: a finite number"),
        ("overhead.exposure_ms=67", "exposure_ms is 67; allowed: up to the time from one frame to the next, 66.67 ms"),
        ("overhead.exposure_ms=40 overhead.frames_per_s=30", "exposure_ms is 40; allowed: up to"),
        ("overhead.bloom=1.5", "overhead.bloom: is 1.5; allowed: at most 1"),
        ("overhead.noise_levels=-1", "overhead.noise_levels: is -1; allowed: at least 0"),
        ("overhead.height_cm=12", "overhead.height_cm is 12; allowed: more than 12"),
        ("overhead.distortion=-0.3 overhead.field_of_view_deg=90", "overhead.distortion is -0.3"),
        ("overhead.light", "--set overhead.light: give it as key=value"),
        ("overhead=lit", "--set overhead=lit: the trial is over; allowed: the camera's keys"),
        ("arena.width_cm=50", "--set arena.width_cm=50: the trial is over; allowed: the camera's keys"),
        ("overhead.light=lit seed=3", "--set seed=3: the trial is over; allowed: the camera's keys"),
    ],
)
def test_no_setting_of_the_camera_is_refused(shelf, here, settings: str, message: str) -> None:
    words = [word for setting in settings.split() for word in ("--set", setting)]
    assert message in refused("film", shelf / "three.rrd", "t.mp4", *words)
    assert names(here) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("THREE t.avi", "t.avi: is not a film's name; allowed: names that end in .mp4"),
        ("THREE t", "t: is not a film's name; allowed: names that end in .mp4"),
        ("THREE THREE", "three.rrd: is not a film's name; allowed: names that end in .mp4"),
        ("THREE gone/t.mp4", "gone/t.mp4: cannot be written: there is no directory gone"),
        ("THREE folder.mp4", "folder.mp4: cannot be written: is a directory"),
        ("gone.rrd t.mp4", "gone.rrd: there is no such file"),
        ("folder.mp4 t.mp4", "folder.mp4: is not a file"),
        ("FILM t.mp4", "three.mp4: is not a recording: the name must end in .rrd"),
        ("text.rrd t.mp4", "text.rrd: is not a "),
        ("empty.rrd t.mp4", "empty.rrd: is not a "),
        ("half.rrd t.mp4", "half.rrd: is not a complete recording"),
        ("SUMMARY t.mp4", "summary.rrd: holds no poses; record the trial again with --record-level poses or full"),
    ],
)
def test_what_cannot_be_filmed_is_reported(shelf, here, arguments: str, message: str) -> None:
    (here / "folder.mp4").mkdir()
    (here / "text.rrd").write_text("mine")
    (here / "empty.rrd").touch()
    shutil.copy(shelf / "three.rrd", here / "half.rrd")
    cut_off(here / "half.rrd", 0.5)
    before = contents(here)
    files = {"THREE": "three.rrd", "FILM": "three.mp4", "SUMMARY": "summary.rrd"}
    given = [str(shelf / files[word]) if word in files else word for word in arguments.split()]
    assert message in refused("film", *given)
    assert contents(here) == before


def test_ctrl_c_leaves_an_older_film_and_nothing_half_written(shelf, here, monkeypatch) -> None:
    (here / "t.mp4").write_text("older")
    frames: list[Frame] = []

    def write(_: FilmWriter, frame: Frame) -> None:
        frames.append(frame)
        if len(frames) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(FilmWriter, "write", write)
    result = call("film", shelf / "three.rrd", "t.mp4")
    assert (result.exit_code, result.stdout, result.stderr) == (130, "", "interrupted\n")
    assert contents(here) == {"t.mp4": b"older"}


def test_help_loads_nothing_that_takes_a_while() -> None:
    script = (
        "import sys\nfrom epuck_sim.cli.app import app\n"
        "for words in (['--help'], ['film', '--help'], ['track', '--help'], ['run', '--help']):\n"
        "    try: app(words)\n    except SystemExit as end: assert not end.code\n"
        "    heavy = {'av', 'cv2', 'numpy', 'scipy', 'numba', 'matplotlib', 'rerun', 'rerun_sdk', 'pymunk'}\n"
        "    print('loaded', sorted(heavy & sys.modules.keys()))"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loaded = [line for line in result.stdout.splitlines() if line.startswith("loaded")]
    assert loaded == ["loaded []"] * 4
