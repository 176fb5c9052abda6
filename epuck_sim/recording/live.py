"""A trial in the viewer while it runs, at the speed of real robots or a multiple of it, with pauses, or by steps."""

import math
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import rerun as rr

from epuck_sim.errors import RecordingError
from epuck_sim.recording import Level
from epuck_sim.recording.layers.series import recorded_fields
from epuck_sim.recording.layout import layout_of
from epuck_sim.recording.process import ViewerProcess, in_background
from epuck_sim.recording.recorder import Recorder
from epuck_sim.recording.viewer import chunk_stream, has_display, web_viewer
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.result import Observer, TrialState
from epuck_sim.util.machine import free_port

PAUSE, STEP, END = " ", "n", "q"
"""Keys that pause the trial and let it go on, that take one step, and that end it."""

MOST_LATE_S = 2.0
"""A trial that is later than this, in seconds, goes on from there at its pace; one that is less late catches up."""

LOOK_S = 0.1
"""Time between two looks at the viewer during a pause, in seconds."""

Wait = Callable[[float], str]
"""Waits for a number of seconds, or until keys are pressed, and returns these."""


def sleep(seconds: float) -> str:
    """Wait where there are no keys to press."""
    if seconds > 0:
        time.sleep(seconds)
    return ""


class Pace:
    """When each step of a trial is due."""

    is_paused: bool
    """Whether the trial stands still after the step that is due, until a key is pressed."""

    def __init__(self, speed: float, wait: Wait = sleep) -> None:
        """Set the pace.

        Args:
            speed: How many times as fast as real robots.
            wait: Waits between steps.
        """
        self._speed = speed
        self._wait = wait
        self._began: float | None = None
        self._steps_wanted = 0
        self.is_paused = False

    def wait_until(self, time_s: float) -> None:
        """Wait for the moment at which this simulated time, in seconds, is to be shown.

        Raises:
            KeyboardInterrupt: `END` was pressed.
        """
        now = time.monotonic()
        if self._began is None:
            self._began = now - time_s / self._speed
        late = now - self._began - time_s / self._speed
        if late > MOST_LATE_S:
            self._began += late
        self._obey(self._wait(0.0))
        while (early := self._began + time_s / self._speed - time.monotonic()) > 0:
            self._obey(self._wait(early))

    def stand_still(self, look: Callable[[], None]) -> None:
        """Wait until the trial is to go on, by one step or for good; call `look` now and then.

        Raises:
            KeyboardInterrupt: `END` was pressed.
        """
        stopped = time.monotonic()
        while self.is_paused and not self._steps_wanted:
            look()
            self._obey(self._wait(LOOK_S))
        self._steps_wanted = max(self._steps_wanted - 1, 0)
        assert self._began is not None, "a trial stands still at a step"
        self._began += time.monotonic() - stopped

    def _obey(self, keys: str) -> None:
        for key in keys:
            if key == END:
                raise KeyboardInterrupt
            if key == PAUSE:
                self.is_paused, self._steps_wanted = not self.is_paused, 0
            elif key == STEP:
                self._steps_wanted += self.is_paused
                self.is_paused = True


REFRESH_S = 0.1
"""Time between two updates of the viewer, in seconds."""

NO_DISPLAY = "there is no display here; give --web to look in a browser, or --record FILE.rrd to look later"

CLOSED = "the viewer was closed before the trial ended"


@contextmanager
def live_viewer(port: int | None, announce: Callable[[str], None]) -> Iterator[tuple[ViewerProcess, int]]:
    """Yield a viewer without a recording, and the port at which it takes chunks.

    Args:
        port: Where browsers find the viewer; a window is opened if it is None.
        announce: Called with the address for browsers.

    Raises:
        RecordingError: There is no display for a window, or the port is in use.
    """
    if port is not None:
        with web_viewer(port) as (server, address, intake):
            announce(address)
            yield server, intake
        return
    if not has_display():
        raise RecordingError(NO_DISPLAY)
    intake = free_port()
    with in_background("--port", str(intake), "--expect-data-soon") as window:
        window.wait_for(intake)
        yield window, intake


@contextmanager
def live(
    viewer: ViewerProcess,
    intake: int,
    scenario: Scenario,
    seed: int,
    level: Level,
    speed: float,
    *,
    memory: Sequence[str] = (),
    wait: Wait = sleep,
) -> Iterator[Observer]:
    """Yield an observer that shows a trial in a viewer, and makes it last as long as it would, divided by `speed`.

    Args:
        viewer: A running viewer.
        intake: The port at which it takes chunks.
        scenario: The trial's scenario.
        seed: The trial's seed.
        level: How much is shown.
        speed: How many times as fast as real robots.
        memory: Fields of the controllers' MEMORY to show, each once.
        wait: Waits between steps; it may return keys, see `Pace`.

    Raises:
        RecordingError: The viewer was closed before the trial ended.
        KeyboardInterrupt: The key that ends the trial was pressed.
    """
    memory = recorded_fields(scenario, level, memory)
    with chunk_stream(intake, str(uuid.uuid4()), layout_of(scenario, level, memory)) as stream:
        recorder = Recorder(
            scenario, seed, level, REFRESH_S * speed, lambda chunks: rr.send_chunks(chunks, recording=stream), memory
        )
        look_s = math.inf if isinstance(scenario, EmbodiedScenario) else REFRESH_S * speed
        yield _LiveObserver(recorder, Pace(speed, wait), viewer, look_s)
        recorder.finish()


class _LiveObserver:
    """An observer that records, and keeps the pace."""

    def __init__(self, recorder: Recorder, pace: Pace, viewer: ViewerProcess, look_s: float) -> None:
        """Take a recorder; what moves on between two events is shown every `look_s` simulated seconds."""
        self._recorder = recorder
        self._pace = pace
        self._viewer = viewer
        self._look_s = look_s
        self._shown_s = 0.0

    def __call__(self, event: Any, state: TrialState) -> None:
        """Show an event when its time has come, and what moves on until then; stay there while the trial is paused."""
        while (moment_s := self._shown_s + self._look_s) < event.time_s:
            self._show(moment_s, lambda: self._recorder.catch_up(moment_s))
        self._show(event.time_s, lambda: self._recorder(event, state))

    def _show(self, time_s: float, record: Callable[[], None]) -> None:
        self._pace.wait_until(time_s)
        self._check_viewer()
        record()
        self._shown_s = time_s
        if self._pace.is_paused:
            self._recorder.flush()
            self._pace.stand_still(self._check_viewer)

    def _check_viewer(self) -> None:
        if self._viewer.has_ended:
            self._viewer.wait()  # which raises if it broke down
            raise RecordingError(CLOSED)
