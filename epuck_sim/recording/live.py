"""A trial in the viewer while it runs, at the speed of real robots or a multiple of it, with pauses, or by steps."""

import math
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
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

PAUSE, STEP, END = " ", "n", "q"  # keys that pause the trial and let it go on, that take one step, and that end it

MOST_LATE_S = 2.0  # a trial that is later than this goes on from there at its pace; one that is less late catches up

REFRESH_S = 0.1  # seconds between two updates of the viewer, and between two looks at it during a pause

NO_DISPLAY = "there is no display here; give --web to look in a browser, or --record FILE.rrd to look later"
Wait = Callable[[float], str]  # waits for a number of seconds, or until keys are pressed, and returns these


def sleep(seconds: float) -> str:
    """Wait where there are no keys to press."""
    time.sleep(max(seconds, 0.0))
    return ""


class Pace:
    """When each step of a trial is due."""

    def __init__(self, speed: float, wait: Wait = sleep) -> None:
        """Set how many times as fast as real robots a trial goes, and what waits between its steps."""
        self._speed = speed
        self._wait = wait
        self._began = -math.inf
        self._steps_wanted = 0
        self.is_paused = False  # whether the trial stands still after the step that is due, until a key is pressed

    def wait_until(self, time_s: float) -> None:
        """Wait until this simulated time is to be shown; raise KeyboardInterrupt if `END` is pressed."""
        now, due_s = time.monotonic(), time_s / self._speed
        if now - self._began - due_s > MOST_LATE_S:
            self._began = now - due_s
        self._obey(self._wait(0.0))
        while (early := self._began + due_s - time.monotonic()) > 0:
            self._obey(self._wait(early))

    def stand_still(self, look: Callable[[], None]) -> None:
        """Wait until a paused trial goes on, by one step or for good, and call `look` now and then; raise as above."""
        stopped = time.monotonic()
        while self.is_paused and not self._steps_wanted:
            look()
            self._obey(self._wait(REFRESH_S))
        self._steps_wanted = max(self._steps_wanted - 1, 0)
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


@contextmanager
def live_viewer(port: int | None, announce: Callable[[str], None]) -> Iterator[tuple[ViewerProcess, int]]:
    """Yield a viewer without a recording, and the port at which it takes chunks; raise RecordingError if none opens.

    Browsers find it at `port`, and `announce` is called with their address; a window is opened if there is no port.
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

    `intake` is the port at which the viewer takes chunks, `memory` has fields of the controllers' MEMORY to show.

    Raises:
        RecordingError: The viewer was closed before the trial ended.
        KeyboardInterrupt: The key that ends the trial was pressed.
    """
    memory, refresh_s = recorded_fields(scenario, level, memory), REFRESH_S * speed
    with chunk_stream(intake, str(uuid.uuid4()), layout_of(scenario, level, memory)) as stream:
        send = partial(rr.send_chunks, recording=stream)
        recorder, pace = Recorder(scenario, seed, level, refresh_s, send, memory), Pace(speed, wait)
        look_s = math.inf if isinstance(scenario, EmbodiedScenario) else refresh_s
        shown_s = 0.0

        def check_viewer() -> None:
            if viewer.has_ended:
                viewer.wait()  # which raises if it broke down
                raise RecordingError("the viewer was closed before the trial ended")

        def show(time_s: float, record: Callable[..., None], *given: Any) -> None:
            nonlocal shown_s
            pace.wait_until(time_s)
            check_viewer()
            record(*given)
            shown_s = time_s
            if pace.is_paused:
                recorder.flush()
                pace.stand_still(check_viewer)

        def observe(event: Any, state: TrialState) -> None:
            while (moment_s := shown_s + look_s) < event.time_s:  # agents move on between two events
                show(moment_s, recorder.catch_up, moment_s)
            show(event.time_s, recorder, event, state)

        yield observe
        recorder.finish()
