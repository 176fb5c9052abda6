"""A camera that is plugged in: an imitation, except for the missing one."""

import itertools

import cv2
import numpy as np
import pytest

from epuck_sim.errors import FilmError
from epuck_sim.overhead.film import live_camera
from epuck_sim.overhead.film.live_camera import LiveCamera


class Imitation:
    """Delivers `pictures` pictures of blue, green and red levels 1, 2 and 3 + their number."""

    opened = True
    pictures = 5
    one_fails_to_decode = False

    def __init__(self, number: int) -> None:
        self.number = number
        self.grabbed = 0
        self.released = False
        Imitation.last = self

    def isOpened(self) -> bool:  # noqa: N802
        return self.opened

    def grab(self) -> bool:
        self.grabbed += 1
        return self.grabbed <= self.pictures

    def retrieve(self) -> tuple[bool, np.ndarray | None]:
        if self.one_fails_to_decode:
            return False, None
        picture = np.zeros((48, 64, 3), np.uint8)
        picture[:] = 1, 2, 2 + self.grabbed
        return True, picture

    def release(self) -> None:
        self.released = True


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """Let each reading of the clock be a tenth of a second after the previous one."""
    monkeypatch.setattr(cv2, "VideoCapture", Imitation)
    instants = itertools.count(1000)
    monkeypatch.setattr(live_camera.time, "monotonic", lambda: next(instants) / 10)


def test_frames_are_timed_when_they_come_and_in_red_green_blue():
    with LiveCamera(2) as camera:
        frames = list(itertools.islice(camera.frames(), 5))

    assert Imitation.last.number == 2
    assert camera.name == "camera 2"
    assert (camera.width_px, camera.height_px) == (64, 48)
    assert [frame.time_s for frame in frames] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    assert [frame.picture[0, 0].tolist() for frame in frames] == [[3 + number, 2, 1] for number in range(5)]
    assert all(frame.picture.shape == (48, 64, 3) and frame.picture.dtype == np.uint8 for frame in frames)
    assert Imitation.last.released


def test_frames_go_on_where_they_were_left_off():
    with LiveCamera(0) as camera:
        first = list(itertools.islice(camera.frames(), 2))
        then = next(camera.frames())

    assert [frame.picture[0, 0, 0] for frame in [*first, then]] == [3, 4, 5]
    assert list(camera.frames()) == []


def test_a_camera_that_is_unplugged():
    with LiveCamera(1) as camera, pytest.raises(FilmError, match="camera 1 delivers no more pictures"):
        list(camera.frames())

    assert Imitation.last.grabbed == 6
    assert Imitation.last.released


@pytest.mark.parametrize(("name", "value"), [("pictures", 0), ("one_fails_to_decode", True)])
def test_a_camera_without_a_picture_is_released(monkeypatch, name, value):
    monkeypatch.setattr(Imitation, name, value)

    with pytest.raises(FilmError, match="camera 0 delivers no more pictures"):
        LiveCamera(0)

    assert Imitation.last.released


def test_a_camera_that_cannot_be_opened(monkeypatch):
    monkeypatch.setattr(Imitation, "opened", False)

    with pytest.raises(FilmError, match="camera 3 cannot be opened; allowed: the number of a camera"):
        LiveCamera(3)

    assert Imitation.last.released


def test_numbers_below_0_are_refused():
    with pytest.raises(FilmError, match="camera -1 cannot be opened; allowed: 0 for the first"):
        LiveCamera(-1)


def test_opencv_itself_says_nothing(monkeypatch, capfd):
    monkeypatch.undo()
    level = cv2.utils.logging.getLogLevel()

    with pytest.raises(FilmError, match="camera 97 cannot be opened"):
        LiveCamera(97)

    assert capfd.readouterr() == ("", "")
    assert cv2.utils.logging.getLogLevel() == level
