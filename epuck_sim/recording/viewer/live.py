"""A trial in the viewer while it runs, at the speed of real robots or a multiple of it."""

import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import rerun as rr

from epuck_sim.embodied.step import Step
from epuck_sim.errors import RecordingError
from epuck_sim.recording.layers.series import recorded_fields
from epuck_sim.recording.level import Level
from epuck_sim.recording.parts import layout_of
from epuck_sim.recording.recorder import Recorder
from epuck_sim.recording.viewer.pace import Pace, Wait, sleep
from epuck_sim.recording.viewer.process import ViewerProcess, in_background
from epuck_sim.recording.viewer.viewer import chunk_stream, has_display, web_viewer
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.util.machine import free_port

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
    scenario: EmbodiedScenario,
    seed: int,
    level: Level,
    speed: float,
    *,
    memory: Sequence[str] = (),
    wait: Wait = sleep,
) -> Iterator[Callable[[Step, SynchronyWatch], None]]:
    """Yield an observer that shows a trial in a viewer, and makes it last as long as it would, divided by `speed`.

    Args:
        viewer: A running viewer.
        intake: The port at which it takes chunks.
        scenario: The trial's scenario.
        seed: The trial's seed.
        level: How much is shown.
        speed: How many times as fast as real robots.
        memory: Fields of the controllers' MEMORY to show, each once.
        wait: Waits between steps; it may return keys, see `viewer.pace`.

    Raises:
        RecordingError: The viewer was closed before the trial ended.
        KeyboardInterrupt: The key that ends the trial was pressed.
    """
    memory = recorded_fields(scenario, level, memory)
    with chunk_stream(intake, str(uuid.uuid4()), layout_of(scenario, level, memory)) as stream:
        recorder = Recorder(
            scenario, seed, level, REFRESH_S * speed, lambda chunks: rr.send_chunks(chunks, recording=stream), memory
        )
        yield _LiveObserver(recorder, Pace(speed, wait), viewer)
        recorder.finish()


class _LiveObserver:
    """An observer that records, and keeps the pace."""

    def __init__(self, recorder: Recorder, pace: Pace, viewer: ViewerProcess) -> None:
        self._recorder = recorder
        self._pace = pace
        self._viewer = viewer

    def __call__(self, step: Step, watch: SynchronyWatch) -> None:
        """Show a step when its time has come; stay there while the trial is paused."""
        self._pace.wait_until(step.time_s)
        self._check_viewer()
        self._recorder(step, watch)
        if self._pace.is_paused:
            self._recorder.flush()
            self._pace.stand_still(self._check_viewer)

    def _check_viewer(self) -> None:
        if self._viewer.has_ended:
            self._viewer.wait()  # which raises if it broke down
            raise RecordingError(CLOSED)
