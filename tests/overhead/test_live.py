"""A camera that is plugged in is tracked while it films; but for the missing one, cameras are imitations."""

import itertools
import signal
import socket
import sys
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np
import pytest

from epuck_sim.errors import FilmError, PortError
from epuck_sim.overhead import live
from epuck_sim.overhead.calibration import RINGS, FilmMetadata, TrackOptions
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.live import LiveCamera, LivePage, UnpluggedError, Watching, track_camera
from epuck_sim.overhead.track import Track
from tests.overhead import films
from tests.overhead.cameras import floor_corners
from tests.overhead.films import LIT, SMALL, TIMES, even, frames_and_description, passed, read_rings, reel, shoot
from tests.processes import start

SIZE = 64, 48  # columns and rows of the pictures that come first


class Imitation:
    """Delivers pictures of blue, green and red levels 1, 2 and 3 + their number, of sizes that are told.

    One that is opened again goes on where the last one stopped.
    """

    opened = True
    one_fails_to_decode = False
    sizes: tuple[tuple[int, int] | None, ...] = (SIZE,) * 5
    """Size of each picture; None where none is delivered, as after the last one."""
    grabbed = 0

    def __init__(self, number: int) -> None:
        self.number = number
        self.released = False
        self.asked: list[int] = []
        Imitation.last = self

    def isOpened(self) -> bool:  # noqa: N802
        return self.opened

    def set(self, _: int, value: int) -> None:
        self.asked.append(value)

    def grab(self) -> bool:
        Imitation.grabbed += 1
        return self.grabbed <= len(self.sizes) and self.sizes[self.grabbed - 1] is not None

    def retrieve(self) -> tuple[bool, np.ndarray | None]:
        if self.one_fails_to_decode:
            return False, None
        columns, rows = self.sizes[self.grabbed - 1] or SIZE
        picture = np.zeros((rows, columns, 3), np.uint8)
        picture[:] = 1, 2, 2 + self.grabbed
        return True, picture

    def release(self) -> None:
        self.released = True


@pytest.fixture
def imitation(monkeypatch) -> type[Imitation]:
    """Let each reading of the clock be a tenth of a second after the previous one, and pauses take none."""
    monkeypatch.setattr(cv2, "VideoCapture", Imitation)
    monkeypatch.setattr(Imitation, "grabbed", 0)
    instants = itertools.count(1000)
    monkeypatch.setattr(live.time, "monotonic", lambda: next(instants) / 10)
    monkeypatch.setattr(live.time, "sleep", lambda _: None)
    return Imitation


def test_frames_are_timed_when_they_come_and_in_red_green_blue(imitation):
    told = []
    with LiveCamera(2, told.append) as camera:
        frames = [*itertools.islice(camera.frames(), 2), *itertools.islice(camera.frames(), 3)]
    assert imitation.last.number == 2
    assert (camera.name, camera.width_px, camera.height_px) == ("camera 2", *SIZE)
    assert [frame.time_s for frame in frames] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    assert [frame.picture[0, 0].tolist() for frame in frames] == [[3 + number, 2, 1] for number in range(5)]
    assert all(frame.picture.shape == (48, 64, 3) and frame.picture.dtype == np.uint8 for frame in frames)
    assert imitation.last.released
    assert (told, camera.warnings, list(camera.frames())) == ([], [], [])


def test_a_camera_that_is_unplugged(imitation):
    told = []
    with LiveCamera(1, told.append) as camera, pytest.raises(UnpluggedError, match="1 delivers no pictures, for 30 s"):
        list(camera.frames())
    assert told == ["camera 1 delivers no pictures; it is tried again for 30 s"]
    assert 100 < imitation.grabbed < 200  # two readings of the clock a try
    assert imitation.last.released


@pytest.mark.parametrize(
    ("fault", "missing", "says"),
    [(None, 3, "delivers no pictures"), ((32, 24), 2, "delivers pictures of 32 x 24 px instead of 64 x 48")],
)
def test_a_camera_that_drops_out_goes_on(imitation, monkeypatch, fault, missing, says):
    monkeypatch.setattr(imitation, "sizes", (SIZE, SIZE, *[fault] * missing, SIZE, SIZE))
    told = []
    with LiveCamera(0, told.append) as camera:
        first = imitation.last
        frames = list(itertools.islice(camera.frames(), 4))
    assert [frame.picture[0, 0, 0] for frame in frames] == [3, 4, 5 + missing, 6 + missing]
    assert imitation.last is not first
    assert first.released
    assert imitation.last.asked == list(SIZE)
    away_s = frames[2].time_s - frames[1].time_s
    assert away_s > 0.3
    assert told == [f"camera 0 {says}; it is tried again for 30 s", f"camera 0 is back after {away_s:.1f} s"]
    assert camera.warnings == [f"camera 0 dropped out from 0.1 to {frames[2].time_s:.1f} s"]


@pytest.mark.parametrize(("name", "value"), [("sizes", ()), ("one_fails_to_decode", True), ("opened", False)])
def test_a_camera_without_a_picture_is_released(imitation, monkeypatch, name, value):
    monkeypatch.setattr(imitation, name, value)
    says = "cannot be opened; allowed: the number of a camera" if name == "opened" else "delivers no picture: does"
    with pytest.raises(FilmError, match=f"camera 3 {says}"):
        LiveCamera(3, print)
    assert imitation.last.released


def test_opencv_itself_says_nothing(capfd):
    level = cv2.utils.logging.getLogLevel()
    with pytest.raises(FilmError, match="camera 97 cannot be opened"):
        LiveCamera(97, print)
    assert capfd.readouterr() == ("", "")
    assert cv2.utils.logging.getLogLevel() == level


CORNERS_PX = floor_corners(films.make_camera())


class Reel:
    """A camera that delivers some frames, and then raises an exception."""

    name = "camera 7"
    width_px, height_px = SMALL["width_px"], SMALL["height_px"]

    def __init__(self, frames: Iterable[Frame], end: BaseException | None = None) -> None:
        self.is_open, self.given = False, 0
        self.warnings: list[str] = []
        given = self._give(frames, end or KeyboardInterrupt())
        self.frames = lambda: given

    def _give(self, frames: Iterable[Frame], end: BaseException) -> Iterator[Frame]:
        for frame in frames:
            self.given += 1
            yield frame
        raise end

    @contextmanager
    def __call__(self, *_: object) -> Iterator[Self]:
        self.is_open = True
        try:
            yield self
        finally:
            self.is_open = False


def watch(camera: Reel, options: TrackOptions, tell: Callable[[str], None] = print, **watching: Any) -> Track:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("epuck_sim.overhead.live.LiveCamera", camera)
        return track_camera(7, options._replace(period_s=1.0), Watching(**watching), passed, tell)


def test_camera_films_until_the_swarm_is_synchronised(tmp_path: Path) -> None:
    camera = Reel(reel())
    table, seen, record = tmp_path / "rings.csv", tmp_path / "seen.mp4", tmp_path / "raw.mp4"
    track = watch(camera, TrackOptions(robots=6, order_parameter=0.99), rings=table, annotate=seen, record=record)
    assert not camera.is_open
    assert (track.film, track.calibration, track.period_s) == ("camera 7", RINGS, 1.0)
    assert track.estimated == ("threshold_ms",)
    assert track.start_s + track.histogram_s == pytest.approx(2.55, abs=1e-3)
    assert camera.given == round(3.05 * 30) + 1
    assert track.times_s[-1] == pytest.approx(3.05, abs=0.04)
    assert len(read_rings(table)) == track.counts.sum()
    assert tuple(len(frames_and_description(each)[0]) for each in (seen, record)) == (track.frames, camera.given)
    told = FilmMetadata.of(frames_and_description(record)[1])
    assert (told.period_s, told.robots, told.arena_cm) == (1.0, 6, None)


def test_a_dark_room_and_an_answer_that_is_believed_are_waited_for_and_said_to_be() -> None:
    times_s, told = even(5.5), []
    camera = Reel(shoot(times_s, films.in_step(times_s, from_s=3), lit_until_s=1 - 1e-9))
    track = watch(camera, TrackOptions(corners_px=CORNERS_PX, robots=6), told.append)
    assert told == ["the room is lit; tracking begins when it is dark, or after 30 s"]
    assert track.start_s == pytest.approx(1)
    assert track.geometry.ring_light > 0
    camera, told = Reel(reel()), []
    track = watch(camera, TrackOptions(robots=12, threshold_ms=50.0), told.append)
    assert (track.histogram_s, track.confidence) == (None, "none")
    assert camera.given == len(TIMES)
    (said,) = told
    assert said.startswith("not yet counted as synchronised: ")


@pytest.mark.parametrize("end", [KeyboardInterrupt(), UnpluggedError("camera 7 delivers no pictures")], ids=repr)
def test_ctrl_c_and_a_camera_that_fails_give_what_is_known_so_far(tmp_path: Path, end: BaseException) -> None:
    camera = Reel(reel()[:70], end)
    camera.warnings.append("camera 7 dropped out from 0.1 to 0.2 s")
    table, seen = tmp_path / "rings.csv", tmp_path / "seen.mp4"
    track = watch(camera, TrackOptions(corners_px=CORNERS_PX, threshold_ms=1.0), rings=table, annotate=seen)
    assert not camera.is_open
    assert (track.threshold_ms, track.histogram_s, track.frames) == (1.0, None, 70)
    assert track.counts.tolist() == LIT[:70].sum(axis=1).tolist()
    assert len(read_rings(table)) == LIT[:70].sum()
    assert len(frames_and_description(seen)[0]) == 70
    ends = [str(end)] if isinstance(end, UnpluggedError) else []
    assert track.warnings == ("camera 7 dropped out from 0.1 to 0.2 s", *ends)


def test_ctrl_c_before_the_calibration_or_a_kill_leaves_the_film(tmp_path: Path) -> None:
    camera = Reel(shoot(even(1), np.zeros((30, 6), bool)))
    outputs = {"rings": tmp_path / "rings.csv", "annotate": tmp_path / "s.mp4", "record": tmp_path / "raw.mp4"}
    with pytest.raises(KeyboardInterrupt):
        watch(camera, TrackOptions(), **outputs)
    assert not camera.is_open
    assert [path.name for path in tmp_path.iterdir()] == ["raw.mp4"]
    assert len(frames_and_description(tmp_path / "raw.mp4")[0]) == 30
    ended = start([sys.executable, "-c", KILLED], cwd=tmp_path, env={"PYTHONPATH": str(Path(__file__).parents[2])})
    assert ended.wait(300) == -signal.SIGKILL
    assert len(read_rings(tmp_path / "rings.csv")) == LIT[:70].sum()
    for name in ("seen.mp4", "raw.mp4"):
        assert 30 <= len(frames_and_description(tmp_path / name)[0]) <= 70  # all but about the last second


KILLED = """
import os, signal
from pathlib import Path
from tests.overhead.test_live import CORNERS_PX, Reel, TrackOptions, reel, watch


def frames():
    yield from reel()[:70]
    os.kill(os.getpid(), signal.SIGKILL)


outputs = {"rings": Path("rings.csv"), "annotate": Path("seen.mp4"), "record": Path("raw.mp4")}
watch(Reel(frames()), TrackOptions(corners_px=CORNERS_PX, threshold_ms=1.0), **outputs)
"""


def test_a_camera_is_shown_on_a_page() -> None:
    told, shown = [], []

    def delivered() -> Iterator[Frame]:
        for frame in reel()[:50]:
            yield frame
            shown.append(read(told[0].split(" ", maxsplit=1)[0] + "film"))

    watch(Reel(delivered()), TrackOptions(corners_px=CORNERS_PX, threshold_ms=1.0), told.append, port=0)
    assert told[0].endswith("/ shows camera 7")
    sizes = {decoded(jpeg).shape for jpeg in shown[:2] + shown[-2:]}
    assert len(sizes) == 2  # waiting, and with the histogram below
    assert len(set(shown)) > 10


def read(address: str, host: str | None = None) -> bytes:
    """Return what a browser on this machine reads, as if it had asked for a host."""
    asked = urllib.request.Request(address, headers={"Host": host} if host else {})
    with urllib.request.urlopen(asked, timeout=20) as answer:
        return bytes(answer.read())


def decoded(jpeg: bytes) -> Any:
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)


def test_a_page_shows_this_machine_alone_the_newest_picture_until_it_ends(capfd: pytest.CaptureFixture[str]) -> None:
    red, before = np.full((40, 60, 3), (200, 0, 0), np.uint8), threading.active_count()
    with LivePage("camera <7>", 0) as page:
        port = int(page.address.split(":")[2].strip("/"))
        assert "<title>camera &lt;7&gt;</title>" in read(page.address, f"localhost:{port}").decode()
        for path in ("", "film"):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                read(page.address + path, "rebound.example")
        assert read(page.address + "film") == b""  # not yet
        page.show(red)
        shown = decoded(read(page.address + "film?1"))
        with pytest.raises(PortError, match=rf"port {port} cannot be used: .*; give another"), LivePage("two", port):
            pass
        assert threading.active_count() > before
        page.show(np.random.default_rng(0).integers(0, 256, (2000, 2000, 3), np.uint8))
        with socket.create_connection(("127.0.0.1", port)) as leaving:  # without reading it
            leaving.send(f"GET /film HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
            leaving.recv(1)
    for thread in threading.enumerate():
        if "process_request_thread" in thread.name:
            thread.join(20)
    assert threading.active_count() == before
    assert capfd.readouterr().err == ""
    assert shown.shape == red.shape
    assert np.abs(shown[:, :, ::-1].astype(int) - red).max() < 10
