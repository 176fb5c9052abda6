"""A film's file holds the frames at their times, a browser can play it, and nothing half-written is left behind."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.overhead.camera import Frame, Picture
from epuck_sim.overhead.film import KEYFRAME_INTERVAL_S, TICKS_PER_S, film_file

SIDE = (96, 64)
DESCRIPTION = {"epuck_sim": "0.1.0", "seed": 3, "words": 'Ω "quoted" ; = #', "nested": {"list": [1, 2.5, None]}}


def draw(number: int) -> Picture:
    """Return a dark picture with a disc that moves on by a pixel a frame."""
    picture = np.zeros((SIDE[1], SIDE[0], 3), np.uint8)
    return np.asarray(cv2.circle(picture, (20 + number % 50, 30), 8, (255, 120, 100), -1), np.uint8)


def noise(count: int) -> list[Frame]:
    random = np.random.default_rng(0)
    return [Frame(number / 15.5, random.integers(0, 256, (SIDE[1], SIDE[0], 3), np.uint8)) for number in range(count)]


def write(path: Path, frames: list[Frame], description: dict[str, Any] = DESCRIPTION, title: str = "") -> Path:
    with film_file(path, *SIDE, description, title) as film:
        for frame in frames:
            film.write(frame)
    return path


def read(path: Path) -> Iterator[tuple[float, bool, Picture]]:
    with av.open(path) as container:
        for frame in container.decode(video=0):
            assert frame.pts is not None
            assert frame.time_base is not None
            yield float(frame.pts * frame.time_base), frame.key_frame, frame.to_ndarray(format="rgb24")


@pytest.mark.parametrize("first_s", [0.0, 2.34567])
def test_frames_are_read_back_at_their_times_and_browsers_can_play_them(tmp_path: Path, first_s: float) -> None:
    rng = np.random.default_rng(1)
    times = first_s + np.concatenate([[0], np.cumsum(rng.uniform(0.01, 0.4, 59))])  # a camera's are irregular
    path = write(tmp_path / "film.mp4", [Frame(time_s, draw(number)) for number, time_s in enumerate(times)])
    found = list(read(path))
    assert np.abs(np.array([time_s for time_s, *_ in found]) - times).max() <= 0.5001 / TICKS_PER_S
    for number, (*_, picture) in enumerate(found):
        assert np.abs(picture.astype(int) - draw(number)).mean() < 3
        assert (picture[28:32, 20 + number % 50 - 2 : 20 + number % 50 + 2, 0] > 240).all()
    with av.open(path) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.width, stream.height) == SIDE
    assert 0 < path.read_bytes().index(b"moov") < path.read_bytes().index(b"mdat")


@pytest.mark.parametrize("description", [DESCRIPTION, DESCRIPTION | {"scenario": "x" * 200_000}, {}], ids=len)
def test_description_and_title_are_in_the_file(tmp_path: Path, description: dict[str, Any]) -> None:
    with av.open(write(tmp_path / "film.mp4", noise(1), description, "thésis")) as container:
        assert json.loads(container.metadata["comment"]) == description
        assert container.metadata["title"] == "thésis"


def test_same_frames_same_file(tmp_path: Path) -> None:
    films = set()
    for number in range(6):  # in other places of the memory each time
        films.add(write(tmp_path / "film.mp4", noise(30)).read_bytes())
        np.full((number, 1000, 100), 255, np.uint8)
    assert len(films) == 1


@pytest.mark.parametrize("rate", [0.3, 15.0])
def test_keyframes_are_never_far_apart(tmp_path: Path, rate: float) -> None:
    frames = [Frame(number / rate, draw(0)) for number in range(round(2.5 * KEYFRAME_INTERVAL_S * rate))]
    keys = [time_s for time_s, is_key, _ in read(write(tmp_path / "film.mp4", frames)) if is_key]
    assert keys[0] == 0
    assert np.diff([*keys, frames[-1].time_s]).max() <= KEYFRAME_INTERVAL_S + 1 / rate
    assert len(keys) <= max(4, len(frames) / 10)


def test_frames_closer_than_a_tick_follow_one_another(tmp_path: Path) -> None:
    times = [0.0, 1e-6, 2e-6, 1.0]
    found = read(write(tmp_path / "film.mp4", [Frame(time_s, draw(0)) for time_s in times]))
    assert [round(time_s * TICKS_PER_S) for time_s, *_ in found] == [0, 1, 2, TICKS_PER_S]


@pytest.mark.parametrize(
    ("name", "size", "why"),
    [
        ("film.avi", SIDE, r"film\.avi: is not a film's name; allowed: names that end in \.mp4"),
        ("film.mp4", (97, 64), "97 x 64 pixels; allowed: even"),
        ("film.mp4", (96, 65), "96 x 65 pixels; allowed: even"),
        ("film.mp4", SIDE, "has no frame"),
    ],
)
def test_what_is_no_film_is_refused(tmp_path: Path, name: str, size, why: str) -> None:
    with pytest.raises(FilmError, match=why), film_file(tmp_path / name, *size, {}):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("frames", [0, 80])
def test_nothing_is_left_after_an_error(tmp_path: Path, frames: int, capfd: pytest.CaptureFixture[str]) -> None:
    before = write(tmp_path / "film.mp4", noise(2)).read_bytes()

    def fail() -> None:
        with film_file(tmp_path / "film.mp4", *SIDE, {}) as film:
            for frame in noise(frames):
                film.write(frame)
            raise LookupError

    with pytest.raises(LookupError):
        fail()
    assert [file.name for file in tmp_path.iterdir()] == ["film.mp4"]
    assert (tmp_path / "film.mp4").read_bytes() == before  # an older film stays
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("room", [0, 20_000])
def test_full_disk_is_reported(tmp_path: Path, room: int) -> None:
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))
    try:
        with pytest.raises(EpuckSimError, match=r"film\.mp4: cannot be written: \w+"):
            write(tmp_path / "film.mp4", noise(80))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())
