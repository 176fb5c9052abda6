"""Tracks a camera while it films, and writes and shows what it sees, until the swarm is synchronised.

The experiments also measured synchrony in real time (thesis 4.3.1).
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, ExitStack, suppress
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, Self

import cv2
import numpy as np

from epuck_sim.errors import FilmError
from epuck_sim.overhead.annotate import Annotator, TrackedFrame
from epuck_sim.overhead.calibration import DESCRIBED, TrackOptions, calibrate
from epuck_sim.overhead.camera import Frame, Picture, ProgressWrapper
from epuck_sim.overhead.film import FilmWriter, film_file
from epuck_sim.overhead.flashes import RingCounter
from epuck_sim.overhead.rings import is_lit
from epuck_sim.overhead.track import Track, analyse, ring_writer, track_frames
from epuck_sim.util.atomic_write import growing_text
from epuck_sim.util.machine import HOST, check_port
from epuck_sim.util.provenance import versions

PATIENCE_S = 30.0  # time for which a camera that drops out is tried again: a loose plug, a hub that restarts
PAUSE_S = 0.5  # time between two tries

HEAD_FRAMES = 90  # frames kept while a camera is calibrated, so that their flashes count: 6 s at 15 frames per second
LIVE_FRAMES = 30  # number of frames in which rings are studied while a live camera waits, once the room is dark
LIVE_LIT_S = 30.0  # time for which a live camera waits for the room to be dark before it is tracked as it is

PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>
<body style="margin:0;background:#111;display:grid;place-items:center;min-height:100vh">
<img src="/film" alt="{title}: rings found, and the histogram" style="max-width:100vw;max-height:100vh"
 onload="setTimeout(() => this.src = '/film?' + Date.now(), 50)"
 onerror="setTimeout(() => this.src = '/film?' + Date.now(), 500)">
</body></html>"""
"""A page that asks for the newest picture again and again, at most 20 times a second."""


class Watching(NamedTuple):
    """Files that are written and views that are shown while a camera films; None for those that are not."""

    record: Path | None = None  # a film of all that the camera delivers, to track it again
    rings: Path | None = None  # a CSV table of all rings in all frames
    annotate: Path | None = None  # a film with the rings found and the histogram drawn
    port: int | None = None  # port of a page that shows the same as `annotate`


def track_camera(
    number: int, options: TrackOptions, watching: Watching, progress: ProgressWrapper, tell: Callable[[str], None]
) -> Track:
    """Track camera `number`, whose oscillators have a known period, until the swarm is synchronised, or until Ctrl-C.

    Files have their names from the beginning, and can be read up to about a second before the last frame, also if the
    process is killed. A camera that drops out is opened again; if it does not come back, that ends the film. `tell` is
    called at once with what happens to the camera, and with why synchrony is not yet believed. FilmError is raised if
    there is no such camera, or it saw no light, and EpuckSimError if a file cannot be written.
    """
    period_s = options.period_s
    assert period_s is not None, "it cannot be estimated while the camera films"
    with LiveCamera(number, tell) as live, ExitStack() as files:
        outputs = _Outputs(live, watching, options, Annotator(live.width_px, live.height_px, period_s), files)
        if outputs.page is not None:
            tell(f"{outputs.page.address} shows {live.name}")
        size_px = live.width_px, live.height_px
        head: deque[Frame] = deque(maxlen=HEAD_FRAMES)  # frames read for the calibration are tracked, too
        waiting = _wait(live, outputs, head, tell)
        counter = RingCounter(calibrate(live.name, size_px, waiting, options, LIVE_FRAMES, LIVE_LIT_S))
        outputs.begin()
        reasons: tuple[str, ...] = ()
        taken = (head.popleft() for _ in range(len(head)))  # and forgotten: pictures are large
        frames = progress(chain(taken, map(outputs.record, live.frames())), None)
        try:
            for tracked in track_frames(frames, counter, period_s, options):
                outputs.write(tracked)
                if tracked.evaluation is None or tracked.histogram_s is None:
                    continue
                track = analyse(live.name, counter.counted(), options, tuple(live.warnings))
                if track.t_sync_s is not None:
                    return track
                if track.reasons != reasons:
                    reasons = track.reasons
                    tell(f"not yet counted as synchronised: {'; '.join(reasons)}")
        except KeyboardInterrupt:
            pass  # the frames until then are analysed
        except UnpluggedError as unplugged:
            live.warnings.append(str(unplugged))
        return analyse(live.name, counter.counted(), options, tuple(live.warnings))


def _wait(live: "LiveCamera", outputs: "_Outputs", head: deque[Frame], tell: Callable[[str], None]) -> Iterator[Frame]:
    """Yield the frames as they arrive, and keep the last ones."""
    for frame in map(outputs.record, live.frames()):
        outputs.show(frame.picture)
        if not head and is_lit(frame.colours):
            tell(f"the room is lit; tracking begins when it is dark, or after {LIVE_LIT_S:g} s")
        head.append(frame)
        yield frame


class _Outputs:
    """Writes and shows the frames of a camera from the first one on, and the rings once tracking begins."""

    def __init__(
        self, live: "LiveCamera", to: Watching, known: TrackOptions, annotator: Annotator, files: ExitStack
    ) -> None:
        self._name, self._to, self._annotator, self._files = live.name, to, annotator, files
        self.page = None if to.port is None else files.enter_context(LivePage(live.name, to.port))
        told = {name: getattr(known, name) for name in DESCRIBED}
        self._film = self._begin_film(to.record, live, {"epuck_sim": versions()["epuck_sim"], **told})

    def _begin_film(self, path: Path | None, of: "LiveCamera | Annotator", told: dict[str, Any]) -> FilmWriter | None:
        if path is None:
            return None
        film = film_file(path, of.width_px, of.height_px, told, self._name, grows=True)
        return self._files.enter_context(film)

    def begin(self) -> None:
        rings = self._to.rings
        self._write_rings = ring_writer(None if rings is None else self._files.enter_context(growing_text(rings)))
        self._annotated = self._begin_film(self._to.annotate, self._annotator, {})

    def record(self, frame: Frame) -> Frame:
        if self._film is not None:
            self._film.write(frame)
        return frame

    def show(self, picture: Picture) -> None:
        if self.page is not None:
            self.page.show(picture)

    def write(self, tracked: TrackedFrame) -> None:
        self._write_rings(tracked.frame, tracked.rings)
        if self._annotated is not None or self.page is not None:
            picture = self._annotator.annotate(tracked)
            self.show(picture)
            if self._annotated is not None:
                self._annotated.write(Frame(tracked.frame.time_s, picture))


class UnpluggedError(FilmError):
    """A camera delivers no pictures any more."""


class LiveCamera(AbstractContextManager["LiveCamera"]):
    """A context manager that keeps a camera open; the film of a camera has no end."""

    width_px = height_px = 0

    def __init__(self, number: int, tell: Callable[[str], None]) -> None:
        """Open a camera, 0 for the first; `tell` reports drop-outs and returns; raise FilmError if it shows nothing."""
        self.name = f"camera {number}"
        self.warnings: list[str] = []  # sentences about the times at which it dropped out
        self._number, self._tell = number, tell
        self._open()
        if not self._capture.isOpened():
            self._capture.release()
            allowed = "the number of a camera that is plugged in (0 for the first), that this user may read"
            raise FilmError(f"{self.name} cannot be opened; allowed: {allowed}, and that no other program uses")
        self._zero_s = time.monotonic()
        try:
            first = self._grab()
        except FilmError:
            self._capture.release()
            raise FilmError(f"{self.name} delivers no picture: does another program use it?") from None
        self._zero_s += first.time_s
        self.height_px, self.width_px = first.picture.shape[:2]
        self._frames = self._read(Frame(0.0, first.picture))

    def __exit__(self, *_: object) -> None:
        self._frames.close()
        self._capture.release()

    def frames(self) -> Iterator[Frame]:
        """Return the frames as they arrive, with their times of arrival; the first is at 0.

        A later call continues with the next frame. A camera that drops out, or delivers pictures of another size, is
        opened again; its frames are missing until then. UnpluggedError is raised after `PATIENCE_S`.
        """
        return self._frames

    def _open(self) -> None:
        logged = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # our message is enough
        try:
            self._capture = cv2.VideoCapture(self._number)
        finally:
            cv2.utils.logging.setLogLevel(logged)

    def _read(self, frame: Frame) -> Generator[Frame]:
        while True:
            yield frame
            try:
                frame = self._grab()
            except FilmError as fault:
                frame = self._try_again(str(fault), frame.time_s)

    def _grab(self) -> Frame:
        """Return the next picture; raise FilmError if there is none, or its size differs from those before."""
        grabbed = self._capture.grab()
        time_s = time.monotonic() - self._zero_s  # before decoding, which takes a varying time
        got, picture = self._capture.retrieve() if grabbed else (False, None)
        if not got or picture is None:
            raise FilmError(f"{self.name} delivers no pictures")
        rows, columns = picture.shape[:2]
        if self.width_px and (columns, rows) != (self.width_px, self.height_px):
            size = f"{self.width_px} x {self.height_px}"
            raise FilmError(f"{self.name} delivers pictures of {columns} x {rows} px instead of {size}")
        return Frame(time_s, cv2.cvtColor(picture, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False))

    def _try_again(self, fault: str, last_s: float) -> Frame:
        """Open the camera again and again, and return the frame that continues the film."""
        self._tell(f"{fault}; it is tried again for {PATIENCE_S:.0f} s")
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            self._capture.release()
            time.sleep(PAUSE_S)
            self._open()
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, self.width_px)
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self.height_px)
            try:
                frame = self._grab()
            except FilmError as error:
                fault = str(error)
                continue
            self.warnings.append(f"{self.name} dropped out from {last_s:.1f} to {frame.time_s:.1f} s")
            self._tell(f"{self.name} is back after {frame.time_s - last_s:.1f} s")
            return frame
        raise UnpluggedError(f"{fault}, for {PATIENCE_S:.0f} s now: was it unplugged, or does another program use it?")


class LivePage(ThreadingHTTPServer):
    """Serves a page with the newest picture of a film, for the duration of a block, to browsers on this machine."""

    daemon_threads = True
    jpeg = b""  # the newest picture, coded; empty before the first one

    def __init__(self, title: str, port: int) -> None:
        """Begin to listen at a port, 0 for any that is free; raise PortError where it cannot be used."""
        check_port(port)
        super().__init__((HOST, port), _Answer)
        self.html = PAGE.format(title=escape(title)).encode()
        self.address = f"http://{HOST}:{self.server_port}/"
        self._thread = threading.Thread(target=self.serve_forever, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()
        self._thread.join()
        self.server_close()

    def show(self, picture: Picture) -> None:
        """Show a picture, (height_px, width_px, 3) levels, in all browsers; those that read slowly miss some."""
        self.jpeg = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes()


class _Answer(BaseHTTPRequestHandler):
    server: LivePage

    def do_GET(self) -> None:
        # a website may let a host name of its own point to this machine
        if self.headers.get("Host") not in [f"{name}:{self.server.server_port}" for name in (HOST, "localhost")]:
            self.send_error(403, "ask for 127.0.0.1 or localhost")
            return
        html = "text/html; charset=utf-8", self.server.html
        kind, content = ("image/jpeg", self.server.jpeg) if self.path.startswith("/film") else html
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        with suppress(OSError):  # the browser has left
            self.end_headers()
            self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Log nothing: the terminal is for messages about the film."""
