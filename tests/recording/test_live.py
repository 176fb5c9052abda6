"""A trial in the viewer while it runs: what is shown, at which pace, what keys do, and how it ends."""

import os
import signal
from contextlib import nullcontext
from functools import partial
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from rerun.experimental import ViewerClient

from epuck_sim import RecordingError, Scenario, Step, TrialResult, load_scenario
from epuck_sim.recording import Level, viewer as viewer_module
from epuck_sim.recording.rerun import NO_GRAPHICS, in_background, proxy_url
from epuck_sim.recording.viewer import END, MOST_LATE_S, PAUSE, STEP, Pace, live, live_viewer
from epuck_sim.trial.model import Observer, run_trial, simulate
from epuck_sim.util.machine import free_port
from tests.processes import processes_marked, wait_until
from tests.recording.recordings import Watched
from tests.recording.viewers import answer, nothing_left, replace_rerun
from tests.tools import MAY_LACK

FAST = 1000.0
SCENARIO = load_scenario("thesis")
AGENTS = load_scenario("particles", ["stop.max_cycles=5"])


@pytest.fixture(autouse=True)
def all_has_ended(tmp_path):
    with nothing_left(tmp_path):
        yield


def ran(*observers: Observer, scenario: Scenario = SCENARIO) -> TrialResult:
    return run_trial(simulate(scenario, 3), observers)._replace(wall_s=0)


def test_the_viewer_has_the_whole_trial_with_its_layout() -> None:
    port, watched = free_port(), Watched()
    with in_background("--headless", "--port", str(port), "--window-size", "400x300") as window:
        try:
            window.wait_for(port)
            with live(window, port, SCENARIO, 3, Level.FULL, FAST) as look:
                ran(look, watched)
            viewer = ViewerClient.connect(proxy_url(port))
            wait_until(lambda: len(viewer.get_state().views) > 1)  # what it has comes before how it is laid out
            state = viewer.get_state()
        except (RecordingError, ConnectionError):  # it answers before it looks for a driver
            if str(window.error()) == NO_GRAPHICS and MAY_LACK:
                pytest.skip(NO_GRAPHICS)
            raise
    (recording,) = state.recordings
    assert recording.store_id == state.active_recording
    assert recording.store_id.startswith("Recording:epuck-sim:")
    (timeline,) = recording.timelines
    assert (timeline.name, timeline.time_type) == ("sim_time", "duration")
    assert (timeline.start, timeline.end) == (0, round(watched.steps[-1].time_s * 1e9))
    views = {view.name: (view.origin, view.view_class) for view in state.views}
    assert views["arena [cm]"] == ("/", "2D")
    assert views["camera rows"] == ("/camera/rows", "2D")
    assert views["flashes [robot]"] == ("/flashes", "TimeSeries")
    assert ("/order", "TimeSeries") in views.values()
    assert [view.name for view in state.views if view.reports] == []


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """A viewer for browsers, whose page is at the address that it was announced at."""
    port, addresses = free_port(), []
    with nothing_left(tmp_path_factory.mktemp("server")), live_viewer(port, addresses.append) as viewer:
        (address,) = addresses
        assert address.startswith(f"http://127.0.0.1:{port}?url=")
        assert answer(address)
        yield viewer


@pytest.mark.parametrize("level", Level)
def test_a_trial_that_is_shown_is_the_same_trial_and_an_error_that_ends_it_is_raised_unchanged(server, level) -> None:
    alone, beside = Watched(), Watched()
    with live(*server, SCENARIO, 3, level, FAST) as look:
        result = ran(look, beside)
    with live(*server, AGENTS, 3, level, FAST) as look:
        of_agents = ran(look, scenario=AGENTS)
    assert result == ran(alone)
    assert beside.is_like(alone)
    assert of_agents == ran(scenario=AGENTS)
    for error in (ZeroDivisionError, KeyboardInterrupt):
        with pytest.raises(error), live(*server, SCENARIO, 3, level, FAST):
            raise error


def begin(monkeypatch, *pressed: tuple[float, str], speed: float = 1.0) -> tuple[SimpleNamespace, Pace]:
    """Return a clock whose time passes while a pace waits, until keys are pressed at given times, and the pace."""
    clock, to_press = SimpleNamespace(now=0.0, waits=0, monotonic=lambda: clock.now), list(pressed)

    def wait(seconds: float) -> str:
        clock.waits += seconds > 0
        if to_press and to_press[0][0] <= clock.now + seconds:
            at, keys = to_press.pop(0)
            clock.now = max(clock.now, at)
            return keys
        clock.now += seconds
        return ""

    clock.wait = wait
    monkeypatch.setattr(viewer_module, "time", clock)
    return clock, Pace(speed, wait)


def shown_at(clock: SimpleNamespace, pace: Pace, steps: int, took_s: float = 0.0) -> list[float]:
    """Return when each step, which takes so long to simulate, is shown."""
    times = []
    for number in range(steps):
        clock.now += took_s
        pace.wait_until(number * 0.1)
        times.append(round(clock.now, 6))
        if pace.is_paused:
            pace.stand_still(lambda: None)
    return times


def test_steps_are_shown_at_their_times_and_short_delays_but_no_long_ones_are_caught_up_with(monkeypatch) -> None:
    for speed in (0.5, 1, 4):
        times = shown_at(*begin(monkeypatch, speed=speed), 5)
        assert times == pytest.approx([number * 0.1 / speed for number in range(5)])
    clock, pace = begin(monkeypatch)
    pace.wait_until(0.0)
    clock.now += 0.9 * MOST_LATE_S
    pace.wait_until(0.1)
    pace.wait_until(2.5)
    assert clock.now == pytest.approx(2.5)
    clock.now += 30
    pace.wait_until(2.6)
    pace.wait_until(2.7)
    assert clock.now == pytest.approx(32.6)
    clock, pace = begin(monkeypatch, speed=10.0)
    assert shown_at(clock, pace, 50, took_s=0.02) == pytest.approx(0.02 * np.arange(1, 51))
    assert clock.waits == 0


def test_keys_pause_a_trial_let_it_go_on_take_steps_and_end_it_at_once_running_or_paused(monkeypatch) -> None:
    paused = shown_at(*begin(monkeypatch, (0.15, PAUSE), (7.2, PAUSE)), 5)
    assert paused == pytest.approx([0, 0.1, 0.2, 7.3, 7.4])  # nothing is hurried after a pause
    stepped = shown_at(*begin(monkeypatch, (0.15, STEP), (5, STEP), (9, STEP + STEP), (20, PAUSE)), 8)
    assert stepped == pytest.approx([0, 0.1, 0.2, 5.1, 9.1, 9.2, 20.1, 20.2])
    for pressed in ([(0.12, END)], [(0.12, PAUSE), (3, END)]):
        clock, pace = begin(monkeypatch, *pressed)
        with pytest.raises(KeyboardInterrupt):
            shown_at(clock, pace, 5)
        assert clock.now == pressed[-1][0]


def told(monkeypatch, scenario: Scenario, speed: float, times: list[float], *pressed: tuple[float, str]) -> Any:
    """Show events at some times, with keys pressed at some times of a clock that nobody waits for.

    Return what simulated time each recorder holds back, and when it was called, and for what.
    """
    clock, _ = begin(monkeypatch, *pressed)
    held_back_s, calls = [], []

    def note(*_: Any, what: str = "event") -> None:
        calls.append((round(clock.now, 6), what))

    def begin_recorder(*given: Any) -> Mock:
        held_back_s.append(given[3])
        recorder = Mock(side_effect=note)
        recorder.catch_up.side_effect = lambda time_s: note(what=f"until {time_s:g}")
        recorder.flush.side_effect = partial(note, what="flush")
        return recorder

    monkeypatch.setattr(viewer_module, "Recorder", begin_recorder)
    monkeypatch.setattr(viewer_module, "chunk_stream", lambda *_: nullcontext())
    viewer = SimpleNamespace(has_ended=False)
    with live(viewer, free_port(), scenario, 0, Level.FULL, speed, wait=clock.wait) as look:
        for time_s in times:
            look(SimpleNamespace(time_s=time_s), None)
    return held_back_s, calls


def test_the_viewer_gets_what_is_new_ten_times_a_second_and_all_of_it_in_a_pause(monkeypatch) -> None:
    for speed in (0.1, 1.0, 10.0):
        pressed = (0.15 / speed, PAUSE), (9 / speed, PAUSE)
        held_back_s, calls = told(monkeypatch, SCENARIO, speed, [0, 0.1, 0.2], *pressed)
        assert held_back_s == [pytest.approx(0.1 * speed)]
        assert [what for _, what in calls] == ["event", "event", "event", "flush"]
        assert [at for at, _ in calls[:3]] == pytest.approx([0, 0.1 / speed, 0.2 / speed])
    _, calls = told(monkeypatch, AGENTS, 2.0, [0.1, 0.75, 0.8])
    assert [what for _, what in calls] == ["event", "until 0.3", "until 0.5", "until 0.7", "event", "event"]
    assert [at for at, _ in calls] == pytest.approx([0, 0.1, 0.2, 0.3, 0.325, 0.35])


def test_a_window_that_breaks_down_soon_is_reported_with_its_output(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(viewer_module, "FLUSH_S", 0.2)  # it takes nothing of what it was sent
    monkeypatch.setenv("DISPLAY", ":0")
    replace_rerun(tmp_path / "stand", monkeypatch).answers_and_says("no place for a window", senders=1)
    with (
        pytest.raises(RecordingError, match="no place for a window"),
        live_viewer(None, str) as (window, intake),
        live(window, intake, SCENARIO, 3, Level.FULL, FAST) as look,
    ):
        ran(lambda *_: wait_until(lambda: window.has_ended), look)


@pytest.mark.parametrize("at", [100, None], ids=["in the middle", "in the end"])
def test_a_viewer_that_is_closed_too_early_is_reported(tmp_path, monkeypatch, at: int | None) -> None:
    monkeypatch.setattr(viewer_module, "FLUSH_S", 0.2)

    def close() -> None:
        for process in processes_marked(str(tmp_path)):
            os.kill(process, signal.SIGKILL)

    def watch(step: Step, _) -> None:
        if step.number == at:
            close()

    with (  # noqa: PT012 it may be closed after the trial, too
        pytest.raises(RecordingError, match=r"^the viewer "),
        live_viewer(free_port(), str) as viewer,
        live(*viewer, SCENARIO, 3, Level.FULL, FAST) as look,
    ):
        ran(look, watch)
        close()
