"""Ways to look at a recording: in a window, in a browser, or as a picture that is drawn without a display.

A trial is shown while it runs, too: at the speed of real robots or a multiple of it, with pauses, or by steps.
"""

import math
import os
import sys
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from PIL import Image
from rerun.chunk import RrdReader

from epuck_sim.errors import RecordingError
from epuck_sim.recording import Level
from epuck_sim.recording.reader import read_layout
from epuck_sim.recording.recorder import Recorder, arrangement_of, make_layout
from epuck_sim.recording.rerun import APPLICATION, TIMELINE, ViewerProcess, in_background, proxy_url
from epuck_sim.recording.series import recorded_fields
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.result import Observer, TrialState
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.machine import HOST, check_port, free_port

PAINT_S = 60  # longest time in which a viewer paints a recording: without a graphics card, it is slow
FLUSH_S = 10.0  # longest time in which a viewer receives the chunks that were sent
MESSAGES_S = 6  # time for which a viewer shows messages after its start

MESSAGE_ROWS, MESSAGE_COLUMNS, MESSAGE_GREY = slice(36, 110), slice(-330, -12), 33
"""Where the viewer of rerun 0.41 shows the first of its messages, px, in a window of any size, and their background."""

NO_DISPLAY = "there is no display here; give --web to look in a browser, or --screenshot FILE.png to draw it"
NOT_LIVE = "there is no display here; give --web to look in a browser, or --record FILE.rrd to look later"


def has_display() -> bool:
    """Return whether a window can be opened."""
    return sys.platform in ("darwin", "win32") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def show(path: Path) -> None:
    """Open a recording in a window and wait until it is closed; raise RecordingError if no window can be opened."""
    if not has_display():
        raise RecordingError(f"{path}: {NO_DISPLAY}")
    with in_background(str(path.resolve()), "--port", "auto") as window:
        window.wait()


def serve(path: Path, port: int, announce: Callable[[str], None]) -> None:
    """Serve a recording to browsers on this machine until Ctrl-C or SIGTERM; call `announce` with the address.

    Raises PortError if the port cannot be used, and RecordingError if the file holds no recording.
    """
    layout = read_layout(path)
    with web_viewer(port) as (server, address, intake), suppress(KeyboardInterrupt):
        try:
            with chunk_stream(intake, RrdReader(path).recordings()[0].recording_id, layout) as stream:
                rr.send_chunks(RrdReader(path).store(), recording=stream)
        except RecordingError as error:
            raise server.error() from error
        announce(address)
        server.wait()


@contextmanager
def web_viewer(port: int) -> Iterator[tuple[ViewerProcess, str, int]]:
    """Yield a viewer for browsers, its address, and the port at which it receives chunks.

    It gets no file: in rerun 0.41 a server with a file keeps a core busy after the end of the file, because it asks the
    finished reader for more without a pause (`re_grpc_server::spawn_from_rx_set`).
    """
    check_port(port)
    intake = free_port()
    with in_background("--serve-web", "--web-viewer-port", str(port), "--port", str(intake)) as server:
        server.wait_for(intake)
        server.wait_for(port)
        yield server, f"http://{HOST}:{port}?url={quote(proxy_url(intake), safe='')}", intake


@contextmanager
def chunk_stream(intake: int, recording_id: str, layout: rrb.Blueprint | None) -> Iterator[rr.RecordingStream]:
    """Yield a stream of chunks to a viewer's port, with a layout; then wait until the viewer has received them all.

    Raises RecordingError if the viewer has ended before.
    """
    stream = rr.RecordingStream(APPLICATION, recording_id=recording_id, send_properties=False)
    stream.connect_grpc(proxy_url(intake), default_blueprint=layout)
    try:
        yield stream
        try:
            stream.flush(timeout_sec=FLUSH_S)
        except RuntimeError as error:
            raise RecordingError("the viewer was closed before it had received everything") from error
    finally:
        stream.disconnect()


def draw_screenshot(path: Path, at_s: float, picture: Path) -> None:
    """Draw what the viewer shows of a recording at a moment of simulated time into a PNG file; this needs no display.

    RecordingError is raised without a graphics driver (a software one such as Mesa's will do), or if the viewer fails.
    """
    from rerun.experimental import ViewerClient  # noqa: PLC0415 changes to this unstable module must break nothing else

    port = free_port()
    hidden = ("--headless", "--window-size", "1600x900", "--hide-welcome-screen", "--port", str(port))
    with atomic_write(picture) as part, in_background(*hidden) as canvas:
        canvas.wait_for(port)
        began = time.monotonic()
        while not part.exists():
            try:
                client, until = ViewerClient.connect(proxy_url(port)), time.monotonic() + PAINT_S
                while client.open(str(path.resolve())).loading and time.monotonic() < until:
                    time.sleep(0.5)
                client.set_time(TIMELINE, duration=at_s, play_state="paused")
                part.write_bytes(_settled(client.take_screenshot))
            except (RuntimeError, ConnectionError, TimeoutError) as error:
                if canvas.has_ended or time.monotonic() > began + PAINT_S:
                    raise canvas.error() from error
                time.sleep(0.5)  # a busy machine may keep it from answering in the client's 15 s


def _settled(take: Callable[[], bytes]) -> bytes:
    """Return the first picture that comes out the same twice after the viewer's first messages have gone.

    Messages stay for a number of painted frames, not of seconds, so that a busy machine shows them for longer.
    """
    began, before = time.monotonic(), b""
    while True:
        now = take()
        corner = np.asarray(Image.open(BytesIO(now)).convert("RGB"))[MESSAGE_ROWS, MESSAGE_COLUMNS]
        shows_message = (corner == MESSAGE_GREY).all(axis=-1).mean() > 0.5
        waited_s = time.monotonic() - began
        if waited_s >= PAINT_S or (waited_s >= MESSAGES_S and now == before and not shows_message):
            return now
        before = now
        time.sleep(0.5)


PAUSE, STEP, END = " ", "n", "q"  # keys that pause or continue the trial, take one step, and end it
MOST_LATE_S = 2.0  # delay beyond which a trial continues from there at its pace; with a smaller one it catches up
REFRESH_S = 0.1  # seconds between two updates of the viewer, and between two looks at it during a pause

Wait = Callable[[float], str]  # waits for a number of seconds, or until keys are pressed, and returns the keys


def sleep(seconds: float) -> str:
    """Wait where there are no keys to press."""
    time.sleep(max(seconds, 0.0))
    return ""


class Pace:
    """The times at which the steps of a trial are due."""

    def __init__(self, speed: float, wait: Wait) -> None:
        """Set the speed of a trial, relative to real robots, and the function that waits between its steps."""
        self._speed = speed
        self._wait = wait
        self._began = -math.inf
        self._steps_wanted = 0
        self.is_paused = False  # whether the trial stops after the step that is due, until a key is pressed

    def wait_until(self, time_s: float) -> None:
        """Wait until this simulated time is to be shown; raise KeyboardInterrupt if `END` is pressed."""
        now, due_s = time.monotonic(), time_s / self._speed
        if now - self._began - due_s > MOST_LATE_S:
            self._began = now - due_s
        self._obey(self._wait(0.0))
        while (early := self._began + due_s - time.monotonic()) > 0:
            self._obey(self._wait(early))

    def stand_still(self, look: Callable[[], None]) -> None:
        """Wait until a paused trial continues or takes one step; call `look` now and then; raise as `wait_until`."""
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
    """Yield a viewer without a recording, and the port at which it receives chunks; raise RecordingError if none opens.

    Browsers find it at `port`, and `announce` is called with their address; a window is opened if there is no port.
    """
    if port is not None:
        with web_viewer(port) as (server, address, intake):
            announce(address)
            yield server, intake
        return
    if not has_display():
        raise RecordingError(NOT_LIVE)
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
    """Yield an observer that shows a trial in a viewer, and makes it last its simulated time, divided by `speed`.

    `intake` is the port at which the viewer receives chunks, `memory` has fields of the controllers' MEMORY to show.
    RecordingError is raised if the viewer was closed before the trial ended, KeyboardInterrupt if `END` was pressed.
    """
    memory, refresh_s = recorded_fields(scenario, level, memory), REFRESH_S * speed
    layout = make_layout(arrangement_of(scenario, level, memory))
    with chunk_stream(intake, str(uuid.uuid4()), layout) as stream:
        send = partial(rr.send_chunks, recording=stream)
        recorder, pace = Recorder(scenario, seed, level, refresh_s, send, memory), Pace(speed, wait)
        look_s = math.inf if isinstance(scenario, EmbodiedScenario) else refresh_s
        shown_s = 0.0

        def check_viewer() -> None:
            if viewer.has_ended:
                viewer.wait()  # raises if the viewer crashed
                raise RecordingError("the viewer was closed before the trial ended")

        def show_at(time_s: float, record: Callable[..., None], *given: Any) -> None:
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
                show_at(moment_s, recorder.catch_up, moment_s)
            show_at(event.time_s, recorder, event, state)

        yield observe
        recorder.finish()
