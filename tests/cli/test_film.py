"""Films, by `run --film`, `film`, `compare-film` and `track`: options, what is written and told, how mistakes end."""

import json
import os
import shutil
import signal
import time
from contextlib import nullcontext
from functools import partial
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import ANY, Mock

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from rich.console import Console

from epuck_sim import Simulation, film_trial, load_scenario, read_recording
from epuck_sim.cli import errors
from epuck_sim.cli.films import parse_arena, parse_corners, progress_bar
from epuck_sim.cli.tables import NAMES_WIDTH, print_track
from epuck_sim.overhead import live, track
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.film import open_film
from tests.cli.commands import call, called, names, refused, set_to, trials
from tests.cli.test_help import LOADED
from tests.overhead import films
from tests.overhead.films import PLACES, TRACK, even, frames_and_description, in_step, read_rings, save, shoot
from tests.processes import COMMAND, start, wait_until
from tests.runs.made_folders import rows

THREE = """
name: three
arena: {width_cm: 40, height_cm: 40}
robots: [{count: 3, controller: firefly}]
stop: {max_cycles: 2}
overhead: {width_px: 160, height_px: 128}
"""

POSES = ("--record-level", "poses")  # to compile what records cameras takes a while


@pytest.fixture(scope="module")
def three(tmp_path_factory) -> Path:
    """Return a folder of a trial's scenario, film and recordings that no test changes."""
    folder = tmp_path_factory.mktemp("three")
    (folder / "three.yaml").write_text(THREE)
    run = "run", folder / "three.yaml"
    called(*run, "--record", folder / "three.rrd", *POSES, "--film", folder / "three.mp4")
    called(*run, "--record", folder / "summary.rrd", "--record-level", "summary")
    return folder


def test_several_trials_are_the_same_filmed_recorded_and_traced_into_files_of_their_own(three, here) -> None:
    command = ["run", three / "three.yaml", "--trials", "2", "--seed", "7", "--json"]
    ran = trials(called(*command, "--film", "t.mp4", "--record", "t.rrd", *POSES, "--trace", "t.parquet"))
    assert ran == trials(called(*command))
    assert names(here) == sorted(f"t-{trial}.{kind}" for trial in (0, 1) for kind in ("mp4", "rrd", "parquet"))
    assert ran[0]["seed"] != ran[1]["seed"]
    for trial, row in enumerate(ran):
        description, recorded = frames_and_description(f"t-{trial}.mp4")[1], read_recording(here / f"t-{trial}.rrd")
        assert description["seed"] == recorded.seed == row["seed"]
        table = pq.read_table(f"t-{trial}.parquet")
        traced = np.column_stack([table["x_cm"], table["y_cm"]]).astype(np.float32)
        np.testing.assert_array_equal(recorded.positions.reshape(-1, 2), traced)
        assert len(recorded.time_s) == row["steps"]
    said = called("run", "pair", "--trials", "2", "--record", "n.rrd", *POSES, "--set", "stop.max_cycles=2")
    assert said.endswith("n-0.rrd\nn-1.rrd\n")


def test_a_recording_is_filmed_as_the_trial_was_and_settings_change_the_camera_and_nothing_else(three, here) -> None:
    assert called("film", three / "three.rrd", "t.mp4") == ""
    assert names(here) == ["t.mp4"]
    frames, description = frames_and_description("t.mp4")
    original, described = frames_and_description(three / "three.mp4")
    assert description == described
    assert [frame.time_s for frame in frames] == [frame.time_s for frame in original]
    assert max(np.abs(a.picture.astype(int) - b.picture).mean() for a, b in zip(frames, original, strict=True)) < 1
    words = "--set overhead.light=lit --set overhead.width_px=200 --set overhead.frames_per_s=5"
    called("film", three / "three.rrd", "lit.mp4", *words.split())
    lit, changed = frames_and_description("lit.mp4")
    assert lit[0].picture.shape == (128, 200, 3)
    assert len(lit) == pytest.approx(len(frames) / 3, abs=1)
    assert lit[0].picture.mean() > 5 * frames[0].picture.mean()
    assert changed["overhead"] == described["overhead"] | {"light": "lit", "width_px": 200, "frames_per_s": 5}
    assert {**changed, "overhead": 0} == {**described, "overhead": 0}


SETTINGS = ["count=4", "speed_cm_s=1.5", "period_s=2.0", "overhead.width_px=160", "overhead.height_px=160"]


@pytest.fixture(scope="module")
def film(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("films") / "swarm.mp4"
    scenario = load_scenario("thesis", SETTINGS)
    with film_trial(path, scenario, seed=1) as observe:
        for step in islice(Simulation(scenario, seed=1), 121):
            observe(step, SimpleNamespace(cycles=0, order_parameter=None))
    return path


def test_a_film_is_shown_beside_trials_and_fitted(film, here) -> None:
    words = ["compare-film", film, "thesis", *set_to(*SETTINGS), "--trials", 3]
    result = call(*words, "--json", "--plot", "b.png", "--fit", "lab.yaml")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert (found["film"], found["scenario"], found["period_s"]) == (str(film), "thesis", 2)
    quantities = {each["name"]: each for each in found["quantities"]}
    speed = quantities["speed straight ahead"]
    assert speed["film"] == pytest.approx(1.5, rel=0.06)
    assert speed["trials"] == pytest.approx([1.5] * 3, rel=0.05)
    fitted = found["fitted"]["robots.0.parameters.speed_cm_s"]
    assert fitted["low"] <= 1.5 <= fitted["high"]
    assert names(here) == ["b.csv", "b.png", "lab.yaml"]
    read = rows(here / "b.csv")
    assert [row["trial"] for row in read[:4]] == ["film", "0", "1", "2"]
    assert len(read) == 4 * len(quantities)
    t_sync = quantities["T_sync"]
    statuses = [row["status"] for row in read if row["quantity"] == "T_sync"]
    assert (statuses[0] == "beyond") == t_sync["film_is_beyond"]
    assert [statuses[1:].count(status) for status in ("beyond", "unknown")] == [t_sync["beyond"], t_sync["unknown"]]
    assert "epuck_sim" in found["versions"]
    lab = load_scenario("lab.yaml")
    assert lab.robots[0].parameters["speed_cm_s"] == pytest.approx(fitted["value"], abs=1e-5)
    printed = call(*words).stdout
    too_few = "3 trials are too few to tell whether the film is like them; give --trials 19 or more.\n\n"
    assert printed.startswith(too_few)
    assert f"{film}, with a period of 2 s, beside trials of thesis" in printed
    assert all(said in printed for said in ("speed straight ahead", "A film does not show coupling", "wheels' noise"))
    assert "commands" not in called("run", "lab.yaml", "--set", "stop.max_cycles=2", "--json")


def test_a_film_without_a_description_has_floor_period_and_robots_of_the_scenario(film, here) -> None:
    save(here / "bare.mp4", frames_and_description(film)[0])
    wide = ["robots=[{count: 2, parameters: {speed_cm_s: 1.5, period_s: 2}}, {count: 2}]", "arena.width_cm=90"]
    words = ["--period-s", 2, "--trials", 1, *set_to(*wide)]
    bare = call("compare-film", "bare.mp4", "thesis", *words)
    assert (bare.exit_code, "warning: the film's floor" in bare.stderr) == (0, False), bare.stderr
    other = [*set_to(*SETTINGS), "--set", "robots.0.parameters.period_s=10", "--trials", 1]
    slow = call("compare-film", "bare.mp4", "thesis", *other)
    assert "flashes per period, but there are 4 robots: check --robots, --period-s, --fps" in slow.stderr
    assert "1 unknown" in slow.stdout
    fast = json.loads(call("compare-film", "bare.mp4", "thesis", *words, "--fps", 30, "--json").stdout)
    (speed,) = (each["film"] for each in fast["quantities"] if each["unit"] == "cm/s")
    assert speed == pytest.approx(3, rel=0.06)
    described = call("compare-film", film, "thesis", *words, "--set", "robots.1.count=1")
    assert described.exit_code == 0, described.stderr
    assert "warning: the film shows 4 robots, thesis has 3" in described.stderr
    assert "warning: the film's floor is 60 x 60 cm, that of thesis 90 x 60 cm" in described.stderr


SIDE_PX = 160
FPS = 20
SIZE = {"width_px": SIDE_PX, "height_px": SIDE_PX, "frames_per_s": FPS}
TIMES = even(3.6, FPS)
ROBOTS = 4
FLOOR = "5,5,154,5,154,154,5,154"  # about where its corners are in the films
KEYS = {  # of the JSON object that `track` prints
    *("film", "frames", "fps", "duration_s", "start_s", "calibration", "period_s", "flash_ms", "threshold_ms"),
    *("estimated", "robots_seen", "flashes_per_period", "histogram_s", "histogram_periods", "t_sync_cycles"),
    *("versions", "confidence", "reasons", "rings_outside", "always_lit", "position_error_mm"),
    *("t_sync_s", "t_sync_periods", "warnings"),
}


def tracked(film: str | Path, *options: str | Path) -> dict[str, Any]:
    """Return the object that `track` prints of a film about which it has nothing to complain of."""
    return json.loads(called("track", film, "--json", *options))


@pytest.fixture(scope="module")
def shelf(tmp_path_factory) -> Path:
    """Return a folder of films that no test changes, of robots that flash together from 2 s on."""
    folder = tmp_path_factory.mktemp("shelf")
    frames = shoot(TIMES, in_step(TIMES, ROBOTS), **SIZE)
    save(folder / "swarm.mp4", frames)
    save(folder / "described.mp4", frames[:60], films.described(**SIZE) | {"robots": ROBOTS})
    return folder


@pytest.fixture(scope="module")
def plain(shelf) -> dict[str, Any]:
    return tracked(shelf / "swarm.mp4")


def test_the_result_is_one_json_object_and_options_say_what_is_known(shelf, plain) -> None:
    assert plain.keys() == KEYS
    film = shelf / "swarm.mp4"
    assert plain["film"] == str(film)
    assert (plain["frames"], plain["robots_seen"], plain["start_s"]) == (len(TIMES), ROBOTS, 0)
    assert plain["histogram_s"] == pytest.approx(2.55, abs=0.05)
    assert (plain["estimated"], plain["warnings"]) == (["period_s", "threshold_ms"], [])
    assert "size and shape of the rings" in plain["calibration"]
    words = "--period-s 1 --threshold-ms 5 --order-parameter 1"
    strict = json.loads(call("track", film, "--json", *words.split()).stdout)
    assert (strict["threshold_ms"], strict["histogram_s"], strict["histogram_periods"]) == (5, None, None)
    assert (strict["estimated"], strict["t_sync_s"]) == ([], None)  # r < 1
    assert tracked(film, "--robots", str(ROBOTS)) == plain


def test_the_description_of_our_films_replaces_options_and_geometry_that_is_given_places_the_rings(shelf, here) -> None:
    found = tracked(shelf / "described.mp4")
    assert found["calibration"] == "the film's description"
    assert (found["period_s"], found["estimated"]) == (1.0, ["threshold_ms"])
    result = call("track", shelf / "described.mp4", "--period-s", "2.2", "--corners", FLOOR)
    said = f"but there are {ROBOTS} robots: check --robots, --period-s, --fps"
    assert " ".join(result.stdout.split()).count(said) == 1  # once
    assert "geometry from              the corners given" in result.stdout
    assert result.stderr == "warning: --period-s is 2.2, but the film's description says 1\n"
    assert max(map(len, result.stdout.splitlines()[1:])) <= 80  # though this is no terminal
    film = shelf / "swarm.mp4"
    assert tracked(film, "--corners", FLOOR, "--rings", "c.csv")["calibration"] == "the corners given"
    called("track", film, "--rings", "w.csv", "--arena-cm", "80x60", "--height-cm", "110")
    corners, wide = (read_rings(here / name) for name in ("c.csv", "w.csv"))
    for there, aside in zip(corners, wide, strict=True):
        assert aside["x_cm"] == pytest.approx(there["x_cm"] + 10, abs=1.5)
        assert aside["y_cm"] == pytest.approx(there["y_cm"], abs=1.5)


def test_a_film_is_tracked_and_drawn_without_numba_and_pymunk(shelf, here) -> None:
    script = LOADED.format(table=[(f"track {shelf / 'swarm.mp4'} --plot {here / 'p.png'}", ["numba", "pymunk"])])
    output, _ = start([COMMAND[0], "-c", script]).communicate()
    assert output.splitlines()[-1] == "loaded []"


def test_files_are_written_beside_the_film_which_stays_as_it_is(shelf, plain, here) -> None:
    shutil.copy(shelf / "swarm.mp4", here)
    before = (here / "swarm.mp4").read_bytes()
    words = "--plot p.png --rings r.csv --annotate a.mp4"
    assert tracked("swarm.mp4", *words.split()) == plain | {"film": "swarm.mp4"}
    assert names(here) == ["a.mp4", "p.csv", "p.png", "r.csv", "swarm.mp4"]
    assert (here / "swarm.mp4").read_bytes() == before
    spreads = rows(here / "p.csv")
    assert [*spreads[0]] == ["time_s", "periods", "count", "spread_ms"]
    assert min(float(row["spread_ms"]) for row in spreads) < 40
    rings = read_rings(here / "r.csv")
    assert [*rings[0]] == ["time_s", "x_cm", "y_cm", "radius_cm", "x_px", "y_px", "radius_px", "light"]
    at_cm = np.array([(ring["x_cm"], ring["y_cm"]) for ring in rings])
    off_cm = np.linalg.norm(at_cm[:, None] - PLACES[:ROBOTS], axis=2).min(axis=1)
    assert np.median(off_cm) < 0.9  # two pixels: nothing but the rings' size tells the scale
    assert max(ring["time_s"] for ring in rings) > 2.5
    annotated, description = frames_and_description("a.mp4")
    assert [frame.time_s for frame in annotated] == pytest.approx(TIMES, abs=1e-4)
    assert annotated[0].picture.shape[0] > annotated[0].picture.shape[1] == SIDE_PX
    assert description is None  # it is no film that a camera took


def test_who_is_who_is_told_by_motion_or_tags_in_tables_and_in_the_summary(shelf, here) -> None:
    found = tracked(shelf / "swarm.mp4", *["--flashes", "f.csv", "--trace", "t.parquet", "--pairs", "p.csv"])
    assert found.keys() == KEYS | {"identities"}
    told = [found["identities"][name] for name in ("by", "robots", "pairs_together")]
    assert told == ["motion", [*range(ROBOTS)], ROBOTS * (ROBOTS - 1) // 2]
    assert names(here) == ["f.csv", "p.csv", "t.parquet"]
    flashes = read_rings(here / "f.csv", unknown=-1)
    places = {(flash["robot"], round(flash["x_cm"])) for flash in flashes}
    assert len(places) == len({robot for robot, _ in places}) == ROBOTS  # they stand still
    lines = called("track", shelf / "swarm.mp4", "--pairs", "p.csv").splitlines()
    cells = {line[:NAMES_WIDTH].strip(): line[NAMES_WIDTH:] for line in lines[1:]}
    assert lines[0].strip() == str(shelf / "swarm.mp4")
    assert (cells["frames"], cells["period"]) == ("72 at 20 per second", "1 s, estimated")
    assert (cells["T_sync"], cells["robots by motion"]) == ("3 cycles, 2.5 s", str(ROBOTS))
    overhead = {"width_px": 320, "height_px": 320, "frames_per_s": FPS, "ambient": 0.2, "tags": "4X4_50", "tag_cm": 5}
    times = even(2.3, FPS)
    frames = shoot(times, in_step(times, ROBOTS), **overhead)[3:]
    save(here / "tagged.mp4", frames, films.described(**overhead) | {"robots": ROBOTS})
    result = call("track", "tagged.mp4", "--json", "--tags", f"4X4_50:0-{ROBOTS - 1}", "--trace", "trace.csv")
    assert result.stderr == ""  # white paper is no light
    found = json.loads(result.stdout)
    assert (found["identities"]["by"], found["identities"]["robots"]) == ("tags", [*range(ROBOTS)])
    assert found["identities"]["warnings"] == []
    for row in rows(here / "trace.csv")[ROBOTS : -ROBOTS * 5]:
        assert np.hypot(*(PLACES[int(row["robot"])] - (float(row["x_cm"]), float(row["y_cm"])))) < 0.5
        assert abs(float(row["heading_rad"])) < 0.15
    assert "no tag is read, or all are seen twice; check" in refused("track", "tagged.mp4", "--tags", "5X5_50")


@pytest.mark.usefixtures("figures_noted")
def test_a_camera_is_tracked_until_the_swarm_is_synchronised(shelf, here, monkeypatch) -> None:
    words = "--period-s 1 --threshold-ms 40 --plot p.png --rings r.csv --annotate a.mp4 --record raw.mp4"
    with open_film(str(shelf / "swarm.mp4")) as film:
        film.name = "camera 1"
        monkeypatch.setattr(live, "LiveCamera", Mock(return_value=nullcontext(film)))
        found = tracked("--camera=1", *words.split())
    live.LiveCamera.assert_called_once_with(1, ANY)
    assert found.keys() == KEYS
    assert (found["film"], found["period_s"], found["estimated"]) == ("camera 1", 1, [])
    assert found["start_s"] + found["histogram_s"] == pytest.approx(2.55, abs=0.05)
    assert names(here) == ["a.mp4", "p.csv", "p.png", "r.csv", "raw.mp4"]


def test_where_nobody_may_write_it_is_said_before_a_film_is_read(shelf, here, monkeypatch) -> None:
    (here / "shut").mkdir()
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "shut" and may(path, mode))  # even of root
    monkeypatch.setattr(track, "open_film", lambda *_: pytest.fail("it ran"))
    stderr = refused("track", shelf / "swarm.mp4", "--rings", "shut/t.csv")
    assert "cannot be written: no permission to write in shut" in stderr


def test_ctrl_c_leaves_nothing_half_written(here) -> None:
    second = even(1)
    frames = shoot(second, in_step(second, ROBOTS), **SIZE)
    pictures = [cv2.imencode(".jpg", frame.picture[..., ::-1])[1].tobytes() for frame in frames]
    (here / "long.mjpeg").write_bytes(b"".join(pictures) * 1000)
    process = start([*COMMAND, "track", "long.mjpeg", "--rings", "r.csv", "--annotate", "a.mp4", "--plot", "p.png"])
    wait_until(lambda: any(here.glob("r.csv.*.part")) or process.poll() is not None, 120)
    os.killpg(process.pid, signal.SIGINT)
    stdout, stderr = process.communicate(timeout=300)
    assert (process.returncode, stdout, stderr) == (130, "", "interrupted\n")
    assert names(here) == ["long.mjpeg"]


def test_sides_of_an_arena_and_corners_are_read() -> None:
    for text, sides in (("60", (60, 60)), (" 60 x 100.5 ", (60, 100.5)), ("1000000x1", (1e6, 1))):
        assert parse_arena(text) == sides
    assert parse_corners("0,1.5, -2,.25,999.9,4,5 ,6") == ((0, 1.5), (-2, 0.25), (999.9, 4), (5, 6))


def test_t_sync_comes_first_the_table_fits_a_screen_and_the_name_of_a_film_is_no_markup(monkeypatch, capsys) -> None:
    monkeypatch.setattr("epuck_sim.cli.tables.terminal_width", lambda: 80)
    doubts = ("rings are missed, or something shines; give --corners, --arena-cm", "is it 2 s? give --period-s")
    print_track(TRACK._replace(warnings=doubts, confidence="low"))
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ["T_sync", "4", "cycles,", "2.5", "s"]
    assert "low; --corners, --arena-cm, --period-s may settle it" in lines[2]
    assert len(lines) <= 20
    assert max(map(len, lines)) <= 80
    print_track(TRACK._replace(film="[bold]swarm[/bold] [/].mp4", t_sync_s=None, histogram_s=None, estimated=()))
    text = capsys.readouterr().out
    assert all(said in text for said in ("[bold]swarm[/bold] [/].mp4", "never"))
    assert not any(said in text for said in ("by the histogram", "estimated"))


@pytest.mark.parametrize("is_terminal", [True, False])
def test_frames_are_passed_on_as_they_come(is_terminal: bool, monkeypatch, capsys) -> None:
    monkeypatch.setattr("rich.console.Console", partial(Console, force_terminal=is_terminal))
    monkeypatch.setattr(errors, "SLOW_S", 0.05)
    film = [Frame(number / 2, np.zeros((2, 2, 3), np.uint8)) for number in range(5)]
    frames = iter(film)
    passed = progress_bar("tracking")(frames, 2.0)
    assert next(iter(passed)) is film[0]
    assert next(frames) is film[1]  # one at a time
    time.sleep(0.3)
    assert list(passed) == film[2:]
    shown = capsys.readouterr()
    assert shown.out == ""
    assert ("2 s of film" in shown.err) == is_terminal
    assert ("tracking takes a while; Ctrl-C ends it" in shown.err) == (not is_terminal)
