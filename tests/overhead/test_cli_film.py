"""The commands of the camera above the arena: what they write and print, and how mistakes end."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from cli_kit import call, refused
from reader_kit import MP4, cut_off, write_film, write_sound
from sweeps_kit import COMMAND, wait_until
from track_kit import PLACES, described, even, in_step, read_rings, save, shoot

from epuck_sim import cli_run
from epuck_sim.overhead import tracking
from epuck_sim.overhead.film_reader import Film, open_film
from epuck_sim.overhead.frame import Frame
from epuck_sim.recording.reader import read_recording

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

ROBOTS = 4
FLOOR = "8,8,231,8,231,231,8,231"
"""About where the floor's corners are in the films of `swarm` and others."""

KEYS = {
    *("film", "frames", "fps", "duration_s", "start_s", "calibration", "period_s", "flash_ms", "threshold_ms"),
    *("estimated", "robots_seen", "flashes_per_period", "t_sync_s", "t_sync_cycles", "t_sync_flashes", "warnings"),
    "versions",
}
"""Of the JSON object that `track` prints."""


def called(*arguments: str | Path) -> str:
    """Return what a command prints that ends well and has nothing to complain of."""
    result = call(*arguments)
    assert (result.exit_code, result.stderr) == (0, ""), result.exception
    return result.stdout


def tracked(film: str | Path, *options: str | Path) -> dict[str, Any]:
    """Return the object that `track` prints of a film about which it has nothing to complain of."""
    return json.loads(called("track", film, "--json", *options))


def trials(stdout: str) -> list[dict[str, Any]]:
    """Return the trials of a command's JSON, without the time they took."""
    return [{**json.loads(line), "wall_s": 0} for line in stdout.splitlines()]


def contents(folder: Path) -> dict[str, bytes | None]:
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def seen(film: str | Path) -> tuple[list[Frame], dict[str, Any] | None]:
    """Return a film's frames, and what it says of itself."""
    with open_film(str(film)) as opened:
        return list(opened.frames()), opened.description


def save_long(path: Path, repeated: int) -> None:
    """Write a film of a second of the swarm again and again; its pictures are compressed but once."""
    with av.open(path, "w") as container:
        stream = container.add_stream("mjpeg", rate=30, options={"qmin": "2", "qmax": "2"})
        stream.width, stream.height, stream.pix_fmt = 240, 240, "yuvj444p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 30)
        pictures = [
            bytes(packet)
            for number, frame in enumerate(shoot(even(1), in_step(even(1), ROBOTS)))
            for packet in stream.encode(_numbered(frame, number))
        ]
        for number, picture in enumerate(pictures * repeated):
            packet = av.Packet(picture)
            packet.stream, packet.time_base, packet.is_keyframe = stream, Fraction(1, 30), True
            packet.pts = packet.dts = number
            container.mux(packet)


def _numbered(frame: Frame, number: int) -> av.VideoFrame:
    picture = av.VideoFrame.from_ndarray(frame.picture, format="rgb24")
    picture.pts, picture.time_base = number, Fraction(1, 30)
    return picture


@pytest.fixture(scope="module")
def shelf(tmp_path_factory) -> Path:
    """Return a folder of films and recordings that no test changes."""
    folder = tmp_path_factory.mktemp("shelf")
    frames = shoot(even(5), in_step(even(5), ROBOTS))
    save(folder / "swarm.mp4", frames)
    save(folder / "described.mp4", frames[:90], described() | {"robots": ROBOTS})
    save(folder / "lit_start.mp4", shoot(even(5), in_step(even(5), ROBOTS), lit_until_s=1.0))
    save(folder / "dark.mp4", shoot(even(1), np.zeros((30, ROBOTS), bool)))
    save(folder / "lit.mp4", shoot(even(1), np.zeros((30, ROBOTS), bool), lit_until_s=9.0))
    (folder / "three.yaml").write_text(THREE)
    called("run", folder / "three.yaml", "--record", folder / "three.rrd", "--film", folder / "three.mp4")
    called("run", "pair", "--record", folder / "summary.rrd", "--record-level", "summary")
    return folder


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """Return the current folder, which is empty."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def nothing_runs(monkeypatch) -> None:
    """Have no trial simulated, and no film looked at."""

    def forbidden(*_: Any, **__: Any) -> None:
        pytest.fail("it ran")

    monkeypatch.setattr(cli_run, "make_model", forbidden)
    monkeypatch.setattr(tracking, "open_film", forbidden)


def put(folder: Path, *files: Path) -> None:
    for file in files:
        shutil.copy(file, folder)


# run --film


def test_a_filmed_run_prints_the_same_and_writes_the_film(shelf, here) -> None:
    plain = trials(called("run", shelf / "three.yaml", "--json"))
    filmed = trials(called("run", shelf / "three.yaml", "--json", "--film", "t.mp4"))
    assert filmed == plain
    assert names(here) == ["t.mp4"]
    frames, description = seen("t.mp4")
    assert frames[0].picture.shape == (128, 160, 3)
    assert len(frames) == pytest.approx(15 * plain[0]["simulated_s"], abs=2)
    assert description is not None
    assert (description["scenario"], description["seed"], description["robots"]) == ("three", plain[0]["seed"], 3)


def test_a_trial_is_filmed_recorded_and_traced_at_once_and_the_film_is_the_same(shelf, here) -> None:
    called("run", shelf / "three.yaml", "--film", "t.mp4", "--record", "t.rrd", "--trace", "t.parquet")
    assert names(here) == ["t.mp4", "t.parquet", "t.rrd"]
    assert (here / "t.mp4").read_bytes() == (shelf / "three.mp4").read_bytes()
    assert read_recording(here / "t.rrd").seed == read_recording(shelf / "three.rrd").seed


def test_several_trials_are_filmed_into_a_file_each(shelf, here) -> None:
    rows = trials(called("run", shelf / "three.yaml", "--trials", "2", "--seed", "7", "--json", "--film", "t.mp4"))
    assert names(here) == ["t-0.mp4", "t-1.mp4"]
    told = [seen(name)[1] for name in names(here)]
    assert [film and film["seed"] for film in told] == [row["seed"] for row in rows]
    assert rows[0]["seed"] != rows[1]["seed"]


def test_a_trial_of_a_sweep_can_be_filmed(here) -> None:
    (here / "swept.yaml").write_text(THREE + "sweep: {grid: {robots.0.parameters.speed_cm_s: [1, 4]}}")
    words = ["run", "swept.yaml", "--point", "1", "--trial", "0", "--json", "--film", "t.mp4"]
    (row,) = trials(called(*words))
    assert names(here) == ["swept.yaml", "t.mp4"]
    description = seen("t.mp4")[1]
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
        ("run pair --film t.avi", "--film is t.avi; allowed: a name that ends in .mp4"),
        ("run pair --film t", "--film is t; allowed: a name that ends in .mp4"),
        ("run pair --film .", "--film is .; allowed: a name that ends in .mp4"),
        ("run pair --live --film t.txt", "--film is t.txt; allowed: a name that ends in .mp4"),
        ("run pair --record t.rrd --film t.rrd", "--film is t.rrd; allowed: a name that ends in .mp4"),
        ("run pair --film gone/t.mp4", "gone/t.mp4: cannot be written: there is no directory gone"),
        ("run pair --live --film gone/t.mp4", "gone/t.mp4: cannot be written: there is no directory gone"),
        ("run pair --film folder.mp4", "folder.mp4: cannot be written: is a directory"),
        ("run pair --film pipe.mp4", "pipe.mp4: cannot be written: is no regular file"),
        ("run pair --trials 2 --film several.mp4", "several-1.mp4: cannot be written: is a directory"),
        (f"run pair --film {'x' * 300}.mp4", "File name too long"),
        ("run pair --trace same.mp4 --film same.mp4", "--trace and --film name the same file"),
        ("run swept.yaml --out new --film t.mp4", "a sweep keeps no traces, recordings and films"),
        ("run swept.yaml --film t.mp4", "swept.yaml: holds a sweep of 2 points"),
        ("run particles --film t.mp4", "particles: --trace, --film and --live are for model: embodied"),
        ("run pair --film t.mp4 --set overhead.width_px=321", "overhead.width_px: is 321; allowed: a multiple of 2"),
        ("run pair --film t.mp4 --set overhead.height_cm=12", "overhead.height_cm is 12; allowed: more than 12"),
        ("run gone.yaml --film t.mp4", "gone.yaml"),
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


def no_permission(monkeypatch, folder: str) -> None:
    """Have a folder be closed to this user, even to root."""
    may = os.access
    closed = Path(folder).absolute()
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).absolute() != closed and may(path, mode))


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    "arguments",
    [
        *("run pair --film shut/t.mp4", "track FILM --plot shut/t.png"),
        *("track FILM --rings shut/t.csv", "track FILM --annotate shut/t.mp4"),
    ],
)
def test_a_folder_without_permission_is_refused(shelf, here, monkeypatch, arguments: str) -> None:
    (here / "shut").mkdir()
    no_permission(monkeypatch, "shut")
    given = {"FILM": str(shelf / "swarm.mp4")}
    stderr = refused(*(given.get(word, word) for word in arguments.split()))
    assert "cannot be written: no permission to write in shut" in stderr


# film


def test_a_recording_is_filmed_as_the_trial_was(shelf, here) -> None:
    assert called("film", shelf / "three.rrd", "t.mp4") == ""
    assert names(here) == ["t.mp4"]
    frames, description = seen("t.mp4")
    original, told = seen(shelf / "three.mp4")
    assert description == told
    assert [frame.time_s for frame in frames] == [frame.time_s for frame in original]
    assert max(np.abs(a.picture.astype(int) - b.picture).mean() for a, b in zip(frames, original, strict=True)) < 1


@pytest.mark.usefixtures("here")
def test_settings_change_the_camera_and_nothing_else(shelf) -> None:
    called("film", shelf / "three.rrd", "dark.mp4")
    words = "--set overhead.light=lit --set overhead.width_px=200 --set overhead.frames_per_s=5"
    called("film", shelf / "three.rrd", "lit.mp4", *words.split())
    (dark, told), (lit, changed) = seen("dark.mp4"), seen("lit.mp4")
    assert lit[0].picture.shape == (128, 200, 3)
    assert len(lit) == pytest.approx(len(dark) / 3, abs=1)
    assert lit[0].picture.mean() > 5 * dark[0].picture.mean()
    assert told is not None
    assert changed is not None
    assert changed["overhead"] == told["overhead"] | {"light": "lit", "width_px": 200, "frames_per_s": 5}
    assert {**changed, "overhead": 0} == {**told, "overhead": 0}


def test_a_film_is_written_over_an_older_one(shelf, here) -> None:
    (here / "t.mp4").write_text("older")
    called("film", shelf / "three.rrd", "t.mp4", "--set", "overhead.frames_per_s=1")
    assert seen("t.mp4")[0]
    assert names(here) == ["t.mp4"]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("overhead.light=bright", "overhead.light: is 'bright'; allowed: 'dark' or 'lit'"),
        ("overhead.width_px=321", "overhead.width_px: is 321; allowed: a multiple of 2"),
        ("overhead.height_px=62", "overhead.height_px: is 62; allowed: greater than or equal to 64"),
        ("overhead.width_px=7682", "overhead.width_px: is 7682; allowed: less than or equal to 7680"),
        ("overhead.width_px=wide", "overhead.width_px: is 'wide'; allowed: "),
        ("overhead.width=320", "overhead.width: unknown 'width', did you mean 'width_px'?; allowed: height_cm, "),
        ("overhead.frames_per_s=0", "overhead.frames_per_s: is 0; allowed: greater than or equal to 1"),
        ("overhead.frames_per_s=nan", "overhead.frames_per_s: is 'nan'; allowed: a finite number"),
        ("overhead.exposure_ms=67", "exposure_ms is 67; allowed: up to the time from one frame to the next, 66.67 ms"),
        ("overhead.exposure_ms=40 overhead.frames_per_s=30", "exposure_ms is 40; allowed: up to"),
        ("overhead.bloom=1.5", "overhead.bloom: is 1.5; allowed: less than or equal to 1"),
        ("overhead.noise_levels=-1", "overhead.noise_levels: is -1; allowed: greater than or equal to 0"),
        ("overhead.height_cm=12", "overhead.height_cm is 12; allowed: more than 12"),
        ("overhead.distortion=-0.3 overhead.field_of_view_deg=90", "overhead.distortion is -0.3"),
        ("overhead.light", "--set overhead.light: give it as key=value"),
        ("overhead=lit", "--set overhead=lit: the trial is over; allowed: the camera's keys"),
        ("light=lit", "--set light=lit: the trial is over; allowed: the camera's keys, as in overhead.light=lit"),
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
        ("THREE t.avi", "t.avi: is no name for a film; allowed: names that end in .mp4"),
        ("THREE t", "t: is no name for a film; allowed: names that end in .mp4"),
        ("THREE THREE", "three.rrd: is no name for a film; allowed: names that end in .mp4"),
        ("THREE gone/t.mp4", "gone/t.mp4: cannot be written: there is no directory gone"),
        ("THREE folder.mp4", "folder.mp4: cannot be written: is a directory"),
        ("gone.rrd t.mp4", "gone.rrd: there is no such file"),
        ("folder.mp4 t.mp4", "folder.mp4: is no file"),
        ("FILM t.mp4", "swarm.mp4: is no recording, which ends in .rrd"),
        ("text.rrd t.mp4", "text.rrd: is no "),
        ("empty.rrd t.mp4", "empty.rrd: is no "),
        ("half.rrd t.mp4", "half.rrd: is no whole recording"),
        ("SUMMARY t.mp4", "summary.rrd: holds no poses; record the trial again with --record-level poses or full"),
    ],
)
def test_what_cannot_be_filmed_is_told(shelf, here, arguments: str, message: str) -> None:
    (here / "folder.mp4").mkdir()
    (here / "text.rrd").write_text("mine")
    (here / "empty.rrd").touch()
    shutil.copy(shelf / "three.rrd", here / "half.rrd")
    cut_off(here / "half.rrd", 0.5)
    before = contents(here)
    files = {"THREE": "three.rrd", "FILM": "swarm.mp4", "SUMMARY": "summary.rrd"}
    given = [str(shelf / files[word]) if word in files else word for word in arguments.split()]
    assert message in refused("film", *given)
    assert contents(here) == before


def test_agents_without_rings_are_not_filmed(here) -> None:
    called("run", "particles", "--set", "stop.max_cycles=1", "--record", "t.rrd")
    stderr = refused("film", "t.rrd", "t.mp4")
    assert stderr == "error: t.rrd: model is 'particles', whose agents have no rings; allowed: 'embodied'\n"
    assert names(here) == ["t.rrd"]


# track


def test_what_a_film_tells_is_one_json_object(shelf) -> None:
    found = tracked(shelf / "swarm.mp4")
    assert found.keys() == KEYS
    assert found["film"] == str(shelf / "swarm.mp4")
    assert (found["frames"], found["robots_seen"], found["start_s"]) == (150, ROBOTS, 0)
    assert found["fps"] == pytest.approx(30)
    assert found["duration_s"] == pytest.approx(5)
    assert found["period_s"] == pytest.approx(1, rel=0.01)
    assert found["flash_ms"] == pytest.approx(100, abs=15)
    assert found["t_sync_s"] == pytest.approx(2.55, abs=0.05)
    assert found["t_sync_cycles"] == pytest.approx(found["t_sync_s"] / found["period_s"])
    assert found["flashes_per_period"] == pytest.approx(ROBOTS, rel=0.15)
    assert found["estimated"] == ["period_s", "threshold_ms"]
    assert found["warnings"] == []
    assert "size of the rings" in found["calibration"]


def test_a_table_is_printed_for_people(shelf) -> None:
    lines = called("track", shelf / "swarm.mp4").splitlines()
    cells = dict([cell.strip() for cell in line.split("│")[1:-1]] for line in lines if line.startswith("│"))
    assert lines[0].strip() == str(shelf / "swarm.mp4")
    assert cells["frames"] == "150 at 30 a second"
    assert cells["period"] == "1 s, estimated"
    assert cells["robots seen"].startswith("4 at once, ")
    assert cells["T_sync"].startswith("2.5 cycles, 2.5 s") or cells["T_sync"].startswith("2.6 cycles, 2.6 s")


def test_a_film_of_ours_says_what_the_command_need_not_be_told(shelf) -> None:
    found = tracked(shelf / "described.mp4")
    assert found["calibration"] == "the film's description"
    assert (found["period_s"], found["estimated"]) == (1.0, ["threshold_ms"])
    found = tracked(shelf / "described.mp4", "--period-s", "1.1", "--corners", FLOOR)
    assert (found["calibration"], found["period_s"]) == ("the corners given", 1.1)
    result = call("track", shelf / "described.mp4", "--period-s", "2")
    assert result.stderr.startswith("warning: there were ")
    assert result.stderr.endswith(f" flashes in a period, but there are {ROBOTS} robots\n")
    found = tracked(shelf / "three.mp4")
    assert (found["film"], found["calibration"]) == (str(shelf / "three.mp4"), "the film's description")
    assert (found["period_s"], found["robots_seen"]) == (5, 1)


def test_a_film_that_begins_in_the_light_tells_corners_and_start(shelf) -> None:
    found = tracked(shelf / "lit_start.mp4")
    assert found["calibration"] == "the floor's corners in the lit beginning"
    assert found["start_s"] == pytest.approx(1, abs=0.05)
    assert found["t_sync_s"] == pytest.approx(1.55, abs=0.05)
    assert found["duration_s"] == pytest.approx(4, abs=0.1)


def test_files_are_written_beside_the_film_which_stays_as_it_is(shelf, here) -> None:
    put(here, shelf / "swarm.mp4")
    before = (here / "swarm.mp4").read_bytes()
    words = "--plot p.png --rings r.csv --annotate a.mp4"
    assert tracked("swarm.mp4", *words.split()) == tracked("swarm.mp4")
    assert names(here) == ["a.mp4", "p.csv", "p.png", "r.csv", "swarm.mp4"]
    assert (here / "swarm.mp4").read_bytes() == before

    figure = cv2.imread("p.png")
    assert figure is not None
    assert figure.std() > 10
    with (here / "p.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [*rows[0]] == ["time_s", "cycles", "count", "spread_ms"]
    assert min(float(row["spread_ms"]) for row in rows) < 40

    rings = read_rings(here / "r.csv")
    assert [*rings[0]] == ["time_s", "x_cm", "y_cm", "radius_cm", "x_px", "y_px", "radius_px"]
    at_cm = np.array([(ring["x_cm"], ring["y_cm"]) for ring in rings])
    off_cm = np.linalg.norm(at_cm[:, None] - PLACES[:ROBOTS], axis=2).min(axis=1)
    assert np.median(off_cm) < 0.5
    assert max(ring["time_s"] for ring in rings) > 4.5

    (frames, _), (annotated, told) = seen("swarm.mp4"), seen("a.mp4")
    assert [frame.time_s for frame in annotated] == pytest.approx([frame.time_s for frame in frames], abs=1e-4)
    assert annotated[0].picture.shape[0] > frames[0].picture.shape[0]
    assert annotated[0].picture.shape[1] == frames[0].picture.shape[1]
    assert told is None  # it is no film that a camera took


def test_options_say_what_is_known(shelf) -> None:
    film = shelf / "swarm.mp4"
    assert tracked(film, "--period-s", "1")["estimated"] == ["threshold_ms"]
    strict = tracked(film, "--threshold-ms", "5")
    assert (strict["threshold_ms"], strict["t_sync_s"], strict["t_sync_cycles"]) == (5, None, None)
    assert strict["estimated"] == ["period_s"]
    loose, tight = (tracked(film, "--order-parameter", order)["threshold_ms"] for order in ("0.8", "0.99"))
    assert loose > 2 * tight
    assert tracked(film, "--robots", str(ROBOTS)) == tracked(film)


def test_geometry_that_is_given_places_the_rings(shelf, here) -> None:
    film = shelf / "swarm.mp4"
    assert tracked(film, "--corners", FLOOR, "--rings", "c.csv")["calibration"] == "the corners given"
    called("track", film, "--rings", "r.csv", "--arena-cm", "60x60", "--height-cm", "110")
    called("track", film, "--rings", "w.csv", "--arena-cm", "80x60", "--height-cm", "110")
    corners, rings, wide = (read_rings(here / name) for name in ("c.csv", "r.csv", "w.csv"))
    assert len(corners) == len(rings) == len(wide)
    for there, here_, aside in zip(corners, rings, wide, strict=True):
        assert there["x_cm"] == pytest.approx(here_["x_cm"], abs=1.5)
        assert aside["x_cm"] == pytest.approx(here_["x_cm"] + 10, abs=0.05)
        assert aside["y_cm"] == pytest.approx(here_["y_cm"], abs=0.05)


@pytest.mark.parametrize("gap", ["", " "])
def test_corners_may_come_in_any_order_and_with_spaces(shelf, gap: str) -> None:
    turned = ",".join((FLOOR.split(",") * 2)[4:12])
    given = turned.replace(",", f",{gap}")
    expected = tracked(shelf / "swarm.mp4", "--corners", FLOOR)
    assert tracked(shelf / "swarm.mp4", "--corners", given) == expected


@pytest.mark.usefixtures("here")
def test_numbered_pictures_are_tracked_and_their_rate_is_doubted(shelf) -> None:
    for number, frame in enumerate(seen(shelf / "swarm.mp4")[0]):
        cv2.imwrite(f"frame_{number:04d}.png", frame.picture[..., ::-1])
    result = call("track", "frame_%04d.png", "--json")
    assert result.exit_code == 0
    assert result.stderr.startswith("warning: numbered pictures have no times: 25 a second are assumed")
    found = json.loads(result.stdout)
    assert (found["frames"], found["robots_seen"]) == (150, ROBOTS)
    assert found["warnings"] == [result.stderr.removeprefix("warning: ").strip()]


@pytest.mark.parametrize(
    ("robots", "warning"),
    [
        (3, "4 rings were lit at once, but there are 3 robots"),
        (5, "the swarm is synchronised, but no more than 4 rings were lit at once, of 5 robots"),
        (4, ""),
    ],
)
def test_a_wrong_number_of_robots_is_a_warning(shelf, robots: int, warning: str) -> None:
    for form in ([], ["--json"]):
        result = call("track", shelf / "swarm.mp4", "--robots", robots, *form)
        assert result.exit_code == 0
        assert result.stderr.startswith(f"warning: {warning}" if warning else "")
        assert result.stderr.count("\n") == bool(warning)
        assert result.stdout


def test_a_film_that_was_cut_off_is_tracked_to_where_it_ends(shelf, here) -> None:
    put(here, shelf / "swarm.mp4")
    cut_off(here / "swarm.mp4", 0.8)
    result = call("track", "swarm.mp4", "--json", "--period-s", "1")
    assert result.exit_code == 0
    assert result.stderr.startswith("warning: the film ends early: ")
    assert " of 5.0 s could be read; the file was cut off" in result.stderr
    assert json.loads(result.stdout)["frames"] < 150


class Camera:
    """Stands for one that is plugged in; gives the frames of a film, and then is unplugged."""

    def __init__(self, film: Film, name: str) -> None:
        self.name, self.width_px, self.height_px = name, film.width_px, film.height_px
        self._film = film

    def frames(self) -> Iterator[Frame]:
        return self._film.frames()


def test_a_camera_is_tracked_until_the_swarm_is_synchronised(shelf, here, monkeypatch) -> None:
    class Plugged:
        def __init__(self, number: int) -> None:
            self._opened = open_film(str(shelf / "swarm.mp4"))
            self._number = number

        def __enter__(self) -> Camera:
            return Camera(self._opened.__enter__(), f"camera {self._number}")

        def __exit__(self, *error: Any) -> None:
            self._opened.__exit__(*error)

    monkeypatch.setattr(tracking, "LiveCamera", Plugged)
    words = "track --camera 1 --period-s 1 --threshold-ms 40 --json --plot p.png --rings r.csv --annotate a.mp4"
    found = json.loads(called(*words.split()))
    assert found.keys() == KEYS
    assert (found["film"], found["period_s"], found["estimated"]) == ("camera 1", 1, [])
    assert found["start_s"] + found["t_sync_s"] == pytest.approx(2.55, abs=0.05)
    assert found["frames"] < 100  # half a period later
    assert names(here) == ["a.mp4", "p.csv", "p.png", "r.csv"]


# Mistakes of track


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("", "give either a film or --camera NUMBER"),
        ("FILM --camera 0", "give either a film or --camera NUMBER"),
        ("--camera 0", "--camera needs --period-s"),
        ("FILM --threshold-ms 100 --order-parameter 0.9", "--threshold-ms and --order-parameter exclude each other"),
        *(
            (f"FILM --arena-cm {text}", f"--arena-cm is {text}; allowed: a side of 1 ")
            for text in ("x", "60x", "x60", "60X60", "0", "-60", "60x60x60", "nan", "inf")
        ),
        *(
            (f"FILM --corners {text}", f"--corners is {text}; allowed: four corners in pixels, such as 10,12,")
            for text in ("x", "1,2,3", "1,2,3,4,5,6,7,x", "1,2,3,4,5,6,7,-8", "1,2,3,4,5,6,7,8,9", "1;2;3;4;5;6;7;8")
        ),
        ("FILM --plot gone/p.png", "gone/p.png: cannot be written: there is no directory gone"),
        ("FILM --rings gone/r.csv", "gone/r.csv: cannot be written: there is no directory gone"),
        ("FILM --annotate gone/a.mp4", "gone/a.mp4: cannot be written: there is no directory gone"),
        ("--camera 0 --period-s 5 --annotate gone/a.mp4", "gone/a.mp4: cannot be written"),
        ("FILM --plot p.pdf", "--plot is p.pdf; allowed: a name that ends in .png"),
        ("FILM --rings r.txt", "--rings is r.txt; allowed: a name that ends in .csv"),
        ("FILM --annotate a.avi", "--annotate is a.avi; allowed: a name that ends in .mp4"),
        ("FILM --annotate a", "--annotate is a; allowed: a name that ends in .mp4"),
        ("FILM --plot folder.png", "folder.png: cannot be written: is a directory"),
        ("FILM --plot taken.png", "taken.csv: cannot be written: is a directory"),
        ("FILM --rings taken.csv", "taken.csv: cannot be written: is a directory"),
        ("FILM --annotate FILM", "allowed: another name, for "),
        ("FILM --annotate link.mp4", "--annotate is link.mp4; allowed: another name, for link.mp4 is of the film"),
        ("FILM --rings x.csv --plot x.png", "--rings is x.csv; allowed: another name, for x.csv is of --plot"),
        ("FILM --rings folder.png/../x.csv --plot x.png", "allowed: another name"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2_before_the_film_is_read(
    shelf, here, arguments: str, message: str
) -> None:
    for name in ("folder.png", "taken.csv"):
        (here / name).mkdir()
    (here / "link.mp4").symlink_to(shelf / "swarm.mp4")
    before = contents(here)
    assert message in refused("track", *(str(shelf / "swarm.mp4") if w == "FILM" else w for w in arguments.split()))
    assert contents(here) == before


@pytest.mark.parametrize(
    ("film", "message"),
    [
        ("gone.mp4", "gone.mp4: no such file; allowed: a film, pictures numbered from 0 to 4 on"),
        ("frames_%04d.png", "frames_%04d.png: no such file; allowed: a film, pictures numbered"),
        ("text.mp4", "text.mp4: cannot be read as a film: "),
        ("text.txt", "text.txt: "),
        ("empty.mp4", "empty.mp4: is empty: nothing was recorded, or the copy failed"),
        ("folder", "folder: is a directory; give a film in it, or numbered pictures such as folder/frames_%04d.png"),
        ("sound.wav", "sound.wav: holds no moving pictures, only audio; give the film itself"),
        ("headless.mp4", "headless.mp4: was cut off before its recording was finished"),
        ("three.rrd", "three.rrd: cannot be read as a film: "),
        (
            "dark.mp4",
            "dark.mp4: no lit ring is seen; is it the right film, are the rings red",
        ),
        ("lit.mp4", "lit.mp4: no lit ring is seen"),
        ("nowhere://film", "nowhere://film: cannot be read as a film: Protocol not found"),
    ],
)
@pytest.mark.parametrize("options", ["", "--json --plot p.png --annotate a.mp4"])
def test_what_is_no_film_of_a_swarm_is_told(shelf, here, film: str, message: str, options: str) -> None:
    put(here, shelf / "dark.mp4", shelf / "lit.mp4", shelf / "three.rrd")
    for name in ("text.mp4", "text.txt"):
        (here / name).write_text("a text, and not a short one\n" * 40)
    (here / "empty.mp4").touch()
    (here / "folder").mkdir()
    write_sound(here / "sound.wav")
    cut_off(write_film(here / "headless.mp4", range(0, 90_000, 6000), MP4))
    before = contents(here)
    assert message in refused("track", film, *options.split())
    assert contents(here) == before


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--corners 10,10,150,10,60,60,10,150", "these are not the corners of a convex quadrilateral"),
        ("--corners 10,10,10,10,10,10,10,10", "these are not the corners of a convex quadrilateral"),
        ("--corners 10,10,230,10,230,240,10,230", "a corner is outside of the picture; allowed: columns from 0 to 239"),
        ("--corners 10,10,20,10,20,20,10,20", "the shortest side is 10 px; allowed: at least 24 px"),
    ],
)
def test_corners_where_no_floor_can_be_are_refused(shelf, here, options: str, message: str) -> None:
    stderr = refused("track", shelf / "swarm.mp4", *options.split(), "--rings", "r.csv")
    assert stderr.startswith("error: --corners 10,10 ")
    assert message in stderr
    assert names(here) == []


def test_a_period_that_the_film_does_not_tell_has_to_be_given(shelf, here) -> None:
    frames = seen(shelf / "swarm.mp4")[0]
    save(here / "short.mp4", frames[60:90])
    stderr = refused("track", "short.mp4", "--plot", "p.png", "--rings", "r.csv", "--annotate", "a.mp4")
    assert stderr.startswith("error: short.mp4: the period cannot be told from 0.967 s of film")
    assert stderr.endswith("give --period-s\n")
    assert tracked("short.mp4", "--period-s", "1")["period_s"] == 1


def test_a_camera_that_is_not_there_is_told(here) -> None:
    stderr = refused("track", "--camera", "77", "--period-s", "5", "--rings", "r.csv")
    assert stderr.startswith("error: camera 77 cannot be opened; allowed: the number of a camera that is plugged in")
    assert names(here) == []


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    "option",
    [
        *("--camera=-1", "--camera=x", "--robots=0", "--robots=2.5", "--order-parameter=0.4", "--order-parameter=1.1"),
        *("--period-s=0", "--period-s=-5", "--period-s=inf", "--period-s=nan", "--period-s=x"),
        *("--threshold-ms=0", "--threshold-ms=inf", "--threshold-ms=nan", "--order-parameter=nan"),
        *("--height-cm=4", "--height-cm=0", "--height-cm=inf", "--height-cm=nan", "--nothing"),
    ],
)
def test_what_is_no_value_is_named(shelf, here, option: str) -> None:
    result = call("track", shelf / "swarm.mp4", option)
    assert (result.exit_code, result.stdout) == (2, "")
    assert option.split("=", maxsplit=1)[0] in result.stderr
    assert "Usage: " in result.stderr
    assert "Traceback" not in result.stderr
    assert names(here) == []


# Processes


def test_help_loads_nothing_that_takes_a_while() -> None:
    script = (
        "import sys\nfrom epuck_sim.cli import app\n"
        "for words in (['--help'], ['film', '--help'], ['track', '--help'], ['run', '--help']):\n"
        "    try: app(words)\n    except SystemExit as end: assert not end.code\n"
        "    heavy = {'av', 'cv2', 'numpy', 'scipy', 'numba', 'matplotlib', 'rerun', 'rerun_sdk', 'pymunk'}\n"
        "    print('loaded', sorted(heavy & sys.modules.keys()))"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    told = [line for line in result.stdout.splitlines() if line.startswith("loaded")]
    assert told == ["loaded []"] * 4


@pytest.mark.parametrize(
    ("arguments", "begun"),
    [
        ("track long.mkv --rings r.csv", "r.csv.part"),
        ("track short.mkv --period-s 1 --annotate a.mp4", "a.mp4.part"),
        ("film three.rrd t.mp4 --set overhead.width_px=1000 --set overhead.height_px=1000", "t.mp4.part"),
    ],
)
def test_ctrl_c_leaves_nothing_half_written(shelf, here, arguments: str, begun: str) -> None:
    put(here, shelf / "three.rrd")
    save_long(here / "long.mkv", 1000)
    save_long(here / "short.mkv", 20)
    before = names(here)
    process = subprocess.Popen(
        [*COMMAND, *arguments.split()],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        wait_until(lambda: (here / begun).exists() or process.poll() is not None, 120)
        os.killpg(process.pid, signal.SIGINT)
        stdout, stderr = process.communicate(timeout=60)
    finally:
        process.kill()
    assert (process.returncode, stderr) == (130, "interrupted\n")
    assert bool(stdout) == ("--annotate" in arguments)  # what was found is told before it is drawn
    assert names(here) == before
