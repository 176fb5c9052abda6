"""Ways to look at a recording: in a window, in a browser, or as a picture that is drawn without a display."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import quote

from epuck_sim.errors import RecordingError
from epuck_sim.recording.chunks import TIMELINE
from epuck_sim.recording.viewer.process import HERE, Viewer, check_port, free_port, in_background, proxy
from epuck_sim.util.atomic_write import atomic_write

PAINT_S = 60
"""So long a viewer may take to paint a recording: without a graphics card, that takes seconds."""

MESSAGES_S = 6
"""So long a viewer shows the messages of its start."""

NO_DISPLAY = "there is no display here; give --web to look in a browser, or --screenshot FILE.png to have it drawn"


def has_display() -> bool:
    """Whether a window can be opened."""
    return sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def show(path: Path) -> None:
    """Open a recording in a window, and return when it is closed; raises RecordingError where none can be opened."""
    if not has_display():
        raise RecordingError(f"{path}: {NO_DISPLAY}")
    with in_background(str(path.resolve()), "--port", "auto") as window:
        window.wait()


def serve(path: Path, port: int, tell: Callable[[str], None]) -> None:
    """Serve a recording to browsers on this machine, until Ctrl-C.

    tell: is called with the address. Raises RecordingError where the port is in use.
    """
    with web_viewer(port, str(path.resolve())) as (server, address, _):
        tell(address)
        with suppress(KeyboardInterrupt):
            server.wait()


@contextmanager
def web_viewer(port: int, *paths: str) -> Iterator[tuple[Viewer, str, int]]:
    """Yield a viewer for browsers that shows recordings, its address, and the port at which it takes chunks."""
    check_port(port)
    intake = free_port()
    with in_background(*paths, "--serve-web", "--web-viewer-port", str(port), "--port", str(intake)) as server:
        server.wait_for(intake)
        server.wait_for(port)
        yield server, f"http://{HERE}:{port}?url={quote(proxy(intake), safe='')}", intake


def draw_screenshot(path: Path, at_s: float, picture: Path, size: str = "1600x900") -> None:
    """Draw into a PNG file what the viewer shows of a recording at `at_s` seconds of simulated time.

    Needs no display, but a graphics driver, such as Mesa's; raises RecordingError where there is none.
    """
    from rerun.experimental import ViewerClient  # noqa: PLC0415 what changes there shall hurt nothing else

    port = free_port()
    hidden = ("--headless", "--window-size", size, "--hide-welcome-screen", "--port", str(port))
    with atomic_write(picture) as part, in_background(*hidden) as canvas:
        canvas.wait_for(port)
        try:
            client = ViewerClient.connect(proxy(port))
            until = time.monotonic() + PAINT_S
            while client.open(str(path.resolve())).loading and time.monotonic() < until:
                time.sleep(0.5)
            client.set_time(TIMELINE, duration=at_s, play_state="paused")
            part.write_bytes(_settled(client.take_screenshot))
        except (RuntimeError, ConnectionError, TimeoutError) as error:
            raise canvas.problem() from error


def _settled(take: Callable[[], bytes]) -> bytes:
    """Return a picture that comes out the same twice, when the viewer's first messages have gone."""
    began = time.monotonic()
    before, now = b"", take()
    while time.monotonic() < began + MESSAGES_S or (now != before and time.monotonic() < began + PAINT_S):
        time.sleep(0.5)
        before, now = now, take()
    return now
