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
from tests.overhead.cameras import make_set, ring_centroid, standing

SIDE = (96, 64)
DESCRIPTION = {"epuck_sim": "0.1.0", "seed": 3, "words": 'Ω "quoted" ; = #', "nested": {"list": [1, 2.5, None]}}


def draw(number: int) -> Picture:
    """Return a dark picture with a disc that moves on by a pixel a frame."""
    picture = np.zeros((SIDE[1], SIDE[0], 3), np.uint8)
    return np.asarray(cv2.circle(picture, (20 + number % 50, 30), 8, (255, 120, 100), -1), np.uint8)


def make_frames(count: int = 30, first_s: float = 0.0) -> list[Frame]:
    return [Frame(first_s + number / 15.5, draw(number)) for number in range(count)]


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
def test_frames_are_read_back_at_their_times(tmp_path: Path, first_s: float) -> None:
    rng = np.random.default_rng(1)
    times = first_s + np.concatenate([[0], np.cumsum(rng.uniform(0.01, 0.4, 59))])  # a camera's are irregular
    frames = [Frame(time_s, draw(number)) for number, time_s in enumerate(times)]
    found = list(read(write(tmp_path / "film.mp4", frames)))
    assert np.abs(np.array([time_s for time_s, *_ in found]) - times).max() <= 0.5001 / TICKS_PER_S
    for number, (*_, picture) in enumerate(found):
        assert np.abs(picture.astype(int) - draw(number)).mean() < 3
        assert (picture[28:32, 20 + number % 50 - 2 : 20 + number % 50 + 2, 0] > 240).all()


def test_rings_are_read_back_where_they_were(tmp_path: Path) -> None:
    scene = make_set(noise_levels=0)
    places = [(10.0 + 2 * number, 20.0 + 4 * number) for number in range(7)]
    with film_file(tmp_path / "film.mp4", 480, 480, {}) as film:
        for number, (x, y) in enumerate(places):
            picture = scene.renderer.render(standing((x, y, 0.1 * number)), room_is_lit=False)
            film.write(Frame(number / 15, picture))
    for (x, y), (*_, picture) in zip(places, read(tmp_path / "film.mp4"), strict=True):
        picture[picture < 20] = 0
        assert np.hypot(*(ring_centroid(picture, scene.camera) - (x, y))) < 0.05


def test_browser_can_play_it(tmp_path: Path) -> None:
    path = write(tmp_path / "film.mp4", make_frames())
    with av.open(path) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.width, stream.height) == SIDE
        assert container.duration == pytest.approx(30 / 15.5 * 1e6, rel=0.02)
    content = path.read_bytes()
    assert 0 < content.index(b"moov") < content.index(b"mdat")


def test_description_and_title_are_in_the_file(tmp_path: Path) -> None:
    long = DESCRIPTION | {"scenario": "x" * 200_000}
    for description in (DESCRIPTION, long, {}):
        with av.open(write(tmp_path / "film.mp4", make_frames(3), description, "thésis")) as container:
            assert json.loads(container.metadata["comment"]) == description
            assert container.metadata["title"] == "thésis"


def test_same_frames_same_file(tmp_path: Path) -> None:
    noisy = [
        Frame(frame.time_s, frame.picture + np.random.default_rng(number).integers(0, 9, frame.picture.shape, np.uint8))
        for number, frame in enumerate(make_frames())
    ]
    films = set()
    for number in range(6):  # in other places of the memory each time
        films.add(write(tmp_path / "film.mp4", noisy).read_bytes())
        np.full((number, 1000, 100), 255, np.uint8)
    assert len(films) == 1


@pytest.mark.parametrize("rate", [0.3, 15.0])
def test_keyframes_are_never_far_apart(tmp_path: Path, rate: float) -> None:
    frames = [Frame(number / rate, draw(0)) for number in range(round(2.5 * KEYFRAME_INTERVAL_S * rate))]
    keys = [time_s for time_s, is_key, _ in read(write(tmp_path / "film.mp4", frames)) if is_key]
    assert keys[0] == 0
    assert np.diff([*keys, frames[-1].time_s]).max() <= KEYFRAME_INTERVAL_S + 1 / rate


def test_frames_closer_than_a_tick_follow_one_another(tmp_path: Path) -> None:
    times = [0.0, 1e-6, 2e-6, 1.0]
    found = read(write(tmp_path / "film.mp4", [Frame(time_s, draw(0)) for time_s in times]))
    assert [round(time_s * TICKS_PER_S) for time_s, *_ in found] == [0, 1, 2, TICKS_PER_S]


@pytest.mark.parametrize("name", ["film.avi", "film", "film.MP4", ".mp4"])
def test_other_names_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(FilmError, match=r"film.*\.mp4|no name for a film"):
        write(tmp_path / name, make_frames())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", [(97, 64), (96, 65)])
def test_odd_sides_are_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    with (
        pytest.raises(FilmError, match=f"{size[0]} x {size[1]} pixels; allowed: even"),
        film_file(tmp_path / "film.mp4", *size, {}),
    ):
        pass
    assert not list(tmp_path.iterdir())


def test_pictures_of_another_size_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FilmError, match=r"film\.mp4: a picture of shape \(10, 10, 3\)"):
        write(tmp_path / "film.mp4", [Frame(0.0, np.zeros((10, 10, 3), np.uint8))])


def test_film_without_a_frame_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FilmError, match="has no frame"):
        write(tmp_path / "film.mp4", [])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("frames", [0, 3, 80])
def test_nothing_is_left_after_an_error(tmp_path: Path, frames: int, capfd: pytest.CaptureFixture[str]) -> None:
    class MyError(Exception):
        pass

    before = write(tmp_path / "film.mp4", make_frames(2)).read_bytes()

    def fail() -> None:
        with film_file(tmp_path / "film.mp4", *SIDE, {}) as film:
            for frame in make_frames(frames):
                film.write(frame)
            raise MyError

    with pytest.raises(MyError):
        fail()
    assert [file.name for file in tmp_path.iterdir()] == ["film.mp4"]
    assert (tmp_path / "film.mp4").read_bytes() == before  # an older film stays
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("room", [0, 20_000])
def test_full_disk_is_reported(tmp_path: Path, room: int) -> None:
    resource = pytest.importorskip("resource")
    rng = np.random.default_rng(0)
    noise = [Frame(float(n), rng.integers(0, 256, (SIDE[1], SIDE[0], 3), np.uint8)) for n in range(80)]
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, limits[1]))
    try:
        with pytest.raises(EpuckSimError, match=r"film\.mp4: cannot be written: \w+"):
            write(tmp_path / "film.mp4", noise)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())
