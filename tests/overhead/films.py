"""Films of robots that stand still and flash on schedule, or of numbered pictures, and how well rings are found."""

import csv
import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, Self

import av
import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.camera import CameraModel, Frame, Geometry
from epuck_sim.overhead.film import film_file, open_film
from epuck_sim.overhead.render import ExposureSample
from epuck_sim.overhead.track import Track
from epuck_sim.scenario.arena import OverheadSection
from tests.overhead.cameras import EMPTY, camera_of, make_renderer

PERIOD_S = 1.0
FLASH_S = 0.1
TOGETHER_S = 0.5  # time in each period at which all flash, once they flash together
PLACES = np.array([(10, 9), (49, 12), (51, 48), (12, 50), (30, 30), (37.4, 30)], float)  # the last two touch
SMALL = {"width_px": 240, "height_px": 240, "frames_per_s": 30}


def even(seconds: float, per_s: float = 30.0) -> FloatArray:
    return np.arange(round(seconds * per_s)) / per_s


def flashing(times_s: FloatArray, phases_s: Sequence[float] | FloatArray, period_s: float = PERIOD_S) -> BoolArray:
    """Return (frames, robots) whose ring is lit, of robots that each flash at their phase of every period."""
    return ((times_s[:, None] - np.asarray(phases_s) + 1e-9) % period_s) < FLASH_S


def in_step(times_s: FloatArray, robots: int = len(PLACES), from_s: float = 2.0) -> BoolArray:
    """Return (frames, robots) of robots that flash evenly spread over the period at first, and together later."""
    spread = flashing(times_s, TOGETHER_S + np.arange(robots) * PERIOD_S / robots)
    return np.where(times_s[:, None] < from_s, spread, flashing(times_s, [TOGETHER_S] * robots))


def make_camera(**settings: Any) -> CameraModel:
    return camera_of(**SMALL | settings)


def make_geometry(**settings: Any) -> Geometry:
    """Return the geometry of `shoot`, as a description gives it."""
    return Geometry(make_camera(**settings), (60.0, 60.0), "somewhere", True)


FOUND: dict[str, Any] = dict.fromkeys(("reasons", "evaluations", "flashes", "steady", "rings"), ())
FOUND |= {"film": "film.mp4", "frames": 240, "fps": 29.97, "duration_s": 8.0, "start_s": 2.0, "options": TrackOptions()}
FOUND |= {"calibration": "somewhere", "geometry": make_geometry(), "position_error_mm": None}
FOUND |= {"period_s": 1.0, "flash_ms": 100.0, "threshold_ms": 31.8, "estimated": ("period_s",), "warnings": ("odd",)}
FOUND |= {"rings_outside": 0, "always_lit": 0, "robots_seen": 6, "flashes_per_period": 6.04, "confidence": "high"}
FOUND |= {"t_sync_cycles": 4, "t_sync_s": 2.5, "t_sync_periods": 2.5, "histogram_s": 2.55, "histogram_periods": 2.55}
TRACK = Track(**FOUND, times_s=np.arange(240) / 29.97, counts=np.zeros(240, np.int64))
"""The result of tracking some film, for tests of how results are shown."""


def shoot(times_s: FloatArray, ring_on: BoolArray, lit_until_s: float = 0.0, **settings: Any) -> list[Frame]:
    """Return frames of robots at `PLACES`; until `lit_until_s` the room is lit and the rings are off."""
    _, renderer = make_renderer(EMPTY, **SMALL | settings)
    is_always_lit = settings.get("light") == "lit"
    poses = np.column_stack([PLACES, np.zeros(len(PLACES))])[: ring_on.shape[1]]
    frames = []
    for time_s, on in zip(times_s.tolist(), ring_on, strict=True):
        is_lit = time_s < lit_until_s
        sample = ExposureSample(poses, on & (not is_lit))
        frames.append(Frame(time_s, colours=renderer.render([sample], room_is_lit=is_lit or is_always_lit)))
    return frames


TIMES = even(4.5)
LIT = in_step(TIMES)


@cache
def reel() -> list[Frame]:
    """Return the frames of a film of six robots that flash together from 2 s on."""
    return shoot(TIMES, LIT)


def save(path: Path, frames: Sequence[Frame], description: dict[str, Any] | None = None) -> str:
    """Write frames as a film with a description, and return its name."""
    rows, columns, _ = frames[0].picture.shape
    with film_file(path, columns, rows, description or {}) as writer:
        for frame in frames:
            writer.write(frame)
    return str(path)


def frames_and_description(film: str | Path) -> tuple[list[Frame], dict[str, Any] | None]:
    with open_film(str(film)) as opened:
        return list(opened.frames()), opened.description


def described(**overhead: Any) -> dict[str, Any]:
    section = OverheadSection(**SMALL | overhead)
    return {"epuck_sim": "0", "arena_cm": [60, 60], "robots": 6, "period_s": 1.0, "overhead": section.model_dump()}


def passed(timed: Iterable[Any], _duration_s: float | None) -> Iterable[Any]:
    """Return the frames; a progress wrapper that shows nothing."""
    return timed


def read_rings(path: Path, unknown: float = math.nan) -> list[dict[str, float]]:
    """Return the rows of a table of rings, or of another one of numbers, in which `unknown` stands for empty cells."""
    with path.open(newline="") as file:
        return [{name: float(value or unknown) for name, value in row.items()} for row in csv.DictReader(file)]


def uneven(times: np.ndarray, random: np.random.Generator, dropped: float = 0.03) -> np.ndarray:
    """Return times that are up to a third of a frame late, without some of the frames."""
    late = times + np.median(np.diff(times)) * random.uniform(0, 1 / 3, len(times))
    return late[random.random(len(times)) >= dropped]


def counted(onsets: np.ndarray, flash_s: float, times: np.ndarray) -> np.ndarray:
    """Return (n,) how many rings are lit at (n,) times, of those that go on at the onsets, of any shape."""
    onsets = np.sort(np.ravel(onsets))
    begun, ended = (np.searchsorted(each, times + 1e-9, side="right") for each in (onsets, onsets + flash_s))
    return begun - ended


def steady(phases_s: np.ndarray, period_s: float, seconds: float) -> np.ndarray:
    """Return when robots fire that do so at (n,) phases of every period."""
    return np.asarray(phases_s) + period_s * np.arange(-1, seconds / period_s + 1)[:, None]


class Score(NamedTuple):
    found: int = 0
    missed: int = 0  # though lit for the whole exposure
    false: int = 0  # lit at no time of the exposure
    worst_cm: float = 0.0  # the largest distance between a ring found and the truth
    squares_cm2: float = 0.0  # sum of the squares of these distances

    def __add__(self, other: Self) -> "Score":  # type: ignore[override]
        found, missed, false, _, squares_cm2 = (one + two for one, two in zip(self, other, strict=True))
        return Score(found, missed, false, max(self.worst_cm, other.worst_cm), squares_cm2)  # type: ignore[arg-type]

    @property
    def recall(self) -> float:
        return self.found / max(1, self.found + self.missed)

    @property
    def precision(self) -> float:
        return self.found / max(1, self.found + self.false)

    @property
    def rms_cm(self) -> float:
        return float((self.squares_cm2 / max(1, self.found)) ** 0.5)


def compare(reported_cm: FloatArray, lit_cm: FloatArray, flickering_cm: FloatArray) -> Score:
    """Return how well (n, 2) cm reported rings match those that are there.

    lit_cm: (m, 2) of those lit for the whole exposure; flickering_cm: (k, 2) of those lit for a part of it, which may
    be found or not.
    """
    there = np.vstack([lit_cm.reshape(-1, 2), flickering_cm.reshape(-1, 2)])
    if not len(reported_cm) or not len(there):
        return Score(missed=len(lit_cm), false=len(reported_cm))
    distances = np.linalg.norm(there[:, None] - reported_cm, axis=2)
    nearest = distances.min(axis=1)
    is_found = nearest <= 1.0  # robots are at least 7.4 cm apart
    matched = len(np.unique(distances.argmin(axis=1)[is_found]))
    return Score(
        found=int(is_found.sum()),
        missed=int((~is_found[: len(lit_cm)]).sum()),
        false=len(reported_cm) - matched,
        worst_cm=float(nearest[is_found].max(initial=0.0)),
        squares_cm2=float((nearest[is_found] ** 2).sum()),
    )


def score_rows(rows: Iterable[dict[str, float]], truth: Iterable[tuple[float, FloatArray, FloatArray]]) -> Score:
    """Return how well a table of rings matches the truth: times of frames, and what is lit then, see `compare`."""
    places = np.array([(row["time_s"], row["x_cm"], row["y_cm"]) for row in rows]).reshape(-1, 3)
    scores = (compare(places[np.abs(places[:, 0] - time_s) < 2e-3, 1:], *lit_cm) for time_s, *lit_cm in truth)
    return sum(scores, Score())


BITS = 8


class Kind(NamedTuple):
    ending: str
    codec: str
    pixels: str
    tick_s: Fraction  # unit of its time stamps


MP4 = Kind("mp4", "libx264", "yuv420p", Fraction(1, 90_000))
MKV = Kind("mkv", "libx264", "yuv420p", Fraction(1, 1000))
MKV_OF_JPEG = Kind("mkv", "mjpeg", "yuvj420p", Fraction(1, 1000))
TS = Kind("ts", "libx264", "yuv420p", Fraction(1, 90_000))
WEBM = Kind("webm", "libvpx", "yuv420p", Fraction(1, 1000))
GIF = Kind("gif", "gif", "rgb8", Fraction(1, 100))
AVI = Kind("avi", "mjpeg", "yuvj420p", Fraction(1, 15))
AVI_LATER = Kind("avi", "libx264", "yuv420p", Fraction(1, 15))
BARE = Kind("h264", "libx264", "yuv420p", Fraction(1, 25))


def numbered_picture(number: int, width_px: int = 64, height_px: int = 48) -> np.ndarray:
    """Return a picture whose columns are bits of `number`, white for 1, over a lower half that is red."""
    picture = np.zeros((height_px, width_px, 3), np.uint8)
    for bit in range(BITS):
        picture[:, bit * width_px // BITS : (bit + 1) * width_px // BITS] = 255 * (number >> bit & 1)
    picture[height_px // 2 :] = (220, 20, 20)
    return picture


def number_in(picture: np.ndarray) -> int:
    height_px, width_px = picture.shape[:2]
    columns = [(2 * bit + 1) * width_px // (2 * BITS) for bit in range(BITS)]
    return sum(1 << bit for bit, column in enumerate(columns) if picture[height_px // 4, column].mean() > 127)


def write_film(path: Path, ticks: Sequence[int], kind: Kind = MP4, *, size=(64, 48), comment="", options=None) -> Path:
    """Write a film of numbered pictures; ticks: increasing time stamps in the unit of its kind."""
    with av.open(path, "w", options=options or {}) as container:
        if comment:
            container.metadata["comment"] = comment
        stream = container.add_stream(kind.codec, rate=15)
        stream.width, stream.height = size
        stream.pix_fmt = kind.pixels
        stream.time_base = stream.codec_context.time_base = kind.tick_s
        for number, stamp in enumerate(ticks):
            frame = av.VideoFrame.from_ndarray(numbered_picture(number, *size), format="rgb24")
            frame.pts, frame.time_base = stamp, kind.tick_s
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def write_packets(path: Path, stamps: Iterable[int], _: Kind = MKV, *, pictures=None, comment="") -> Path:
    """Write an MKV film of numbered pictures, or others, whose time stamps, in ms, need not increase."""
    stamps = list(stamps)
    pictures = [numbered_picture(number) for number in range(len(stamps))] if pictures is None else pictures
    with av.open(path, "w") as container:
        container.metadata["comment"] = comment
        stream = container.add_stream("mjpeg", rate=30, options={"qmin": "2", "qmax": "2"})
        stream.height, stream.width, _ = pictures[0].shape
        stream.pix_fmt = "yuvj444p"
        stream.time_base = stream.codec_context.time_base = MKV.tick_s
        for number, (stamp, picture) in enumerate(zip(stamps, pictures, strict=True)):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = number, MKV.tick_s
            for packet in stream.encode(frame):
                packet.pts, packet.dts = stamp, min(number, stamp)
                container.mux(packet)
    return path


def write_sound(path: Path, codec: str = "pcm_s16le") -> Path:
    with av.open(path, "w") as container:
        stream = container.add_stream(codec, rate=8000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 8000), np.int16), format="s16", layout="mono")
        sound.rate = 8000
        container.mux(stream.encode(sound))
        container.mux(stream.encode())
    return path


def cut_off(path: Path, share: float = 0.6) -> Path:
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    return path
