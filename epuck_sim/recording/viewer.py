"""Ways to look at a recording: in a window, in a browser, or as a picture that is drawn without a display."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from epuck_sim.errors import RecordingError
from epuck_sim.recording.process import ViewerProcess, in_background, proxy_url
from epuck_sim.recording.reader import read_layout
from epuck_sim.recording.rrd_file import APPLICATION, TIMELINE
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.machine import HOST, check_port, free_port

PAINT_S = 60  # within which a viewer must paint a recording: without a graphics card, that is slow
FLUSH_S = 10.0  # within which a viewer must take what it was sent
MESSAGES_S = 6  # for which a viewer shows messages after its start

MESSAGE_ROWS, MESSAGE_COLUMNS, MESSAGE_GREY = slice(36, 110), slice(-330, -12), 33
"""Where the viewer of rerun 0.41 shows the first of its messages, px, in a window of any size, and their background."""

NO_DISPLAY = "there is no display here; give --web to look in a browser, or --screenshot FILE.png to have it drawn"


def has_display() -> bool:
    """Return whether a window can be opened."""
    return sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def show(path: Path) -> None:
    """Open a recording in a window and wait until it is closed; raise RecordingError if no window can be opened."""
    if not has_display():
        raise RecordingError(f"{path}: {NO_DISPLAY}")
    with in_background(str(path.resolve()), "--port", "auto") as window:
        window.wait()


def serve(path: Path, port: int, announce: Callable[[str], None]) -> None:
    """Serve a recording to browsers on this machine until Ctrl-C or SIGTERM; `announce` is given the address.

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
    """Yield a viewer for browsers, its address, and the port at which it takes chunks.

    It is given no file: in rerun 0.41 a server that was given one keeps a core busy after the end of the file, because
    it asks the finished reader for more without a pause (`re_grpc_server::spawn_from_rx_set`).
    """
    check_port(port)
    intake = free_port()
    with in_background("--serve-web", "--web-viewer-port", str(port), "--port", str(intake)) as server:
        server.wait_for(intake)
        server.wait_for(port)
        yield server, f"http://{HOST}:{port}?url={quote(proxy_url(intake), safe='')}", intake


@contextmanager
def chunk_stream(intake: int, recording_id: str, layout: rrb.Blueprint | None) -> Iterator[rr.RecordingStream]:
    """Yield a stream of chunks to a viewer at its port, which lays them out as given, and wait until it has them all.

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

    Raises:
        RecordingError: There is no graphics driver (a software one such as Mesa's will do), or the viewer fails.
        EpuckSimError: The picture cannot be written.
    """
    from rerun.experimental import ViewerClient  # noqa: PLC0415 changes to this unstable module must break nothing else

    port = free_port()
    hidden = ("--headless", "--window-size", "1600x900", "--hide-welcome-screen", "--port", str(port))
    with atomic_write(picture) as part, in_background(*hidden) as canvas:
        canvas.wait_for(port)
        until = time.monotonic() + PAINT_S
        while not part.exists():
            try:
                part.write_bytes(_paint(ViewerClient.connect(proxy_url(port)), path, at_s))
            except (RuntimeError, ConnectionError, TimeoutError) as error:
                if canvas.has_ended or time.monotonic() > until:
                    raise canvas.error() from error
                time.sleep(0.5)  # a busy machine may keep it from answering in the client's 15 s


def _paint(client: Any, path: Path, at_s: float) -> bytes:
    """Return what a viewer shows of a recording at a moment, as PNG."""
    until = time.monotonic() + PAINT_S
    while client.open(str(path.resolve())).loading and time.monotonic() < until:
        time.sleep(0.5)
    client.set_time(TIMELINE, duration=at_s, play_state="paused")
    return _settled(client.take_screenshot)


def _settled(take: Callable[[], bytes]) -> bytes:
    """Return the first picture that comes out the same twice after the viewer's first messages have gone.

    Messages stay for a number of painted frames rather than of seconds, so that a busy machine shows them for longer.
    """
    began = time.monotonic()
    before, now = b"", take()
    while time.monotonic() < began + PAINT_S and (
        time.monotonic() < began + MESSAGES_S or now != before or _shows_message(now)
    ):
        time.sleep(0.5)
        before, now = now, take()
    return now


def _shows_message(png: bytes) -> bool:
    """Return whether a picture of the viewer has a message in its upper right corner."""
    picture = np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR))
    corner = picture[MESSAGE_ROWS, MESSAGE_COLUMNS]
    return bool((corner == MESSAGE_GREY).all(axis=-1).mean() > 0.5)
