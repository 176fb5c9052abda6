"""What cameras and rooms do to films that no renderer here does: exposure, gamma, bloom, lamps, padding, noise."""

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import cv2
import numpy as np

from epuck_sim.overhead.camera import Frame, Picture
from tests.overhead.webcam import GOOD, Webcam, shoot, swarm

Effect = Callable[[Iterable[Frame]], Iterator[Frame]]
CYCLES, TOGETHER_FROM, PERIOD_S, FRAMES_PER_S = 6, 3, 1.6, 12.0
SCALE = 0.4  # size of the pictures, relative to those of the camera
TRUE_CYCLES = TOGETHER_FROM + 1  # flashes of each robot by the first one together


def each(change: Callable[[np.ndarray], np.ndarray]) -> Effect:
    """Return the effect that changes (rows, columns, 3) levels of each picture, which may leave 0 to 255."""

    def effect(frames: Iterable[Frame]) -> Iterator[Frame]:
        for frame in frames:
            yield Frame(frame.time_s, whole(change(frame.picture.astype(np.float32))))

    return effect


def whole(levels: np.ndarray) -> Picture:
    return np.ascontiguousarray(np.clip(np.round(levels), 0, 255).astype(np.uint8))


def gain(factor: float) -> Effect:
    """Return the effect of an exposure that was set in the dark: rings burn out, first to pink and then to white."""

    def change(levels: np.ndarray) -> np.ndarray:
        levels = np.maximum(levels - 6.0, 0)  # noise
        far = cv2.GaussianBlur(levels, (0, 0), 6.0)
        return factor * (levels + 0.6 * far + 0.3 * far.mean(axis=2, keepdims=True))

    return each(change)


def compression(quality: int) -> Effect:
    def change(levels: np.ndarray) -> np.ndarray:
        code = cv2.imencode(".jpg", levels.astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        return np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR))

    return each(change)


def lamp(radius: float, is_square: bool = False, at: tuple[float, float] = (0.5, 0.5)) -> Effect:
    """Return the effect of a light that always shines; radius: relative to the picture's height."""
    generator = np.random.default_rng(2)  # a lamp on the mains, or a screen

    def change(levels: np.ndarray) -> np.ndarray:
        rows, columns = levels.shape[:2]
        light, size = np.zeros_like(levels), round(radius * rows)
        x, y = round(at[0] * columns), round(at[1] * rows)
        if is_square:
            cv2.rectangle(light, (x - size, y - size), (x + size, y + size), (255, 255, 255), -1)
        else:
            cv2.circle(light, (x, y), size, (255, 255, 255), -1)
        return levels + generator.uniform(0.7, 1.3) * (light + 0.4 * cv2.GaussianBlur(light, (0, 0), 5.0))

    return each(change)


def padded(share: float, skew: float = 0.0) -> Effect:
    """Return the effect of black bars left and right, and of a picture that leans."""

    def change(levels: np.ndarray) -> np.ndarray:
        rows, columns = levels.shape[:2]
        lean = np.array([[1, skew, -skew * rows / 2], [0, 1, 0]], np.float64)
        leant = cv2.warpAffine(levels, lean, (columns, rows), borderMode=cv2.BORDER_REPLICATE)
        bar = round(share * columns / 2) * 2
        return np.pad(leant, ((0, 0), (bar, bar), (0, 0)))

    return each(change)


def automatic_exposure(depth: float) -> Effect:
    """Return the effect of an exposure that falls with the light of the flashes, by up to a factor of 1 + depth."""

    def effect(frames: Iterable[Frame]) -> Iterator[Frame]:
        now = 1.0
        for frame in frames:
            levels = frame.picture.astype(np.float32)
            yield Frame(frame.time_s, whole(levels * now))
            lit = min(1.0, float((levels.max(axis=2) > 60).mean()) / 0.06)
            now += 0.4 * (1 / (1 + depth * lit) - now)

    return effect


def rolling_shutter(share: float) -> Effect:
    """Return the effect of rows that are exposed one after the other, over a share of the time between frames."""

    def effect(frames: Iterable[Frame]) -> Iterator[Frame]:
        before = None
        for frame in frames:
            picture = frame.picture.copy()
            if before is not None:
                picture[: round(share * len(picture))] = before[: round(share * len(picture))]
            before = frame.picture
            yield Frame(frame.time_s, picture)

    return effect


def dropped(share: float) -> Effect:
    def effect(frames: Iterable[Frame]) -> Iterator[Frame]:
        generator = np.random.default_rng(1)
        return (frame for frame in frames if generator.random() >= share)

    return effect


KINDS: dict[str, tuple[Callable[..., Effect], tuple[Any, ...]]] = {
    "gamma": (lambda power: each(lambda levels: 255 * (levels / 255) ** power), (0.5, 0.7, 1.6, 2.2)),
    "white balance": (lambda red: each(lambda levels: levels * np.float32([red, 1, 2 - red])), (0.3, 0.6, 1.4)),
    "bloom": (
        lambda share: each(lambda levels: levels + share * cv2.GaussianBlur(levels, (0, 0), 8.0)),
        (0.5, 1.0, 2.0, 4.0),
    ),
    "burnt out": (gain, (3.0, 10.0, 20.0, 40.0)),
    "noise reduction": (lambda side: each(lambda levels: cv2.medianBlur(levels.astype(np.uint8), side)), (3, 5)),
    "compression": (compression, (10, 25, 50)),
    "lamp": (lamp, (0.03, 0.06, 0.1, 0.2)),
    "screen": (lambda radius: lamp(radius, True, (0.8, 0.3)), (0.04, 0.08, 0.12)),
    "padded and skewed": (lambda share: padded(share, 0.5 * share), (0.05, 0.15, 0.3)),
    "automatic exposure": (automatic_exposure, (2.0, 6.0, 15.0, 40.0)),
    "rolling shutter": (rolling_shutter, (0.3, 0.7)),
    "dropped frames": (dropped, (0.1, 0.3)),
}
"""Effects, and the strengths at which they are tried."""


def film(effect: Effect, seed: int, *, groups: int = 1, robots: int = 8, camera: Webcam = GOOD) -> Iterator[Frame]:
    """Return the frames of robots that flash at random and then together; of two groups or more, never all together."""
    flashing = swarm(robots, CYCLES, 0 if groups > 1 else TOGETHER_FROM, seed, period_s=PERIOD_S, groups=groups)
    return effect(frame for frame, _ in shoot(camera.scaled(SCALE), flashing, FRAMES_PER_S))


def is_right(cycles: float | None, groups: int = 1) -> bool:
    """Return whether an answer, None for never, is that of `film`."""
    return cycles is None if groups > 1 else cycles is not None and math.isclose(cycles, TRUE_CYCLES, abs_tol=0.25)
