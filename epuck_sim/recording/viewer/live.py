"""A trial in the viewer while it runs, at the speed of real robots or a multiple of it."""

import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rerun as rr

from epuck_sim.embodied.step import Step
from epuck_sim.errors import RecordingError
from epuck_sim.recording.chunks import APPLICATION
from epuck_sim.recording.layout import make_layout
from epuck_sim.recording.level import Level
from epuck_sim.recording.recorder import Recorder
from epuck_sim.recording.viewer.process import Viewer, free_port, in_background, proxy
from epuck_sim.recording.viewer.viewer import has_display, web_viewer
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.trial.synchrony import SynchronyWatch

REFRESH_S = 0.1
"""How often the viewer gets what is new."""

FLUSH_S = 10.0
"""So long it may take to get the last of it."""

NO_DISPLAY = "there is no display here; give --web to look in a browser, or --record FILE.rrd to look later"

CLOSED = "the viewer was closed before the trial ended"


@contextmanager
def live_viewer(port: int | None, tell: Callable[[str], None]) -> Iterator[tuple[Viewer, int]]:
    """Yield a viewer without a recording, and the port at which it takes chunks.

    port: of a viewer for browsers, with whose address `tell` is called; a window is opened if it is None.
    Raises RecordingError where there is no display for one, or the port is in use.
    """
    if port is not None:
        with web_viewer(port) as (server, address, intake):
            tell(address)
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
    shown_by: Viewer, intake: int, scenario: EmbodiedScenario, seed: int, level: Level, speed: float
) -> Iterator[Callable[[Step, SynchronyWatch], None]]:
    """Yield an onlooker that shows a trial in a viewer, and makes it last as long as it would, divided by `speed`.

    intake: the port at which the viewer takes chunks. Raises RecordingError when the viewer is closed.
    """
    stream = rr.RecordingStream(APPLICATION, recording_id=uuid.uuid4(), send_properties=False)
    layout = make_layout(level, scenario.arena.width_cm, scenario.arena.height_cm)
    stream.connect_grpc(proxy(intake), default_blueprint=layout)
    window_s = REFRESH_S * speed
    recorder = Recorder(scenario, seed, level, window_s, lambda chunks: rr.send_chunks(chunks, recording=stream))
    try:
        yield _Live(recorder, speed, shown_by)
        recorder.finish()
        try:
            stream.flush(timeout_sec=FLUSH_S)
        except RuntimeError as error:
            raise RecordingError(CLOSED) from error
    finally:
        stream.disconnect()


class _Live:
    """An onlooker that records, and keeps the pace."""

    def __init__(self, recorder: Recorder, speed: float, shown_by: Viewer) -> None:
        self._recorder = recorder
        self._speed = speed
        self._viewer = shown_by
        self._began: float | None = None

    def __call__(self, step: Step, watch: SynchronyWatch) -> None:
        """Show a step when its time has come."""
        if self._began is None:
            self._began = time.monotonic()
        early = self._began + step.time_s / self._speed - time.monotonic()
        if early > 0:
            time.sleep(early)
        if self._viewer.has_ended:
            self._viewer.wait()  # which raises if it broke down
            raise RecordingError(CLOSED)
        self._recorder(step, watch)
