"""A camera that is plugged in: an imitation, except for the missing one."""

import itertools

import cv2
import numpy as np
import pytest

from epuck_sim.errors import FilmError
from epuck_sim.overhead import live
from epuck_sim.overhead.live import LiveCamera, UnpluggedError

SIZE = 64, 48
"""Columns and rows of the pictures that come first."""


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


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """Let each reading of the clock be a tenth of a second after the previous one, and pauses take none."""
    monkeypatch.setattr(cv2, "VideoCapture", Imitation)
    monkeypatch.setattr(Imitation, "grabbed", 0)
    instants = itertools.count(1000)
    monkeypatch.setattr(live.time, "monotonic", lambda: next(instants) / 10)
    monkeypatch.setattr(live.time, "sleep", lambda _: None)


def test_frames_are_timed_when_they_come_and_in_red_green_blue():
    told = []
    with LiveCamera(2, told.append) as camera:
        frames = [*itertools.islice(camera.frames(), 2), *itertools.islice(camera.frames(), 3)]
    assert Imitation.last.number == 2
    assert (camera.name, camera.width_px, camera.height_px) == ("camera 2", *SIZE)
    assert [frame.time_s for frame in frames] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    assert [frame.picture[0, 0].tolist() for frame in frames] == [[3 + number, 2, 1] for number in range(5)]
    assert all(frame.picture.shape == (48, 64, 3) and frame.picture.dtype == np.uint8 for frame in frames)
    assert Imitation.last.released
    assert (told, camera.warnings, list(camera.frames())) == ([], [], [])


def test_a_camera_that_is_unplugged():
    told = []
    with LiveCamera(1, told.append) as camera, pytest.raises(UnpluggedError, match="1 delivers no pictures, for 30 s"):
        list(camera.frames())
    assert told == ["camera 1 delivers no pictures; it is tried again for 30 s"]
    assert 100 < Imitation.grabbed < 200  # two readings of the clock a try
    assert Imitation.last.released


@pytest.mark.parametrize(
    ("fault", "missing", "says"),
    [(None, 3, "delivers no pictures"), ((32, 24), 2, "delivers pictures of 32 x 24 px instead of 64 x 48")],
)
def test_a_camera_that_drops_out_goes_on(monkeypatch, fault, missing, says):
    monkeypatch.setattr(Imitation, "sizes", (SIZE, SIZE, *[fault] * missing, SIZE, SIZE))
    told = []
    with LiveCamera(0, told.append) as camera:
        first = Imitation.last
        frames = list(itertools.islice(camera.frames(), 4))
    assert [frame.picture[0, 0, 0] for frame in frames] == [3, 4, 5 + missing, 6 + missing]
    assert Imitation.last is not first
    assert first.released
    assert Imitation.last.asked == list(SIZE)
    away_s = frames[2].time_s - frames[1].time_s
    assert away_s > 0.3
    assert told == [f"camera 0 {says}; it is tried again for 30 s", f"camera 0 is back after {away_s:.1f} s"]
    assert camera.warnings == [f"camera 0 dropped out from 0.1 to {frames[2].time_s:.1f} s"]


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("sizes", (), "delivers no picture: does"),
        ("one_fails_to_decode", True, "delivers no picture: does"),
        ("opened", False, "cannot be opened; allowed: the number of a camera"),
    ],
)
def test_a_camera_without_a_picture_is_released(monkeypatch, name, value, says):
    monkeypatch.setattr(Imitation, name, value)
    with pytest.raises(FilmError, match=f"camera 3 {says}"):
        LiveCamera(3, print)
    assert Imitation.last.released


def test_opencv_itself_says_nothing(monkeypatch, capfd):
    monkeypatch.undo()
    level = cv2.utils.logging.getLogLevel()
    with pytest.raises(FilmError, match="camera 97 cannot be opened"):
        LiveCamera(97, print)
    assert capfd.readouterr() == ("", "")
    assert cv2.utils.logging.getLogLevel() == level
