"""A trial in the viewer while it runs: what is shown, at which pace, and how it ends."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from io import BytesIO
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import psutil
import pytest
from rerun.experimental import ViewerClient

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.errors import RecordingError
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.recording import Level, process
from epuck_sim.recording import live as live_module
from epuck_sim.recording.live import live, live_viewer
from epuck_sim.recording.process import NO_GRAPHICS, in_background, proxy_url
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.trial.model import Observer, run_trial
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.machine import free_port
from tests.processes import processes_marked, wait_until
from tests.recording.viewers import (
    ARENA,
    DARK,
    LIT,
    NOTHING_STARTS,
    answer,
    discs,
    listening,
    nothing_left,
    pixels,
    replace_rerun,
)

FAST = 1000.0

SCENARIO = load_scenario("thesis")


@pytest.fixture(autouse=True)
def all_has_ended(tmp_path) -> Iterator[None]:
    with nothing_left(tmp_path):
        yield


class Watched:
    """An observer that copies what it is shown."""

    def __init__(self) -> None:
        self.arrays: list[bytes] = []
        self.ring_on = np.empty(0, bool)
        self.time_s = np.nan

    def __call__(self, step: Step, _: SynchronyWatch) -> None:
        arrays = (step.poses, step.camera, step.infrared, step.wheels_cm_s, step.ring_on, *step.memories)
        self.arrays.append(b"".join(array.tobytes() for array in arrays))
        self.ring_on, self.time_s = step.ring_on.copy(), step.time_s


def ran(*observers: Observer) -> TrialResult:
    return run_trial(Simulation(SCENARIO, 3), observers)._replace(wall_s=0)


def ignore(_: str) -> None:
    """Hear of an address."""


# --- what is shown --------------------------------------------------------------------------------------


class Shown(NamedTuple):
    """A trial that has been shown, and what the viewer prints and shows of it in the end."""

    watched: Watched
    state: Any
    robots: tuple[int, int]
    """Red and grey discs."""


@pytest.fixture(scope="module")
def shown(tmp_path_factory) -> Shown:
    port, watched = free_port(), Watched()
    hidden = in_background("--headless", "--port", str(port), "--window-size", "1600x900")
    with nothing_left(tmp_path_factory.mktemp("shown")), hidden as window:
        try:
            window.wait_for(port)
            with live(window, port, SCENARIO, 3, Level.FULL, FAST) as look:
                ran(look, watched)
            client = ViewerClient.connect(proxy_url(port))
            client.set_time("sim_time", duration=watched.time_s, play_state="paused")
            robots, until = (0, 0), time.monotonic() + 30
            while sum(robots) < SCENARIO.robot_count and time.monotonic() < until:
                arena = pixels(BytesIO(client.take_screenshot()))[ARENA]
                robots = len(discs(arena, LIT)), len(discs(arena, DARK))
        except (RecordingError, ConnectionError):  # it answers before it looks for a driver
            if str(window.error()) == NO_GRAPHICS:
                pytest.skip(NO_GRAPHICS)
            raise
        return Shown(watched, client.get_state(), robots)


def test_the_viewer_has_the_whole_trial(shown: Shown) -> None:
    (recording,) = shown.state.recordings
    assert recording.store_id == shown.state.active_recording
    assert recording.store_id.startswith("Recording:epuck-sim:")
    (timeline,) = recording.timelines
    assert (timeline.name, timeline.time_type) == ("sim_time", "duration")
    assert (timeline.start, timeline.end) == (0, round(shown.watched.time_s * 1e9))


def test_the_viewer_shows_the_rings_as_they_are_in_the_end(shown: Shown) -> None:
    lit = int(shown.watched.ring_on.sum())
    assert lit > 0
    assert shown.robots == (lit, SCENARIO.robot_count - lit)


def test_the_viewer_takes_the_layout_and_can_show_it_all(shown: Shown) -> None:
    views = {view.name: (view.origin, view.view_class) for view in shown.state.views}
    assert views["arena [cm]"] == ("/", "2D")
    assert views["camera rows"] == ("/camera/rows", "2D")
    assert views["flashes [robot]"] == ("/flashes", "TimeSeries")
    assert ("/order", "TimeSeries") in views.values()
    assert [view.name for view in shown.state.views if view.reports] == []


@pytest.mark.parametrize("level", Level)
def test_a_trial_that_is_shown_is_the_same_trial(level: Level) -> None:
    alone, beside = Watched(), Watched()
    with (
        live_viewer(free_port(), ignore) as (browsers, intake),
        live(browsers, intake, SCENARIO, 3, level, FAST) as look,
    ):
        result = ran(look, beside)
    assert result == ran(alone)
    assert beside.arrays == alone.arrays


def test_a_viewer_costs_nothing_once_the_trial_has_been_shown(tmp_path) -> None:
    with live_viewer(free_port(), ignore) as (browsers, intake):
        with live(browsers, intake, SCENARIO, 3, Level.FULL, FAST) as look:
            ran(look)
        (server,) = map(psutil.Process, processes_marked(str(tmp_path)))
        before = sum(server.cpu_times()[:2])
        time.sleep(2)
        assert sum(server.cpu_times()[:2]) - before < 0.2


# --- pace -----------------------------------------------------------------------------------------------


class Clock:
    """A clock that nobody waits for; stands for the module `time`."""

    now = 5000.0

    def __init__(self) -> None:
        self.slept: list[float] = []

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.slept.append(seconds)
        self.now += seconds


class Paced(NamedTuple):
    """Steps that were shown on a clock that nobody waits for."""

    clock: Clock
    shown_s: list[float]
    """When each step was recorded."""
    held_back_s: list[float]
    """Simulated time that each recorder holds back."""
    flushed_at: list[float]
    """When the viewer was sent all that had been held back."""
    caught_up_s: list[float]
    """Simulated times up to which agents were shown between two events."""


@pytest.fixture
def paced(monkeypatch) -> Paced:
    clock, shown_s, held_back_s, flushed_at, caught_up_s = Clock(), [], [], [], []

    class Recorder:
        def __init__(
            self, _scenario: Any, _seed: int, _level: Level, buffer_s: float, _write: Callable[..., None], _memory: Any
        ) -> None:
            held_back_s.append(buffer_s)

        def __call__(self, *_: Any) -> None:
            shown_s.append(clock.now)

        def catch_up(self, time_s: float) -> None:
            caught_up_s.append(time_s)

        def flush(self) -> None:
            flushed_at.append(clock.now)

        def finish(self) -> None:
            pass

    monkeypatch.setattr(live_module, "time", clock)
    monkeypatch.setattr(live_module, "Recorder", Recorder)
    return Paced(clock, shown_s, held_back_s, flushed_at, caught_up_s)


def show_steps(clock: Clock, speed: float, took_s: list[float]) -> float:
    """Show steps of 0.1 s, given the time that each takes to simulate; return when the first could be shown."""
    with (
        live_viewer(free_port(), ignore) as (browsers, intake),
        live(browsers, intake, SCENARIO, 0, Level.FULL, speed) as look,
    ):
        clock.now += 30  # which it took to compile the simulation
        began = clock.now
        for number, seconds in enumerate(took_s):
            clock.now += seconds
            look(SimpleNamespace(number=number, time_s=number / 10), None)
    return began


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_a_step_is_shown_when_its_time_has_come(paced: Paced, speed: float) -> None:
    began = show_steps(paced.clock, speed, [0.0] + [0.01] * 49)
    np.testing.assert_allclose(np.array(paced.shown_s) - began, np.arange(50) / 10 / speed, rtol=0, atol=1e-9)
    assert sum(paced.clock.slept) == pytest.approx(4.9 / speed - 0.49)


def test_a_trial_that_is_late_does_not_wait_until_it_has_caught_up(paced: Paced) -> None:
    took_s = [0.0, 0.02, 1.01] + [0.02] * 17
    began = show_steps(paced.clock, 1.0, took_s)
    computed = np.cumsum([0.1, *took_s[2:]])[1:]
    expected = [0.0, 0.1, *np.maximum(computed, np.arange(2, 20) / 10)]
    assert expected[12] > 1.2
    assert expected[15] == 1.5
    np.testing.assert_allclose(np.array(paced.shown_s) - began, expected, rtol=0, atol=1e-9)


def test_a_trial_that_cannot_keep_up_never_waits(paced: Paced) -> None:
    show_steps(paced.clock, 10.0, [0.02] * 50)
    assert len(paced.shown_s) == 50
    assert paced.clock.slept == []


@pytest.mark.parametrize("speed", [0.1, 1.0, 10.0])
def test_the_viewer_gets_what_is_new_ten_times_a_second(paced: Paced, speed: float) -> None:
    show_steps(paced.clock, speed, [0.0])
    assert paced.held_back_s == [pytest.approx(0.1 * speed)]


def test_a_paused_trial_shows_its_last_step(paced: Paced) -> None:
    keys = {1: iter([" "]), 2: iter(["", "", " "])}  # by the number of steps that have been shown

    def wait(seconds: float) -> str:
        paced.clock.now += seconds
        return next(keys.get(len(paced.shown_s), iter([])), "")

    with (
        live_viewer(free_port(), ignore) as (browsers, intake),
        live(browsers, intake, SCENARIO, 0, Level.FULL, 1.0, wait=wait) as look,
    ):
        for number in range(3):
            look(SimpleNamespace(number=number, time_s=number / 10), None)
    assert paced.flushed_at == [paced.shown_s[1]]
    assert np.diff(paced.shown_s) == pytest.approx([0.1, 0.1 + 3 * 0.1])


def test_agents_that_move_on_between_two_events_are_shown_as_often_as_the_viewer_is_told(paced: Paced) -> None:
    with (
        live_viewer(free_port(), ignore) as (browsers, intake),
        live(browsers, intake, load_scenario("particles"), 0, Level.FULL, 2.0) as look,
    ):
        for time_s in (0.1, 0.75, 0.8):
            look(SimpleNamespace(time_s=time_s), None)
    assert paced.caught_up_s == pytest.approx([0.3, 0.5, 0.7])
    assert np.diff(paced.shown_s) == pytest.approx([0.65 / 2, 0.05 / 2])


def test_agents_that_are_shown_are_in_the_same_trial() -> None:
    scenario = load_scenario("particles", ["stop.max_cycles=5"])
    with (
        live_viewer(free_port(), ignore) as (browsers, intake),
        live(browsers, intake, scenario, 3, Level.FULL, FAST) as look,
    ):
        shown = run_trial(ParticleSimulation(scenario, 3), [look])
    assert shown._replace(wall_s=0) == run_trial(ParticleSimulation(scenario, 3), [])._replace(wall_s=0)


# --- viewers --------------------------------------------------------------------------------------------


@pytest.fixture
def no_display(monkeypatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


def test_a_browser_on_this_machine_only_finds_the_viewer_at_the_port(tmp_path) -> None:
    port, addresses = free_port(), []
    with live_viewer(port, addresses.append) as (_, intake):
        (address,) = addresses
        assert address.startswith(f"http://127.0.0.1:{port}?url=")
        assert answer(address)
        assert listening(processes_marked(str(tmp_path))) == {("127.0.0.1", port), ("127.0.0.1", intake)}


@pytest.mark.usefixtures("no_display")
def test_without_a_display_nothing_starts_and_the_error_names_the_other_ways(monkeypatch) -> None:
    monkeypatch.setattr(process, "PROGRAM", NOTHING_STARTS)
    with (
        pytest.raises(RecordingError, match=r"^there is no display here; give --web .* --record"),
        live_viewer(None, ignore),
    ):
        pytest.fail("there is a viewer")


@pytest.mark.usefixtures("no_display")
def test_a_display_that_is_not_there_is_reported(monkeypatch) -> None:
    monkeypatch.setenv("DISPLAY", ":9876")
    with (
        pytest.raises(RecordingError, match=r"^the viewer (does not work|was closed)"),
        live_viewer(None, ignore) as (window, intake),
        live(window, intake, SCENARIO, 3, Level.FULL, 10) as look,
    ):
        ran(look)


def test_a_window_that_breaks_down_soon_is_reported_with_its_output(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    replace_rerun(tmp_path / "stand", monkeypatch).answers_and_says("no place for a window")
    with (
        pytest.raises(RecordingError, match="no place for a window"),
        live_viewer(None, ignore) as (window, intake),
        live(window, intake, SCENARIO, 3, Level.FULL, FAST) as look,
    ):
        ran(lambda *_: wait_until(lambda: window.has_ended), look)


@pytest.mark.parametrize("error", [ZeroDivisionError, RecursionError, KeyboardInterrupt])
def test_an_error_that_ends_the_trial_is_raised_unchanged(error: type[BaseException]) -> None:
    with (
        pytest.raises(error),
        live_viewer(free_port(), ignore) as (browsers, intake),
        live(browsers, intake, SCENARIO, 3, Level.FULL, FAST),
    ):
        raise error


CLOSED = """
import sys, time
import psutil
from epuck_sim.errors import RecordingError
from epuck_sim.recording import Level
from epuck_sim.recording.live import live, live_viewer
from epuck_sim.util.machine import free_port
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.trial.model import run_trial

moments = []
ended = "in the end" in sys.argv

def close():
    moments.append(time.monotonic())
    for process in psutil.Process().children(recursive=True):
        process.kill()
    time.sleep(0.2)

def watch(step, _):
    if step.number == 100 and not ended:
        close()

scenario = load_scenario("thesis")
try:
    with live_viewer(free_port(), lambda _: None) as (viewer, intake):
        with live(viewer, intake, scenario, 3, Level.FULL, 1000) as look:
            run_trial(Simulation(scenario, 3), [look, watch])
            if ended:
                close()
except RecordingError as error:
    assert time.monotonic() - moments[0] < 9, "it takes long"
    print(error)
"""


@pytest.mark.parametrize("moment", ["in the middle", "in the end"])
def test_a_viewer_that_is_closed_too_early_is_reported_at_once(moment: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", CLOSED, moment], capture_output=True, text=True, timeout=120, check=False
    )
    assert "Traceback" not in done.stderr
    assert done.returncode == 0
    assert done.stdout.startswith("the viewer ")
