"""The command line of recordings: trials recorded, recorded again, shown and drawn, and how mistakes end."""

import os
import re
import shutil
import signal
import socket
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import ANY, Mock, call as method

import pytest

from epuck_sim import RecordingError, Simulation, Step, points, read_recording, record
from epuck_sim.embodied.changes import replacement
from epuck_sim.recording import Level, viewer
from epuck_sim.recording.viewer import sleep
from epuck_sim.runs.reader import read_outcome
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.util import machine
from tests.cli.commands import call, called, cells, contents, refused, trials
from tests.control.bench import with_step
from tests.processes import COMMAND, start, wait_until
from tests.runs.made_folders import SPEED, edit, sweep

ADDRESS = "http://127.0.0.1"


def check_is(path: Path, swept: Path, point: int, trial: int):
    chosen, recorded = points(load_scenario(swept))[point], read_recording(path)
    assert (recorded.scenario, recorded.seed) == (load_scenario(chosen.scenario), chosen.seed(trial))
    return recorded


@pytest.fixture(scope="module")
def pair(tmp_path_factory) -> Path:
    """Return a recording that no test changes."""
    path = tmp_path_factory.mktemp("pair") / "pair.rrd"
    called("run", "pair", "--record", path)
    return path


@pytest.fixture(scope="module")
def swept(tmp_path_factory) -> Path:
    """Return a run folder that no test changes: 3 points of 3 trials."""
    folder = tmp_path_factory.mktemp("swept")
    small = {"arena": {"width_cm": 40, "height_cm": 40}, "robots": [{"count": 3}], "stop": {"max_cycles": 6}}
    (folder / "short.yaml").write_text(write_scenario(sweep({SPEED: [1, 4, 8]}, 3, "short", **small)))
    assert call("run", folder / "short.yaml", "--out", folder / "run", "--workers", "1").exit_code == 0
    return folder / "run"


@pytest.fixture
def views(monkeypatch) -> Mock:
    """Have no viewer opened, and noted what is asked of them."""
    found = Mock()
    found.serve.side_effect = lambda _, port, tell: tell(f"{ADDRESS}:{port}")
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(machine, "check_port", lambda _: None)
    for way in ("show", "serve", "draw_screenshot"):
        monkeypatch.setattr(viewer, way, getattr(found, way))
    return found


@pytest.mark.parametrize("level", Level)
def test_the_level_says_how_much_is_recorded_and_any_is_shown(tmp_path, views, level: Level) -> None:
    called("run", "pair", "--record", tmp_path / "t.rrd", "--record-level", level, "--memory", "phase_ms")
    read = read_recording(tmp_path / "t.rrd")
    assert read.level is level
    assert read.memory["phase_ms"].shape == (len(read.time_s), 2)
    called("replay", tmp_path / "t.rrd")
    views.show.assert_called_once_with(tmp_path / "t.rrd")


def test_trials_of_a_run_folder_are_simulated_again_and_shown(swept, here, views) -> None:
    before, outcomes = contents(swept), set()
    for point, trial in [(0, 0), (1, 1), (2, 1)]:
        name = f"run-point-{point}-trial-{trial}.rrd"
        assert called("replay", swept, "--point", point, "--trial", trial).splitlines()[-1] == name
        views.show.assert_called_with(Path(name))
        recorded = check_is(here / name, swept, point, trial)
        outcomes.add(read_outcome(swept, point, trial))
        assert read_outcome(swept, point, trial) == (recorded.cycles, not recorded.synchronised)
        assert recorded.level is Level.FULL
    assert {censored for _, censored in outcomes} == {True, False}
    assert len(outcomes) == len(list(here.iterdir())) == 3
    assert contents(swept) == before


def test_it_is_recorded_to_the_file_that_is_given_also_interpreted(swept, here, views, monkeypatch) -> None:
    target = here / "mine.rrd"
    words = ["replay", swept, "--point", "0", "--trial", "1", "--record", target, "--web", "--port", "1234"]
    assert call(*words).stdout.splitlines()[-2:] == [str(target), f"{ADDRESS}:1234"]
    assert list(here.iterdir()) == [target]
    check_is(target, swept, 0, 1)
    views.serve.assert_called_once_with(target, 1234, ANY)
    simulate = Mock(side_effect=Simulation)
    monkeypatch.setattr("epuck_sim.cli.trials.simulate", simulate)
    words = ["replay", swept, "--point", "1", "--trial", "1", "--record", here / "t.rrd"]
    called(*words, "--interpret")
    check_is(here / "t.rrd", swept, 1, 1)
    called(*words)
    assert [call.kwargs for call in simulate.call_args_list] == [{"interpret": True}, {"interpret": False}]
    assert views.show.call_count == 2


@pytest.mark.parametrize("name", ["v0.5", "thesis"])  # which is a shipped scenario, too
def test_the_folder_s_own_name_is_in_the_default_one(swept, tmp_path, monkeypatch, views, name: str) -> None:
    folder = Path(shutil.copytree(swept, tmp_path / name))
    monkeypatch.chdir(folder if name == "v0.5" else tmp_path)
    words = ["--point", "0", "--trial", "0", "--screenshot", "p.png", "--at", "0.5"]
    file = Path(f"{name}-point-0-trial-0.rrd")
    assert called("replay", "." if name == "v0.5" else name, *words).splitlines()[-1] == str(file)
    views.draw_screenshot.assert_called_once_with(file, 0.5, Path("p.png"))
    assert read_recording(file).scenario.name == "short"


def test_where_nothing_can_be_shown_the_trial_is_recorded_all_the_same(swept, here, monkeypatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    result = call("replay", swept, "--point", "2", "--trial", "1")
    assert (result.exit_code, result.stdout.splitlines()[-1]) == (0, "run-point-2-trial-1.rrd")
    assert re.search("there is no display here.*give --web to look in a browser", result.stderr, re.DOTALL)
    check_is(here / "run-point-2-trial-1.rrd", swept, 2, 1)


@pytest.mark.parametrize(
    ("change", "note"),
    [
        ("cycles = cycles + 1000", "note: this trial differs from the stored one, which lasted 1006 cycles"),
        ("censored = 1 - censored", "note: this trial differs from the stored one"),
        ("error = 'gone'", ""),
        ("wall_s = 0", ""),
    ],
)
def test_a_trial_that_comes_out_otherwise_than_stored_is_noted(swept, here, views, change: str, note: str) -> None:
    folder = Path(shutil.copytree(swept, here / "run"))
    edit(folder, f"UPDATE trials SET epuck_sim = '0.0.1', {change}")
    result = call("replay", folder, "--point", "1", "--trial", "0")
    assert (result.exit_code, bool(result.stderr)) == (0, bool(note))
    assert result.stderr.startswith(note)
    assert ("epuck_sim 0.0.1" in result.stderr) == bool(note)
    assert views.show.call_count == len(list(here.glob("*.rrd"))) == 1


def test_a_recording_is_served_with_an_address_or_drawn_at_its_end_or_a_moment(pair, here, views) -> None:
    for arguments, port in (([], 9090), (["--port", "1234"], 1234)):
        result = call("replay", pair, "--web", *arguments)
        assert (result.exit_code, result.stdout) == (0, f"{ADDRESS}:{port}\n")
        assert result.stderr == "open this address in a browser on this machine:\npress Ctrl-C to end\n"
        assert views.method_calls == [method.serve(pair, port, ANY)]
        views.reset_mock()
    end = read_recording(pair).time_s[-1]
    for at, drawn in ((None, end), (0.0, 0.0), (0.5, 0.5), (end, end)):
        assert called("replay", pair, "--screenshot", "p.png", *([] if at is None else ["--at", f"{at:g}"])) == ""
        assert views.method_calls == [method.draw_screenshot(pair, drawn, Path("p.png"))]
        views.reset_mock()
    with record(here / "empty.rrd", load_scenario("pair"), 1, "poses"):
        pass
    result = call("replay", here / "empty.rrd", "--screenshot", "p.png")
    assert (result.exit_code, "empty.rrd: holds no moment of a trial" in result.stderr) == (2, True)
    refusal = pytest.raises(RecordingError, match="level is 'half'; allowed: summary, poses, full")
    with refusal, record("e.rrd", None, 1, "half"):
        pass


def watch_live(monkeypatch, look: Callable[[Step, Any], None]) -> SimpleNamespace:
    """Have an observer look at each trial that is shown, and return what the viewer is asked for."""
    window, found = Mock(), SimpleNamespace(ports=[], shown=[], more={})
    found.wait = window.wait

    def live_viewer(port: int | None, tell: Callable[[str], None]) -> Any:
        found.ports.append(port)
        tell("the address")
        return nullcontext((window, 77))

    def show(viewer: Any, intake: int, *given: Any, **more: Any) -> Any:
        assert (viewer, intake) == (window, 77)
        found.shown.append(given)
        found.more.update(more)
        return nullcontext(look)

    monkeypatch.setattr(viewer, "live_viewer", live_viewer)
    monkeypatch.setattr(viewer, "live", show)
    return found


@pytest.mark.parametrize(
    ("arguments", "speed", "port", "level"),
    [
        ([], 1, None, Level.FULL),
        (["--web", "--record-level", "poses"], 1, 9090, Level.POSES),
        (["--speed", "0.5", "--web", "--port", "1234"], 0.5, 1234, Level.FULL),
    ],
)
def test_trials_are_shown_live_each_in_the_one_viewer_that_stays(monkeypatch, arguments, speed, port, level) -> None:
    steps: list[int] = []
    found = watch_live(monkeypatch, lambda step, _: steps.append(step.number))
    result = call("run", "pair", "--trials", "2", "--json", "--live", *arguments)
    assert result.exit_code == 0
    assert "the address\n" in result.stderr
    assert result.stderr.rstrip().endswith("to end")
    rows = trials(result.stdout)
    assert rows == trials(called("run", "pair", "--trials", "2", "--json"))
    assert found.ports == [port]
    assert [given[1:] for given in found.shown] == [(row["seed"], level, speed) for row in rows]
    assert found.more == {"memory": (), "wait": sleep}  # stdin is no terminal
    assert steps == [*range(rows[0]["steps"]), *range(rows[1]["steps"])]
    found.wait.assert_called_once()


BLINKER = with_step("memory.steps += 1; actuators.ring_on = 0", MEMORY='{"steps": int}')


@pytest.mark.usefixtures("here")
def test_a_controller_that_is_saved_while_it_is_shown_live_is_the_new_one_from_then_on(monkeypatch) -> None:
    file, rings = Path("blinker.py"), []
    file.write_text(BLINKER)

    def look(step: Step, _: Any) -> None:
        rings.append(int(step.ring_on.sum()))
        if step.number in (10, 20):
            file.write_text(BLINKER.replace("ring_on = 0", "ring_on = 1" if step.number == 10 else "ring ="))
            os.utime(file, ns=(0, step.number))

    found = watch_live(monkeypatch, look)
    monkeypatch.setattr(replacement, "LOOK_S", 0)
    options = ("--set", "stop.max_time_s=4", "--memory", "steps", "--interpret")
    result = call("run", "pair", "--controller", "blinker.py", "--live", *options)
    assert result.exit_code == 0, result.stderr
    assert rings == [0] * 11 + [2] * 29
    assert "blinker.py: robots go on with the new one from step 11; memory is kept\n" in result.stderr
    assert "blinker.py:9: cannot be loaded: SyntaxError" in result.stderr
    assert found.more["memory"] == ("steps",)


def test_a_port_in_use_is_refused_before_a_trial_runs(pair, swept, here, monkeypatch) -> None:
    monkeypatch.setattr("epuck_sim.cli.trials.simulate", lambda *_, **__: pytest.fail("a trial was simulated"))
    live, of_folder = ["run", "pair", "--live"], ["replay", swept, "--point", "0", "--trial", "0"]
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        for given in (live, [*live, "--record", "t.rrd"], ["replay", pair], of_folder):
            assert f"port {port} cannot be used" in refused(*given, "--web", "--port", port)
    assert list(here.iterdir()) == []


def test_ctrl_c_keeps_whole_files_of_trials_that_have_ended_and_leaves_nothing_half_written(tmp_path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text("name: long\nrobots: [{controller: constant, poses: [[30, 30, 0]]}]\nstop: {max_time_s: 500}")
    files = ["--record", tmp_path / "t.rrd", "--trace", tmp_path / "t.parquet"]
    process = start([*COMMAND, "run", scene, "--trials", "60", *files])
    wait_until(lambda: any(tmp_path.glob("t-1.rrd*part/1.rrd")) or process.poll() is not None, 120)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: rerun's programs hear it, too
    stdout, stderr = process.communicate(timeout=300)
    assert (process.returncode, stderr) == (130, "interrupted\n")
    finished = len(cells(stdout))
    assert finished >= 1
    kept = [f"t-{n}.{ending}" for n in range(finished) for ending in ("rrd", "parquet")]
    assert {path.name for path in tmp_path.iterdir()} == {"scene.yaml", *kept}
    assert len(read_recording(tmp_path / "t-0.rrd").time_s) == 5_000
