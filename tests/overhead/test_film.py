"""Films of any kind, whole and damaged, at the times of their own stamps."""

import itertools
import json
import struct
import weakref
from fractions import Fraction

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.film import FilmClock, film_file, open_film
from tests.overhead import small_films as kit
from tests.overhead.small_films import cut_off, number_in, numbered_picture, write_film, write_packets, write_sound

UNEVEN = np.cumsum(np.random.default_rng(4).integers(4500, 8000, 60)).tolist()


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

    times, numbers, warnings = read(write_film(tmp_path / f"film.{kind.ending}", ticks, kind))

    assert times == [float((tick - ticks[0]) * kind.tick_s) for tick in ticks]
    assert numbers == list(range(60))
    assert warnings == []


@pytest.mark.parametrize(("kind", "unstamped"), [(kit.AVI, 0), (kit.AVI_OUT_OF_ORDER, 2)], ids=str)
def test_frames_of_avi_films_are_in_order(tmp_path, kind, unstamped):
    """The last frames of one whose codec needs later frames first come when there are no stamps any more."""
    times, numbers, warnings = read(write_film(tmp_path / "film.avi", range(60), kind))

    np.testing.assert_allclose(times, np.arange(60) / 15, rtol=0, atol=1e-9)
    assert numbers == list(range(60))
    said = [f"frames without a time stamp, placed 66.7 ms after the previous one: {unstamped}"]
    assert warnings == (said if unstamped else [])


def test_a_film_without_stamps_has_the_rate_it_says(tmp_path):
    times, numbers, warnings = read(write_film(tmp_path / "film.h264", range(30), kit.BARE))

    np.testing.assert_allclose(times, np.arange(30) / 25, rtol=0, atol=1e-9)
    assert numbers == list(range(30))
    assert warnings == ["frames without a time stamp, placed 40 ms after the previous one: 30"]


def test_what_a_film_says_of_itself(tmp_path):
    stored = {"epuck_sim": "1.0", "scenario": {"seed": 7}}
    for kind in (kit.MP4, kit.MKV):
        path = write_film(tmp_path / f"film.{kind.ending}", range(0, 90_000, 6000), kind, comment=json.dumps(stored))
        with open_film(str(path)) as film:
            assert film.name == str(path)
            assert (film.width_px, film.height_px) == (64, 48)
            assert film.description == stored
            assert film.duration_s == pytest.approx(15 * 6000 * float(kind.tick_s), rel=0.1)


@pytest.mark.parametrize("comment", ["", "a day at the sea", "[1]", '"epuck_sim"', '{"a": 1}', "{"])
def test_films_from_elsewhere_have_no_description(tmp_path, comment):
    with open_film(str(write_film(tmp_path / "film.mp4", range(0, 90_000, 6000), comment=comment))) as film:
        assert film.description is None


def test_a_comment_in_another_encoding_does_no_harm(tmp_path):
    path = write_film(tmp_path / "film.avi", range(9), kit.AVI, comment="caffe")
    path.write_bytes(path.read_bytes().replace(b"caffe", b"caf\xe9!"))

    with open_film(str(path)) as film:
        assert film.description is None


@pytest.mark.parametrize("kind", [kit.AVI, kit.GIF, kit.MKV_OF_JPEG], ids=str)
def test_sides_may_be_odd(tmp_path, kind):
    path = write_film(tmp_path / f"film.{kind.ending}", [0, 50, 100], kind, size=(81, 67))

    with open_film(str(path)) as film:
        pictures = [frame.picture for frame in film.frames()]

    assert (film.width_px, film.height_px) == (81, 67)
    for number, picture in enumerate(pictures):
        assert picture.dtype == np.uint8
        assert picture.flags.c_contiguous
        assert np.abs(picture.astype(int) - numbered_picture(number, 81, 67)).mean() < 15


def test_numbered_pictures(tmp_path):
    for number in range(7):
        cv2.imwrite(str(tmp_path / f"frame_{number:03}.png"), numbered_picture(number, 61, 43)[..., ::-1])

    with open_film(str(tmp_path / "frame_%03d.png")) as film:
        frames = list(film.frames())

    assert [frame.time_s for frame in frames] == pytest.approx([number / 25 for number in range(7)])
    for number, frame in enumerate(frames):
        np.testing.assert_array_equal(frame.picture, numbered_picture(number, 61, 43))
    (warning,) = film.warnings
    assert "25 frames per second are assumed" in warning
    assert f"ffmpeg -framerate RATE -i {tmp_path}/frame_%03d.png" in warning


@pytest.mark.parametrize("levels", ["grey", "16 bits", "alpha"])
def test_pictures_of_any_depth_are_turned_into_red_green_blue(tmp_path, levels):
    picture = numbered_picture(5)[..., ::-1]
    stored = {
        "grey": picture[..., 1],
        "16 bits": picture.astype(np.uint16) * 257,
        "alpha": np.dstack([picture, np.full(picture.shape[:2], 99, np.uint8)]),
    }[levels]
    cv2.imwrite(str(tmp_path / "picture.png"), stored)

    with open_film(str(tmp_path / "picture.png")) as film:
        (frame,) = film.frames()

    expected = np.repeat(stored[..., None], 3, axis=2) if levels == "grey" else picture[..., ::-1]
    assert np.abs(frame.picture.astype(int) - expected).max() <= 1


def test_doubled_frames_are_left_out(tmp_path):
    times, numbers, warnings = read(write_packets(tmp_path / "film.mkv", [100, 160, 160, 220, 280, 280, 280, 340]))

    assert times == [0, 0.06, 0.12, 0.18, 0.24]
    assert numbers == [0, 1, 3, 4, 7]
    assert warnings == ["frames left out because they have the time stamp of the previous one: 3"]


def test_frames_out_of_order_are_left_out(tmp_path):
    times, numbers, warnings = read(write_packets(tmp_path / "film.mkv", [100, 160, 120, 220, 280]))

    assert times == [0, 0.06, 0.12, 0.18]
    assert numbers == [0, 1, 3, 4]
    assert warnings == ["frames left out because their time stamp is before that of the previous one: 1"]


def test_dropped_frames_are_reported(tmp_path):
    kept = [number for number in range(60) if number not in {10, 30, 31, 32}]

    times, _, warnings = read(write_film(tmp_path / "film.mp4", [6000 * number for number in kept]))

    np.testing.assert_allclose(times, np.array(kept) / 15, rtol=0, atol=1e-9)
    assert warnings == [
        "gaps longer than 1.5 times the usual 66.7 ms between frames: 2, the longest 0.267 s; frames were dropped"
    ]


def test_a_clock_that_is_set_goes_on():
    clock = FilmClock(Fraction(1, 10))
    stamps = [Fraction(number, 10) + (1_700_000_000 if number >= 5 else 0) for number in range(10)]
    assert [clock.time_s(stamp) for stamp in stamps] == pytest.approx(np.arange(10) / 10)
    assert clock.warnings() == ["jumps of the time stamps, across which the film is taken to continue: 1"]


def test_a_clock_that_begins_anew_goes_on(tmp_path):
    path = write_film(tmp_path / "film.ts", range(0, 180_000, 6000), kit.TS)
    path.write_bytes(2 * path.read_bytes())

    times, numbers, warnings = read(path)

    np.testing.assert_allclose(times, np.arange(60) / 15, rtol=0, atol=1e-9)
    assert numbers == 2 * list(range(30))
    assert warnings == ["jumps of the time stamps, across which the film is taken to continue: 1"]


@given(st.lists(st.none() | st.integers(-(10**6), 10**6)))
def test_times_grow_whatever_the_stamps(ticks):
    clock = FilmClock(Fraction(1, 15))
    times = [clock.time_s(None if tick is None else Fraction(tick, 90_000)) for tick in ticks]
    kept = [time_s for time_s in times if time_s is not None]

    assert kept[:1] in ([], [0.0])
    assert all(before < after for before, after in itertools.pairwise(kept))
    assert all(isinstance(warning, str) for warning in clock.warnings())


@pytest.mark.parametrize(
    ("kind", "options"), [(kit.MP4, {"movflags": "+faststart"}), (kit.MKV, {}), (kit.AVI, {})], ids=str
)
def test_a_film_that_was_cut_off_is_read_as_far_as_it_goes(tmp_path, capfd, kind, options):
    ticks = [round(number / 15 / kind.tick_s) for number in range(150)]
    path = cut_off(write_film(tmp_path / f"film.{kind.ending}", ticks, kind, options=options))

    times, numbers, warnings = read(path)

    assert 25 < len(numbers) < 130
    whole = len(numbers) - 3  # the decoder patches up the last ones
    assert numbers[:whole] == list(range(whole))
    np.testing.assert_allclose(times[:whole], np.arange(whole) / 15, rtol=0, atol=float(kind.tick_s))
    assert warnings[0].startswith("the film ends early: ")
    assert "of 10.0 s could be read" in warnings[0]
    assert capfd.readouterr() == ("", "")


def test_frames_that_cannot_be_decoded_are_counted(tmp_path, capfd):
    path = write_film(tmp_path / "film.mkv", range(0, 4000, 67), kit.MKV_OF_JPEG)
    whole = path.read_bytes()
    starts = [at for at in range(len(whole)) if whole.startswith(b"\xff\xd8\xff", at)]
    assert len(starts) == 60
    path.write_bytes(whole[: starts[20]] + bytes(600) + whole[starts[20] + 600 :])
    assert starts[21] - starts[20] > 600

    times, numbers, warnings = read(path)

    assert numbers == [number for number in range(60) if number != 20]
    assert times == pytest.approx([0.067 * number for number in numbers])
    assert warnings[0] == "damaged frames: 1; they were left out or patched from their neighbours"
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("kept", [-100, 8, 200, 600])
def test_an_mp4_film_without_its_index(tmp_path, capfd, kept):
    """It is cut off before its index, or after some bytes of it."""
    path = write_film(tmp_path / "film.mp4", UNEVEN)
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.index(b"moov") - 4 + kept])

    message = refusal(path)

    assert "cut off" in message
    assert "record" in message
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("film.mp4", b"", "is empty"),
        ("film.mp4", b"Dear diary,\nit rained.\n" * 40, "cannot be read as a film"),
        ("film.txt", b"Dear diary,\nit rained.\n" * 40, "is a text file, not a film"),
        ("film.avi", bytes(range(256)) * 20, "cannot be read as a film"),
    ],
)
def test_files_that_are_no_films(tmp_path, capfd, name, content, said):
    (tmp_path / name).write_bytes(content)

    assert said in refusal(tmp_path / name)
    assert capfd.readouterr() == ("", "")


def test_a_picture_that_cannot_be_decoded(tmp_path):
    cv2.imwrite(str(tmp_path / "picture.png"), np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8))

    assert "none of its pictures can be decoded" in refusal(cut_off(tmp_path / "picture.png", 0.01))


def test_names_of_nothing(tmp_path):
    assert "no such file" in refusal(tmp_path / "none.mp4")
    assert "no such file" in refusal(tmp_path / "frame_%04d.png")
    assert "numbered pictures" in refusal(tmp_path)
    assert "Protocol not found" in refusal("nonsense://film.mp4")


def test_sound_is_no_film(tmp_path):
    assert "holds no moving pictures, only audio" in refusal(write_sound(tmp_path / "song.wav"))


def test_addresses_and_names_that_look_like_some(tmp_path, monkeypatch):
    path = write_film(tmp_path / "take:2 100%.mp4", UNEVEN)
    monkeypatch.chdir(tmp_path)

    assert read(path) == read("take:2 100%.mp4") == read(f"file://{path}")


def test_the_size_of_the_pictures_must_not_change(tmp_path):
    small = write_film(tmp_path / "small.h264", range(5), kit.BARE)
    large = write_film(tmp_path / "large.h264", range(5), kit.BARE, size=(96, 48))
    (tmp_path / "film.h264").write_bytes(small.read_bytes() + large.read_bytes())

    with open_film(str(tmp_path / "film.h264")) as film, pytest.raises(FilmError, match="from 64 x 48 to 96 x 48 px"):
        list(film.frames())


def test_frames_go_on_where_they_were_left_off(tmp_path):
    with open_film(str(write_film(tmp_path / "film.mp4", UNEVEN))) as film:
        first = list(itertools.islice(film.frames(), 7))
        rest = list(film.frames())

    assert [number_in(frame.picture) for frame in first + rest] == list(range(60))
    assert list(film.frames()) == []


def test_a_film_that_is_left_early_has_no_more_frames(tmp_path):
    with open_film(str(write_film(tmp_path / "film.mp4", UNEVEN))) as film:
        next(film.frames())

    assert list(film.frames()) == []
    assert film.warnings == []


def test_pictures_are_not_kept(tmp_path):
    alive = []
    with open_film(str(write_film(tmp_path / "film.mp4", UNEVEN))) as film:
        references = []
        for frame in film.frames():
            references.append(weakref.ref(frame.picture))
            alive.append(sum(picture() is not None for picture in references))

    assert max(alive) <= 2


@pytest.mark.parametrize(
    ("matrix", "quarters"),
    [((0, 1, -1, 0), -1), ((-1, 0, 0, -1), 2), ((0, -1, 1, 0), 1)],
    ids=["clockwise", "upside down", "counterclockwise"],
)
def test_films_are_turned_as_players_turn_them(tmp_path, matrix, quarters) -> None:
    path = tmp_path / "turned.mp4"
    picture = np.zeros((64, 96, 3), np.uint8)
    picture[:32, :32] = 200
    picture[32:, :32] = 90
    with film_file(path, 96, 64, {}) as writer:
        writer.write(Frame(0.0, picture))
    upright, turned = (
        struct.pack(">9i", a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30)
        for a, b, c, d in ((1, 0, 0, 1), matrix)
    )
    whole = path.read_bytes()
    at = whole.index(upright, whole.index(b"tkhd"))
    path.write_bytes(whole[:at] + turned + whole[at + len(upright) :])
    with open_film(str(path)) as film:
        (frame,) = film.frames()
        expected = np.rot90(picture, quarters)
        assert (film.height_px, film.width_px) == frame.picture.shape[:2] == expected.shape[:2]
        assert np.abs(frame.picture.astype(int) - expected).mean() < 8
