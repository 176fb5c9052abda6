"""Tracks a camera while it films: the swarm is watched, and what is seen is written, until it is synchronised.

So the experiments measured synchrony, in real time (thesis 4.3.1).
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import chain
from pathlib import Path
from typing import NamedTuple, Self

import cv2
import numpy as np

from epuck_sim.errors import FilmError
from epuck_sim.overhead.annotate import Annotator
from epuck_sim.overhead.calibration import TrackOptions, calibrate
from epuck_sim.overhead.camera import Frame, Picture, ProgressWrapper
from epuck_sim.overhead.film import FilmWriter, growing_film_file
from epuck_sim.overhead.flashes import RingCounter, TrackedFrame, track_frames
from epuck_sim.overhead.lens import read_lens
from epuck_sim.overhead.light import is_lit
from epuck_sim.overhead.synchrony import is_synchronised
from epuck_sim.overhead.track import RingWriter, Track, analyse, current_threshold_s, ring_writer
from epuck_sim.util.atomic_write import growing_text
from epuck_sim.util.machine import HOST, check_port

PATIENCE_S = 30.0  # time for which a camera that drops out is tried again: a loose plug, a hub that restarts
PAUSE_S = 0.5  # time between two tries

HEAD_FRAMES = 90
"""Number of frames kept while a live camera is calibrated, so that their flashes count: 6 s at 15 frames per second."""

LIVE_FRAMES = 30  # number of frames in which rings are studied while a live camera waits, once the room is dark
LIVE_LIT_S = 30.0  # time for which a live camera waits for the room to be dark before it is tracked as it is

BOUNDARY = "picture"
PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>
<body style="margin:0;background:#111;display:grid;place-items:center;min-height:100vh">
<img src="/film" alt="{title}: rings found, and the histogram" style="max-width:100vw;max-height:100vh">
</body></html>"""

Tell = Callable[[str], None]
"""Tells the user something at once, in a sentence."""


class Watching(NamedTuple):
    """What is written and shown while a camera films; None for what is not."""

    record: Path | None = None
    """A film of all that the camera delivers, to track it again."""
    rings: Path | None = None
    """A CSV table of all rings in all frames."""
    annotate: Path | None = None
    """A film with the rings found and the histogram drawn."""
    port: int | None = None
    """Port of a page that shows the same as `annotate`."""


def track_camera(
    number: int,
    options: TrackOptions,
    watching: Watching,
    progress: ProgressWrapper,
    tell: Tell,
    lens: Path | None = None,
) -> Track:
    """Track a live camera until the swarm is synchronised, or until Ctrl-C.

    Files have their names from the beginning, and can be read up to about a second before the last frame, also if the
    process is killed. A camera that drops out is opened again; if it does not come back, that ends the film.

    Args:
        number: 0 for the first camera.
        options: What is known of the scene; the period of the oscillators must be, while the camera films.
        watching: What is written and shown.
        progress: Shows how long the camera has filmed.
        tell: Tells the user at once what happens to the camera, and why an answer is not believed.
        lens: The file of a calibrated lens.

    Raises:
        FilmError: There is no such camera, it saw no light, or the period is not known.
        EpuckSimError: A file cannot be written.
    """
    period_s = options.period_s
    if period_s is None:
        raise FilmError(f"camera {number}: the period of the oscillators is not known")
    with LiveCamera(number, tell) as live, ExitStack() as files:
        outputs = _Outputs(live, watching, period_s, files, tell)
        size_px = (live.width_px, live.height_px)
        if lens is not None:
            options = options._replace(lens=read_lens(lens, size_px))
        head: deque[Frame] = deque(maxlen=HEAD_FRAMES)  # frames read for the calibration are tracked, too
        waiting = _wait(live, outputs, head, tell)
        counter = RingCounter(calibrate(live.name, size_px, waiting, options, LIVE_FRAMES, LIVE_LIT_S))
        outputs.begin()
        ends: list[str] = []
        reasons: tuple[str, ...] = ()
        later = map(outputs.record, _until_unplugged(live.frames(), ends))
        frames = progress(chain(_taken(head), later), None)

        def threshold_s() -> float:
            return current_threshold_s(counter, period_s, options)

        def steady(time_s: float) -> int:
            return counter.lit_since(time_s - period_s / 2)

        try:
            for tracked in track_frames(frames, counter, period_s, threshold_s, steady):
                outputs.write(tracked)
                if tracked.evaluation is None or not is_synchronised(tracked.evaluation, threshold_s()):
                    continue
                track = analyse(live.name, counter.counted(), options, tuple(live.warnings))
                if track.t_sync_s is not None:
                    return track
                if track.reasons != reasons:
                    reasons = track.reasons
                    tell(f"not yet believed to be synchronised: {'; '.join(reasons)}")
        except KeyboardInterrupt:
            pass  # the frames until then are analysed
        return analyse(live.name, counter.counted(), options, (*live.warnings, *ends))


def _wait(live: "LiveCamera", outputs: "_Outputs", head: deque[Frame], tell: Tell) -> Iterator[Frame]:
    """Yield the frames as they arrive, and keep the last ones."""
    for frame in map(outputs.record, live.frames()):
        outputs.show(frame.picture)
        if not head and is_lit(frame.picture):
            tell(f"the room is lit; tracking begins when it is dark, or after {LIVE_LIT_S:g} s")
        head.append(frame)
        yield frame


def _taken(head: deque[Frame]) -> Iterator[Frame]:
    """Yield frames that were kept, and forget them: pictures are large."""
    while head:
        yield head.popleft()


def _until_unplugged(frames: Iterable[Frame], ends: list[str]) -> Iterator[Frame]:
    """Yield a camera's frames; if the camera fails for good, end and say so."""
    try:
        yield from frames
    except FilmError as error:
        ends.append(str(error))


class _Outputs:
    """Writes and shows what a camera films, from its first frame on; its files are closed with a stack."""

    def __init__(self, live: "LiveCamera", to: Watching, period_s: float, files: ExitStack, tell: Tell) -> None:
        self._name, self._to, self._files = live.name, to, files
        size_px = (live.width_px, live.height_px)
        self._annotator = Annotator(*size_px, period_s)
        self._page: LivePage | None = None
        self._film: FilmWriter | None = None
        self._annotated: FilmWriter | None = None
        self._write_rings: RingWriter | None = None
        if to.port is not None:
            self._page = files.enter_context(live_page(live.name, to.port))
            tell(f"{self._page.address} shows {live.name}")
        if to.record is not None:
            self._film = files.enter_context(growing_film_file(to.record, *size_px, live.name))

    def record(self, frame: Frame) -> Frame:
        """Write a frame as it comes from the camera, and return it."""
        if self._film is not None:
            self._film.write(frame)
        return frame

    def show(self, picture: Picture) -> None:
        """Show a picture on the page."""
        if self._page is not None:
            self._page.show(picture)

    def begin(self) -> None:
        """Begin the files of what is found."""
        to, size_px = self._to, (self._annotator.width_px, self._annotator.height_px)
        if to.rings is not None:
            self._write_rings = ring_writer(self._files.enter_context(growing_text(to.rings)))
        if to.annotate is not None:
            self._annotated = self._files.enter_context(growing_film_file(to.annotate, *size_px, self._name))

    def write(self, tracked: TrackedFrame) -> None:
        """Write and show a frame with what was found in it."""
        if self._write_rings is not None:
            self._write_rings(tracked.frame, tracked.rings)
        if self._annotated is None and self._page is None:
            return
        picture = self._annotator.annotate(tracked)
        self.show(picture)
        if self._annotated is not None:
            self._annotated.write(Frame(tracked.frame.time_s, picture))


class LiveCamera:
    """A context manager that keeps a camera open; the film of a camera has no end.

    >>> with LiveCamera(0, print) as camera:  # doctest: +SKIP
    ...     for frame in camera.frames():
    ...         print(frame.time_s, frame.picture.mean())
    """

    name: str
    width_px: int
    height_px: int
    warnings: list[str]
    """When it dropped out."""

    def __init__(self, number: int, tell: Tell) -> None:
        """Open a camera, 0 for the first one; the user is told when it drops out and when it is back.

        Raises:
            FilmError: The camera cannot be opened, or delivers no picture.
        """
        self.name = f"camera {number}"
        self.warnings = []
        self._number, self._tell = number, tell
        if number < 0:
            raise FilmError(f"{self.name} cannot be opened; allowed: 0 for the first camera, 1 for the second ...")
        self._open()
        if not self._capture.isOpened():
            self._capture.release()
            raise FilmError(
                f"{self.name} cannot be opened; allowed: the number of a camera that is plugged in, 0 for the first, "
                "which this user may read and no other program uses"
            )
        self._zero_s = time.monotonic()
        first = self._grab()
        if first is None:
            self._capture.release()
            raise FilmError(f"{self.name} delivers no picture: does another program use it?")
        self._zero_s += first.time_s
        self.height_px, self.width_px = first.picture.shape[:2]
        self._frames = self._read(Frame(0.0, first.picture))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._frames.close()
        self._capture.release()

    def frames(self) -> Iterator[Frame]:
        """Return the frames as they arrive, with their times of arrival; the first is at 0.

        A later call continues with the next frame. A camera that drops out, or delivers pictures of another size, is
        opened again; its frames are missing until then.

        Raises:
            FilmError: The camera has delivered no more such pictures for `PATIENCE_S`.
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
            last_s = frame.time_s
            next_frame = self._grab()
            fault = self._fault(next_frame)
            frame = self._try_again(fault, last_s) if next_frame is None or fault else next_frame

    def _grab(self) -> Frame | None:
        """Return the next picture of any size; None if there is none."""
        grabbed = self._capture.grab()
        time_s = time.monotonic() - self._zero_s  # before decoding, which takes a varying time
        got, picture = self._capture.retrieve() if grabbed else (False, None)
        if not got or picture is None:
            return None
        return Frame(time_s, cv2.cvtColor(picture, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False))

    def _fault(self, frame: Frame | None) -> str:
        """Return what is wrong with a frame; nothing if it continues the film."""
        if frame is None:
            return "delivers no pictures"
        rows, columns = frame.picture.shape[:2]
        if (columns, rows) == (self.width_px, self.height_px):
            return ""
        return f"delivers pictures of {columns} x {rows} px instead of {self.width_px} x {self.height_px}"

    def _try_again(self, fault: str, last_s: float) -> Frame:
        """Open the camera again and again, and return the frame that continues the film."""
        self._tell(f"{self.name} {fault}; it is tried again for {PATIENCE_S:.0f} s")
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            self._capture.release()
            time.sleep(PAUSE_S)
            self._open()
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, self.width_px)
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self.height_px)
            frame = self._grab()
            fault = self._fault(frame)
            if frame is not None and not fault:
                self.warnings.append(f"{self.name} dropped out from {last_s:.1f} to {frame.time_s:.1f} s")
                self._tell(f"{self.name} is back after {frame.time_s - last_s:.1f} s")
                return frame
        raise FilmError(
            f"{self.name} {fault}, for {PATIENCE_S:.0f} s now: was it unplugged, or does another program use it?"
        )


class LivePage:
    """The newest picture of a film, for browsers that wait for it; `live_page` makes one."""

    address: str
    """Where browsers find it."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._jpeg = b""
        self._number = 0
        self._is_over = False

    def end(self) -> None:
        """Let go of all browsers."""
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    def show(self, picture: Picture) -> None:
        """Show a picture, (height_px, width_px, 3) levels, in all browsers."""
        coded = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes()
        with self._changed:
            self._jpeg, self._number = coded, self._number + 1
            self._changed.notify_all()

    def pictures(self) -> Iterator[bytes]:
        """Yield the newest picture, as JPEG, whenever there is a newer one, to the end; a slow reader misses some."""
        seen = 0
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._is_over or self._number > seen)  # noqa: B023 - called at once
                if self._is_over:
                    return
                seen, jpeg = self._number, self._jpeg
            yield jpeg


@contextmanager
def live_page(title: str, port: int) -> Iterator[LivePage]:
    """Serve a page with the newest picture to browsers on this machine; port: where, 0 for any that is free.

    Raises:
        PortError: The port cannot be used.
    """
    page = LivePage()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            # a page of the web may have a name of its own that leads to this machine
            if self.headers.get("Host") not in [f"{name}:{server.server_port}" for name in (HOST, "localhost")]:
                self.send_error(403, "ask for 127.0.0.1 or localhost")
            elif self.path == "/film":
                self._send_film()
            elif self.path == "/":
                self._begin("text/html; charset=utf-8")
                self.wfile.write(PAGE.format(title=escape(title)).encode())
            else:
                self.send_error(404)

        def _begin(self, kind: str) -> None:
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Cache-Control", "no-store")
            self.end_headers()

        def _send_film(self) -> None:
            self._begin(f"multipart/x-mixed-replace; boundary={BOUNDARY}")
            try:
                for jpeg in page.pictures():
                    head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                    self.wfile.write(head.encode() + jpeg + b"\r\n")
            except OSError:
                pass  # the browser has left

        def log_message(self, *_: object) -> None:
            """Keep the terminal for what is told of the film."""

    check_port(port)
    server = ThreadingHTTPServer((HOST, port), Handler)
    page.address = f"http://{HOST}:{server.server_address[1]}/"
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield page
    finally:
        page.end()
        server.shutdown()
        server.server_close()
        thread.join()
