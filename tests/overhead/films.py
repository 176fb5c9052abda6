"""Films of robots that stand still and flash on schedule, rendered frame by frame at any times: the truth is exact."""

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.camera import CameraModel, Frame, Geometry, Light
from epuck_sim.overhead.film import film_file
from epuck_sim.overhead.light import is_lit
from epuck_sim.overhead.render import ExposureSample
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.track import Track
from epuck_sim.scenario.overhead import OverheadSection
from tests.overhead.cameras import EMPTY, camera_of, make_renderer

PERIOD_S = 1.0
FLASH_S = 0.1
TOGETHER_S = 0.5
"""Time in each period at which all flash, once they flash together."""

PLACES = np.array([(10, 9), (49, 12), (51, 48), (12, 50), (30, 30), (37.4, 30)], float)
"""The last two touch."""

SMALL = {"width_px": 240, "height_px": 240, "frames_per_s": 30}


def even(seconds: float, per_s: float = 30.0) -> FloatArray:
    """Return the times of frames at an even rate."""
    return np.arange(round(seconds * per_s)) / per_s


def flashing(times_s: FloatArray, phases_s: Sequence[float] | FloatArray, period_s: float = PERIOD_S) -> BoolArray:
    """Return (frames, robots) whose ring is lit, of robots that each flash at their phase of every period."""
    return ((times_s[:, None] - np.asarray(phases_s) + 1e-9) % period_s) < FLASH_S


def in_step(times_s: FloatArray, robots: int = len(PLACES), from_s: float = 2.0) -> BoolArray:
    """Return (frames, robots) of robots that flash evenly spread over the period at first, and together later."""
    spread = flashing(times_s, TOGETHER_S + np.arange(robots) * PERIOD_S / robots)
    return np.where(times_s[:, None] < from_s, spread, flashing(times_s, [TOGETHER_S] * robots))


def make_camera(**settings: Any) -> CameraModel:
    """Return the camera of `shoot`."""
    return camera_of(**SMALL | settings)


def make_geometry(**settings: Any) -> Geometry:
    """Return the geometry of `shoot`, as a description gives it."""
    return Geometry(make_camera(**settings), (60.0, 60.0), "somewhere", True)


TRACK = Track(
    film="film.mp4",
    frames=240,
    fps=29.97,
    duration_s=8.0,
    start_s=2.0,
    calibration="somewhere",
    period_s=1.0,
    flash_ms=100.0,
    threshold_ms=31.8,
    estimated=("period_s",),
    rings_outside=0,
    always_lit=0,
    position_error_mm=None,
    robots_seen=6,
    flashes_per_period=6.04,
    histogram_s=2.55,
    histogram_periods=2.55,
    t_sync_cycles=3.44,
    t_sync_s=2.5,
    t_sync_periods=2.5,
    confidence="high",
    reasons=(),
    warnings=("odd",),
    times_s=np.arange(240) / 29.97,
    counts=np.zeros(240, np.int64),
    evaluations=(),
    flashes=(),
    steady=(),
    rings=(),
    geometry=make_geometry(),
    options=TrackOptions(),
)
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
        frames.append(Frame(time_s, renderer.render([sample], room_is_lit=is_lit or is_always_lit)))
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


def described(**overhead: Any) -> dict[str, Any]:
    """Return a description for a film by `shoot`."""
    section = OverheadSection(**SMALL | overhead)
    return {"epuck_sim": "0", "arena_cm": [60, 60], "robots": 6, "period_s": 1.0, "overhead": section.model_dump()}


def passed(timed: Iterable[Any], _duration_s: float | None) -> Iterable[Any]:
    """Return the frames; a progress wrapper that shows nothing."""
    return timed


def read_rings(path: Path, unknown: float = math.nan) -> list[dict[str, float]]:
    """Return the rows of a table of rings, or of another one of numbers, in which `unknown` stands for empty cells."""
    with path.open(newline="") as file:
        return [{name: float(value or unknown) for name, value in row.items()} for row in csv.DictReader(file)]


def code_rings(patch: pytest.MonkeyPatch) -> None:
    """Have counters take the rings that `coded` writes into frames."""
    where = "epuck_sim.overhead.flashes"
    patch.setattr(f"{where}.RingFinder", Coded)
    patch.setattr(f"{where}.Background.light_beyond", lambda _, frame: (frame.picture[:, :, 2], is_lit(frame.picture)))
    patch.setattr(f"{where}.LightMeter.lit_px", lambda *_: 0)


class Coded:
    """A substitute for `RingFinder` that reads the number of rings from the first pixel.

    The ring that went on first goes off first, and each that goes on is at another place.
    """

    def __init__(self, *_: object, **__: object) -> None:
        self._lit: list[int] = []
        self._next = 0

    def find(self, levels: Light, **_: object) -> list[Ring]:
        count = int(levels[0, 0])
        self._lit = self._lit[max(0, len(self._lit) - count) :]
        while len(self._lit) < count:
            self._lit.append(self._next)
            self._next += 1
        return [Ring(1 + 5 * (place % 11), 1 + 5 * (place // 11 % 11), 3.5, 10, 10, 5) for place in self._lit]


def coded(times_s: Iterable[float], counts: Iterable[int], lit_room: Iterable[bool]) -> Iterator[Frame]:
    """Yield frames for `Coded`."""
    for time_s, count, lit in zip(times_s, counts, lit_room, strict=True):
        picture = np.zeros((16, 16, 3), np.uint8)
        picture[:] = 200 * lit
        picture[0, 0, 2] = count
        yield Frame(float(time_s), picture)
