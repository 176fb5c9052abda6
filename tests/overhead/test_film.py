"""Films of any kind, whole and damaged, at the times of their own stamps; and those that are written."""

import itertools
import json
import struct
import threading
import weakref
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from epuck_sim.errors import EpuckSimError, FilmError
from epuck_sim.overhead.camera import Frame, Picture
from epuck_sim.overhead.film import KEYFRAME_INTERVAL_S, TICKS_PER_S, FilmClock, FilmWriter, film_file, open_film
from tests.overhead import films as kit
from tests.overhead.films import cut_off, number_in, numbered_picture, write_film, write_packets, write_sound
from tests.tools import no_file_larger_than

UNEVEN = np.cumsum(np.random.default_rng(4).integers(4500, 8000, 60)).tolist()
SHARES = st.floats(0, 1, exclude_max=True)


def read(path) -> tuple[list[float], list[int], list[str]]:
    """Return times, the pictures' numbers, and warnings."""
    with open_film(str(path)) as film:
        frames = [(frame.time_s, number_in(frame.picture)) for frame in film.frames()]
        return [time_s for time_s, _ in frames], [number for _, number in frames], film.warnings


def refusal(path) -> str:
    with pytest.raises(FilmError) as caught, open_film(str(path)):
        pass
    assert str(caught.value).startswith(f"{path}: ")
    return str(caught.value)


@pytest.mark.parametrize("kind", [kit.MP4, kit.MKV, kit.WEBM, kit.TS, kit.GIF, kit.MKV_OF_JPEG], ids=str)
def test_times_are_those_of_the_stamps_from_0_on(tmp_path, kind):
    ticks = [round(stamp / 90_000 / kind.tick_s) for stamp in UNEVEN]
    times = [float((tick - ticks[0]) * kind.tick_s) for tick in ticks]
    assert read(write_film(tmp_path / f"film.{kind.ending}", ticks, kind)) == (times, list(range(60)), [])


KEPT = [number for number in range(60) if number not in {10, 30, 31, 32}]
EVEN = list(range(60))
PLACED, LEFT_OUT = "frames without a time stamp, placed", "frames left out because"


@pytest.mark.parametrize(("write", "kind", "stamps", "times_s", "numbers", "said"), [
    (write_film, kit.AVI, EVEN, np.arange(60) / 15, EVEN, ""),
    # the last frames of a codec that needs later frames first come when there are no stamps any more
    (write_film, kit.AVI_LATER, EVEN, np.arange(60) / 15, EVEN, f"{PLACED} 66.7 ms after the previous one: 2"),
    (write_film, kit.BARE, EVEN, np.arange(60) / 25, EVEN, f"{PLACED} 40 ms after the previous one: 60"),
    (write_packets, kit.MKV, [100, 160, 160, 220, 280, 280, 340], [0, 0.06, 0.12, 0.18, 0.24], [0, 1, 3, 4, 6],
     f"{LEFT_OUT} they have the time stamp of the previous one: 2"),
    (write_packets, kit.MKV, [100, 160, 120, 220, 280], [0, 0.06, 0.12, 0.18], [0, 1, 3, 4],
     f"{LEFT_OUT} their time stamp is before that of the previous one: 1"),
    (write_film, kit.MP4, [6000 * number for number in KEPT], np.array(KEPT) / 15, list(range(56)), ""),
    (write_film, kit.MKV, [20_000 + 60 * number for number in EVEN], 0.06 * np.array(EVEN), EVEN, ""),
])  # fmt: skip
def test_defects_of_time_stamps_are_mended_and_reported(tmp_path, write, kind, stamps, times_s, numbers, said):
    times, found, warnings = read(write(tmp_path / f"film.{kind.ending}", stamps, kind))
    np.testing.assert_allclose(times, times_s, rtol=0, atol=1e-9)
    assert found == numbers
    assert warnings == [said] * bool(said)


def test_what_a_film_says_of_itself_and_films_from_elsewhere_do_not(tmp_path):
    stored = {"epuck_sim": "1.0", "scenario": {"seed": 7}}
    for kind in (kit.MP4, kit.MKV):
        path = write_film(tmp_path / f"film.{kind.ending}", range(0, 90_000, 6000), kind, comment=json.dumps(stored))
        with open_film(str(path)) as film:
            assert (film.name, film.width_px, film.height_px) == (str(path), 64, 48)
            assert film.description == stored
            assert film.duration_s == pytest.approx(15 * 6000 * float(kind.tick_s), rel=0.1)
    for comment in (b"", b'"epuck_sim"', b'{"a": 1}', b"{", b"caf\xe9!"):
        path = write_film(tmp_path / "film.avi", range(9), kit.AVI, comment="*" * len(comment))
        if comment:
            path.write_bytes(path.read_bytes().replace(b"*" * len(comment), comment))
        with open_film(str(path)) as film:
            assert film.description is None, comment


def test_numbered_pictures_and_addresses_and_names_that_look_like_some(here):
    folder = here / "half 50%d"
    folder.mkdir()
    for number in range(7):
        cv2.imwrite(str(folder / f"frame_{9 + number:03}.png"), numbered_picture(number, 61, 43)[..., ::-1])
    with open_film(str(folder / "frame_%03d.png")) as film:
        for number, frame in enumerate(film.frames()):
            assert frame.time_s == pytest.approx(number / 25)
            np.testing.assert_array_equal(frame.picture, numbered_picture(number, 61, 43))
    assert (number, film.is_pictures, film.rate, film.warnings) == (6, True, 25, [])
    path = write_film(here / "take:2 100%.mp4", UNEVEN)
    assert read(path) == read("take:2 100%.mp4") == read(f"file://{path}")


@pytest.mark.parametrize("width_px", [64, 66, 72])
def test_pixels_have_the_colours_that_ffmpeg_gives_them(tmp_path, width_px: int) -> None:
    path = write_film(tmp_path / "film.mkv", range(8), kit.MKV_OF_JPEG, size=(width_px, 48))
    with av.open(path) as container, open_film(str(path)) as film:
        for frame, expected in zip(film.frames(), container.decode(video=0), strict=True):
            np.testing.assert_array_equal(frame.picture, expected.to_ndarray(format="rgb24"))


def test_a_clock_that_is_set_or_begins_anew_goes_on(tmp_path):
    clock = FilmClock(0.1)
    stamps = [Fraction(number, 10) + (1_700_000_000 if number >= 5 else 0) for number in range(10)]
    assert [clock.time_s(stamp) for stamp in stamps] == pytest.approx(np.arange(10) / 10)
    said = ["jumps of the time stamps, across which the film is taken to continue: 1"]
    assert clock.warnings() == said
    path = write_film(tmp_path / "film.ts", range(0, 180_000, 6000), kit.TS)
    path.write_bytes(2 * path.read_bytes())
    times, numbers, warnings = read(path)
    np.testing.assert_allclose(times, np.arange(60) / 15, rtol=0, atol=1e-9)
    assert (numbers, warnings) == (2 * list(range(30)), said)


@given(st.lists(st.none() | st.integers(-(10**6), 10**6)))
def test_times_grow_whatever_the_stamps(ticks):
    clock = FilmClock(1 / 15)
    times = [clock.time_s(None if tick is None else Fraction(tick, 90_000)) for tick in ticks]
    kept = [time_s for time_s in times if time_s is not None]
    assert kept[:1] in ([], [0.0])
    assert all(before < after for before, after in itertools.pairwise(kept))
    assert all(isinstance(warning, str) for warning in clock.warnings())


def test_a_film_that_was_cut_off_or_damaged_says_so(tmp_path, capfd):
    ticks = range(0, 900_000, 6000)
    path = cut_off(write_film(tmp_path / "film.mp4", ticks, options={"movflags": "+faststart"}))
    _, numbers, warnings = read(path)
    assert 25 < len(numbers) < 130
    assert warnings[0].startswith("the film ends early: ")
    assert "of 10.0 s could be read" in warnings[0]
    path = write_film(tmp_path / "film.mkv", range(0, 4000, 67), kit.MKV_OF_JPEG)
    whole = path.read_bytes()
    starts = [at for at in range(len(whole)) if whole.startswith(b"\xff\xd8\xff", at)]
    assert len(starts) == 60
    path.write_bytes(whole[: starts[20]] + bytes(600) + whole[starts[20] + 600 :])
    times, numbers, warnings = read(path)
    assert numbers == [number for number in range(60) if number != 20]
    assert times == pytest.approx([0.067 * number for number in numbers])
    assert warnings[0] == "damaged frames: 1; they were left out or patched from their neighbours"
    assert capfd.readouterr() == ("", "")


def test_what_is_no_film_and_an_mp4_film_without_its_index(tmp_path, capfd):
    (tmp_path / "film.avi").write_bytes(bytes(range(256)) * 20)
    assert "cannot be read as a film" in refusal(tmp_path / "film.avi")
    cv2.imwrite(str(tmp_path / "picture.png"), np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8))
    assert "none of its pictures can be decoded" in refusal(cut_off(tmp_path / "picture.png", 0.01))
    for name, codec in (("song.wav", "pcm_s16le"), ("song.m4a", "aac")):
        assert "holds no moving pictures, only audio" in refusal(write_sound(tmp_path / name, codec))
    path = write_film(tmp_path / "film.mp4", UNEVEN)
    content = path.read_bytes()
    for kept in (-100, 8, 200, 600):  # bytes of the index, or fewer than all before it
        path.write_bytes(content[: content.index(b"moov") - 4 + kept])
        assert "cut off" in refusal(path)
    assert capfd.readouterr() == ("", "")


@pytest.fixture(scope="module", params=[kit.MP4, kit.MKV, kit.AVI, kit.TS], ids=str)
def whole(request, tmp_path_factory) -> tuple[bytes, kit.Kind, int]:
    """Return a film, its kind, and the ticks from one frame to the next."""
    ticks = max(1, round(1 / (15 * request.param.tick_s)))
    path = tmp_path_factory.mktemp("film") / f"f.{request.param.ending}"
    return write_film(path, range(0, 20 * ticks, ticks), request.param).read_bytes(), request.param, ticks


def frames_unless_refused(path) -> list[tuple[float, int]]:
    """Return the times and numbers of a film's pictures; none if it is refused in words."""
    try:
        times, numbers, _ = read(path)
        return list(zip(times, numbers, strict=True))
    except FilmError as error:
        message = str(error)
    assert message.startswith(f"{path}: ")
    return []


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(SHARES, st.integers(1, 255)), min_size=1, max_size=3), SHARES)
def test_a_film_that_is_changed_or_cut_off_ends_in_no_traceback(whole, tmp_path, flips, share):
    content, kind, ticks = whole
    path, damaged = tmp_path / f"f.{kind.ending}", bytearray(content)
    for place, change in flips:
        damaged[int(place * len(damaged))] ^= change
    path.write_bytes(damaged)
    times = [time_s for time_s, _ in frames_unless_refused(path)]
    assert times == sorted(set(times))
    path.write_bytes(content[: int(share * len(content))])
    for time_s, number in frames_unless_refused(path)[:-1]:  # the last one may be half a picture
        assert number == round(time_s / float(ticks * kind.tick_s))


def test_frames_go_on_where_they_were_left_off_are_not_kept_and_must_not_change_their_size(tmp_path):
    path = str(write_film(tmp_path / "film.mp4", UNEVEN))
    numbers, alive, references = [], [], []
    with open_film(path) as film:
        for frame in itertools.chain(itertools.islice(film.frames(), 7), film.frames()):
            numbers.append(number_in(frame.picture))
            references.append(weakref.ref(frame.picture))
            alive.append(sum(picture() is not None for picture in references))
    assert numbers == list(range(60))
    assert max(alive) <= 2
    assert list(film.frames()) == []
    small = write_film(tmp_path / "small.h264", range(5), kit.BARE)
    large = write_film(tmp_path / "large.h264", range(5), kit.BARE, size=(96, 48))
    (tmp_path / "film.h264").write_bytes(small.read_bytes() + large.read_bytes())
    with open_film(str(tmp_path / "film.h264")) as film, pytest.raises(FilmError, match="from 64 x 48 to 96 x 48 px"):
        list(film.frames())


@pytest.mark.parametrize(("matrix", "quarters"), [((0, 1, -1, 0), -1), ((-1, 0, 0, -1), 2), ((0, -1, 1, 0), 1)])
def test_films_are_turned_as_players_turn_them(tmp_path, matrix, quarters) -> None:
    path = tmp_path / "turned.mp4"
    picture = np.zeros((64, 96, 3), np.uint8)
    picture[:32, :32] = 200
    picture[32:, :32] = 90
    with film_file(path, 96, 64, {}) as writer:
        writer.write(Frame(0.0, picture))
    matrices = [[value << 16 for value in each] for each in ((1, 0, 0, 1), matrix)]
    upright, turned = (struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30) for a, b, c, d in matrices)
    whole = path.read_bytes()
    at = whole.index(upright, whole.index(b"tkhd"))
    path.write_bytes(whole[:at] + turned + whole[at + len(upright) :])
    with open_film(str(path)) as film:
        (frame,) = film.frames()
        expected = np.rot90(picture, quarters)
        assert frame.picture.flags.c_contiguous
        assert (film.height_px, film.width_px) == frame.picture.shape[:2] == expected.shape[:2]
        assert np.abs(frame.picture.astype(int) - expected).mean() < 8


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
            frame.picture[:] = 0  # what becomes of it while the encoder still works does not matter
    return path


def decoded(path: Path) -> Iterator[tuple[float, bool, Picture]]:
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
    found = list(decoded(path))
    assert np.abs(np.array([time_s for time_s, *_ in found]) - times).max() <= 0.5001 / TICKS_PER_S
    for number, (*_, picture) in enumerate(found):
        assert np.abs(picture.astype(int) - draw(number)).mean() < 3
        assert (picture[28:32, 20 + number % 50 - 2 : 20 + number % 50 + 2, 0] > 240).all()
    with av.open(path) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.width, stream.height) == SIDE
    assert 0 < path.read_bytes().index(b"moov") < path.read_bytes().index(b"mdat")


def test_same_frames_make_the_same_file_with_keyframes_title_and_frames_closer_than_a_tick(tmp_path: Path) -> None:
    films = set()
    for number in range(6):  # in other places of the memory each time
        films.add(write(tmp_path / "film.mp4", noise(30)).read_bytes())
        np.full((number, 1000, 100), 255, np.uint8)
    assert len(films) == 1
    for description in (DESCRIPTION, DESCRIPTION | {"scenario": "x" * 200_000}, {}):
        with av.open(write(tmp_path / "film.mp4", noise(1), description, "thésis")) as container:
            assert json.loads(container.metadata["comment"]) == description
            assert container.metadata["title"] == "thésis"
    for rate in (0.3, 15.0):
        count, dark = round(2.5 * KEYFRAME_INTERVAL_S * rate), np.zeros_like(draw(0))
        frames = [Frame(number / rate, draw(0) if number % 40 < 8 else dark) for number in range(count)]
        keys = [time_s for time_s, is_key, _ in decoded(write(tmp_path / "film.mp4", frames)) if is_key]
        assert keys == pytest.approx([0, KEYFRAME_INTERVAL_S, 2 * KEYFRAME_INTERVAL_S])
    close = [Frame(time_s, draw(0)) for time_s in (0.0, 1e-6, 2e-6, 1.0)]
    found = decoded(write(tmp_path / "film.mp4", close))
    assert [round(time_s * TICKS_PER_S) for time_s, *_ in found] == [0, 1, 2, TICKS_PER_S]


def test_what_is_no_film_is_refused(tmp_path: Path) -> None:
    odd = ((size, "{} x {} pixels; allowed: even".format(*size)) for size in ((97, 64), (96, 65)))
    for size, why in (*odd, (SIDE, "has no frame")):
        with pytest.raises(FilmError, match=why), film_file(tmp_path / "film.mp4", *size, {}):
            pass
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("frames", [0, 80])
def test_nothing_is_left_after_an_error(tmp_path: Path, frames: int, capfd: pytest.CaptureFixture[str]) -> None:
    before, threads = write(tmp_path / "film.mp4", noise(2)).read_bytes(), threading.active_count()
    with pytest.raises(LookupError), film_file(tmp_path / "film.mp4", *SIDE, {}) as film:  # noqa: PT012 after frames
        for frame in noise(frames):
            film.write(frame)
        raise LookupError
    assert [file.name for file in tmp_path.iterdir()] == ["film.mp4"]
    assert (tmp_path / "film.mp4").read_bytes() == before  # an older film stays
    assert threading.active_count() == threads
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("room", "frames"), [(0, 80), (5_000, 5), (20_000, 80)])  # fewer than may wait, and more
def test_full_disk_is_reported_and_no_thread_stays(tmp_path: Path, room: int, frames: int) -> None:
    threads = threading.active_count()
    refusal = pytest.raises(EpuckSimError, match=r"film\.mp4: cannot be written: \w+")
    with no_file_larger_than(room), refusal:
        write(tmp_path / "film.mp4", noise(frames))
    assert not list(tmp_path.iterdir())
    assert threading.active_count() == threads


@pytest.mark.parametrize("frames", [5, 80])
def test_what_the_encoder_raises_is_raised_where_frames_are_written(tmp_path: Path, monkeypatch, frames: int) -> None:
    monkeypatch.setattr(FilmWriter, "_encode", lambda _, picture: picture and 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write(tmp_path / "film.mp4", noise(frames))
    assert not list(tmp_path.iterdir())
