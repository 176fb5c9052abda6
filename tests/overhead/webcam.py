"""Films of swarms by another renderer than the package's, which the tracker was not tuned on, and what spoils films.

A ring is eight points of light and a faint band, splatted at the pixels where OpenCV's camera shows them, spread by the
lens as narrow, wide and very wide blurs, multiplied by an exposure and clipped by the sensor. It shares no code with
`epuck_sim.overhead.render`: no pixel-wise geometry, no model of a ring's cross-section. Effects are what cameras and
rooms do to films that no renderer here does: exposure, gamma, bloom, lamps, padding, noise.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from epuck_sim.overhead.camera import Frame, Picture

LEDS = 8
LED_CIRCLE_CM = 3.5
LED_HEIGHT_CM = 4.0
ROBOT_CM = 3.7


class Webcam(NamedTuple):
    """A webcam, the room and the walls; the defaults are a good film of a dark room."""

    size_px: tuple[int, int] = (480, 480)
    above_cm: float = 110.0
    focal_px: float = 800.0
    tilt_deg: float = 0.0
    turn_deg: float = 0.0
    k1: float = 0.0
    is_fisheye: bool = False  # equidistant
    exposure: float = 1.0  # 1: red is just saturated on the LEDs
    colour: tuple[float, float, float] = (1.0, 0.13, 0.08)
    band: float = 0.45  # light between the LEDs
    glare: float = 0.05
    gloss: float = 0.0  # of the walls
    room: float = 0.0  # level of the floor
    flicker: float = 0.0
    bands: float = 0.0  # of flicker from top to bottom, where rows are exposed one after the other
    noise: float = 2.0
    quality: int = 80  # of the JPEG pictures that a webcam sends

    def scaled(self, factor):
        width, height = (round(side * factor / 2) * 2 for side in self.size_px)
        return self._replace(size_px=(width, height), focal_px=self.focal_px * width / self.size_px[0])

    def project(self, points_cm, arena_cm):
        """Return (n, 2) px: where (n, 3) points are seen by a camera aimed at the arena's middle; y is up."""
        lean, spin = (Rotation.from_euler(*turn, degrees=True) for turn in (("x", self.tilt_deg), ("z", self.turn_deg)))
        rotation = lean.as_matrix() @ np.diag([1.0, -1.0, -1.0]) @ spin.as_matrix()
        eye = np.array([arena_cm[0] / 2, arena_cm[1] / 2, 0.0]) + rotation[2] * self.above_cm / rotation[2, 2]
        (width, height), focal = self.size_px, self.focal_px
        matrix = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
        show, k1 = (cv2.fisheye.projectPoints, 0.0) if self.is_fisheye else (cv2.projectPoints, self.k1)
        points = np.ascontiguousarray(points_cm, float).reshape(-1, 1, 3)
        seen, _ = show(points, cv2.Rodrigues(rotation)[0], -rotation @ eye, matrix, np.array([k1, 0.0, 0.0, 0.0]))
        return seen.reshape(-1, 2)

    def floor_px(self, arena_cm):
        return self.project(np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) * (*arena_cm, 0), arena_cm)


class Swarm(NamedTuple):
    """Robots that wiggle about their places and flash on schedule."""

    arena_cm: tuple[float, float]
    homes_cm: np.ndarray  # (n, 2)
    swing_cm: float
    onsets_s: np.ndarray  # (cycles, n)
    flash_s: float
    period_s: float
    seed: int = 0

    def places_cm(self, time_s):
        """Return (n, 2) cm and (n,) headings at a time."""
        generator = np.random.default_rng(self.seed)
        phase, rate = generator.uniform(0, math.tau, (2, len(self.homes_cm))), generator.uniform(0.3, 1.0, (2, 1))
        swing = self.swing_cm * np.sin(phase + rate * time_s)
        return self.homes_cm + swing.T, phase[0] + 0.4 * time_s

    def is_lit(self, time_s):
        since = time_s - self.onsets_s
        return ((since >= 0) & (since < self.flash_s)).any(axis=0)


def swarm(robots, cycles, together_from, seed, *, period_s=2.5, arena_cm=(60.0, 60.0), swing_cm=1.0, groups=1):
    """Return robots that flash at random phases and, from cycle `together_from` on, together: in one group or more."""
    generator = np.random.default_rng(seed)
    homes = scattered(robots, 2 * ROBOT_CM + 2.9 * swing_cm, arena_cm, ROBOT_CM + swing_cm, generator)
    random = generator.uniform(-0.3, 0.3, robots)  # no robot alone in a period where phases jump
    random[:2] = -0.3, 0.3  # never in step by chance
    spread = np.where(np.arange(cycles)[:, None] < together_from, random, 0.01 * random)
    group = (np.arange(robots) % groups) / groups
    onsets = period_s * (np.arange(cycles)[:, None] + 0.5 + spread + group)
    return Swarm(arena_cm, homes, swing_cm, onsets, 0.075 * period_s, period_s, seed)


def scattered(robots, apart_cm, arena_cm, from_wall_cm, generator):
    """Return (robots, 2) cm at random, at least `apart_cm` from each other."""
    while True:
        placed = []
        for _ in range(4000):
            place = generator.uniform(from_wall_cm, np.array(arena_cm) - from_wall_cm)
            if all(np.hypot(*(place - other)) >= apart_cm for other in placed):
                placed.append(place)
            if len(placed) == robots:
                return np.array(placed)


class Extra(NamedTuple):
    """Light that is no robot's of the arena: a ring at a place, on at given times or always."""

    place_cm: tuple[float, float]
    onsets_s: tuple[float, ...] = ()
    flash_s: float = math.inf

    def is_on(self, time_s):
        return not self.onsets_s or any(0 <= time_s - onset < self.flash_s for onset in self.onsets_s)


def picture(camera, lit_cm, headings, arena_cm, generator, dark_cm=()):
    """Return (rows, columns, 3) levels: rings lit at (n, 2) cm, and robots that are seen in the light of the room."""
    width, height = camera.size_px
    lit_cm = np.reshape(lit_cm, (-1, 2))
    levels = np.zeros((height, width, 3), np.float32)
    if camera.room:
        levels += 0.3 * camera.room
        cv2.fillPoly(levels, [np.round(camera.floor_px(arena_cm)).astype(np.int32)], (camera.room,) * 3)
        for place in np.reshape(dark_cm, (-1, 2)):
            circle = np.arange(24) * math.tau / 24
            rim = np.column_stack([np.cos(circle), np.sin(circle)]) * ROBOT_CM + place
            body = np.column_stack([rim, np.full(24, LED_HEIGHT_CM)])
            cv2.fillPoly(levels, [np.round(camera.project(body, arena_cm)).astype(np.int32)], (0.45 * camera.room,) * 3)
        phases = generator.uniform(0, math.tau) + np.arange(height) / height * camera.bands * math.tau
        levels *= (1 + camera.flicker * np.sin(phases)).astype(np.float32)[:, None, None]
    if len(lit_cm):
        levels += _light(camera, lit_cm, headings, arena_cm)[..., None] * np.array(camera.colour, np.float32)
    levels += camera.noise * generator.standard_normal(levels.shape, np.float32)
    return sent(whole(levels), camera.quality)


def whole(levels: np.ndarray) -> Picture:
    return np.ascontiguousarray(np.clip(np.round(levels), 0, 255).astype(np.uint8))


def sent(picture: np.ndarray, quality: int) -> Picture:
    """Return a picture after its way through a JPEG."""
    code = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.ascontiguousarray(np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), np.uint8)[..., ::-1])


def _light(camera, lit_cm, headings, arena_cm):
    """Return (rows, columns) light of rings and of their images in the walls, as levels of red."""
    rings = list(zip(lit_cm, headings, strict=True))
    sources = [(place, heading, 1.0) for place, heading in rings]
    if camera.gloss:
        for axis, wall in ((0, 0.0), (0, arena_cm[0]), (1, 0.0), (1, arena_cm[1])):
            for place, heading in rings:
                image = np.array(place)
                image[axis] = 2 * wall - place[axis]
                if abs(image[axis] - wall) < 12.0:
                    sources.append((image, -heading, camera.gloss))
    width, height = camera.size_px
    points, band = (np.zeros((height, width), np.float32) for _ in range(2))
    for place, heading, strength in sources:
        for target, many, share in ((points, LEDS, 1.0), (band, 72, camera.band)):
            angle = heading + np.arange(many) * math.tau / many
            rim = np.column_stack([place[0] + LED_CIRCLE_CM * np.cos(angle), place[1] + LED_CIRCLE_CM * np.sin(angle)])
            seen = camera.project(np.column_stack([rim, np.full(many, LED_HEIGHT_CM)]), arena_cm)
            _splat(target, seen, strength * share / many)
    px_per_cm = camera.focal_px / (camera.above_cm - LED_HEIGHT_CM)
    narrow, wide = 0.26 * px_per_cm, 0.55 * px_per_cm
    circle_px = math.tau * LED_CIRCLE_CM * px_per_cm
    light = 2.1 * math.tau * narrow**2 * LEDS / 2 * cv2.GaussianBlur(points, (0, 0), narrow)
    light += circle_px * math.sqrt(math.tau) * narrow * cv2.GaussianBlur(band, (0, 0), narrow)
    both = points + band
    light += camera.glare * circle_px * math.sqrt(math.tau) * wide * cv2.GaussianBlur(both, (0, 0), 2 * wide)
    small = cv2.resize(both, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    far = cv2.resize(cv2.GaussianBlur(small, (0, 0), wide), (width, height))
    light += camera.glare * circle_px * wide * far
    return 260.0 * camera.exposure * light


def _splat(target, seen, amount):
    """Add light at (n, 2) px, shared among the four pixels around each point."""
    rows, columns = target.shape
    whole = np.floor(seen).astype(int)
    part = seen - whole
    for right, below in ((0, 0), (0, 1), (1, 0), (1, 1)):
        column, row = whole[:, 0] + right, whole[:, 1] + below
        share = np.abs(1 - right - part[:, 0]) * np.abs(1 - below - part[:, 1])
        is_in = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
        np.add.at(target, (row[is_in], column[is_in]), amount * share[is_in])


def shoot(camera, robots, frames_per_s=15.0, extras=()):
    """Yield each frame with what is true of it: (n, 2) cm lit inside the arena."""
    generator = np.random.default_rng(robots.seed)
    end_s = float(robots.onsets_s.max()) + 2 * robots.flash_s
    for number in range(round(end_s * frames_per_s)):
        time_s = number / frames_per_s
        places, headings = robots.places_cm(time_s)
        lit = robots.is_lit(time_s)
        others = [extra.place_cm for extra in extras if extra.is_on(time_s)]
        shown = np.vstack([places[lit], np.reshape(others, (-1, 2))])
        turned = np.append(headings[lit], np.zeros(len(others)))
        shot = picture(camera, shown, turned, robots.arena_cm, generator, places)
        generator.random()  # films that tables count were made with this draw
        yield Frame(time_s, shot), places[lit]


GOOD = Webcam()
KINDS = {
    "good": GOOD,
    "points": Webcam(exposure=0.45, band=0.0, glare=0.01, noise=3.0),
    "burnt out, pink": Webcam(exposure=4.0, glare=0.25),
    "burnt out, white": Webcam(exposure=9.0, glare=0.25, noise=4.0),
    "orange": Webcam(colour=(1.0, 0.5, 0.06), exposure=1.6),
    "glossy walls": Webcam(focal_px=680.0, gloss=0.5, exposure=1.5),
    "fisheye": Webcam(above_cm=38.0, focal_px=320.0, is_fisheye=True),
    "barrel": Webcam(focal_px=820.0, k1=-0.3),
    "tilted": Webcam(size_px=(640, 480), focal_px=660.0, tilt_deg=25.0, turn_deg=15.0),
    "dim room": Webcam(room=25.0, noise=4.0),
    "bright room": Webcam(room=140.0, noise=3.0, exposure=2.5),
    "flickering room": Webcam(room=25.0, flicker=0.3),
    "flicker in bands": Webcam(room=25.0, flicker=0.3, bands=2.5),
    "grey film": Webcam(colour=(0.5, 0.5, 0.5)),
    "harsh": Webcam(noise=8.0, quality=25),
    "typical webcam": Webcam(
        (640, 480), 110.0, 640.0, 8.0, 6.0, -0.12, exposure=4.0, glare=0.2, gloss=0.3, noise=4.0, quality=50
    ),
}


Effect = Callable[[Iterable[Frame]], Iterator[Frame]]
CYCLES, TOGETHER_FROM, PERIOD_S, FRAMES_PER_S = 6, 3, 1.6, 12.0
SCALE = 0.4  # size of the pictures, relative to those of the camera
TRUE_CYCLES = TOGETHER_FROM + 1  # flashes of each robot by the first one together


def of_frames(change: Callable[..., Iterator[Frame]]) -> Callable[..., Effect]:
    """Return what makes an effect of a strength, by a function of frames and the strength."""
    return lambda *strength: lambda frames: change(frames, *strength)


def of_levels(change: Callable[..., np.ndarray]) -> Callable[..., Effect]:
    """Return the same by a function of (rows, columns, 3) levels, which may leave 0 to 255."""

    def changed(frames: Iterable[Frame], *strength: Any) -> Iterator[Frame]:
        for frame in frames:
            yield Frame(frame.time_s, whole(change(frame.picture.astype(np.float32), *strength)))

    return of_frames(changed)


@of_levels
def gain(levels, factor):
    """Burn out rings, first to pink and then to white, by an exposure that was set in the dark."""
    levels = np.maximum(levels - 6.0, 0)  # noise
    far = cv2.GaussianBlur(levels, (0, 0), 6.0)
    return factor * (levels + 0.6 * far + 0.3 * far.mean(axis=2, keepdims=True))


@of_frames
def lamp(frames, radius, is_square=False, at=(0.5, 0.5)):
    """Add a light that always shines, a lamp on the mains or a screen; radius: relative to the picture's height."""
    generator = np.random.default_rng(2)
    for frame in frames:
        rows, columns = frame.picture.shape[:2]
        light, size = np.zeros(frame.picture.shape, np.float32), round(radius * rows)
        x, y = round(at[0] * columns), round(at[1] * rows)
        if is_square:
            cv2.rectangle(light, (x - size, y - size), (x + size, y + size), (255, 255, 255), -1)
        else:
            cv2.circle(light, (x, y), size, (255, 255, 255), -1)
        added = generator.uniform(0.7, 1.3) * (light + 0.4 * cv2.GaussianBlur(light, (0, 0), 5.0))
        yield Frame(frame.time_s, whole(frame.picture + added))


@of_levels
def padded(levels, share, skew=0.0):
    """Add black bars left and right of a picture that leans."""
    rows, columns = levels.shape[:2]
    lean = np.array([[1, skew, -skew * rows / 2], [0, 1, 0]], np.float64)
    leant = cv2.warpAffine(levels, lean, (columns, rows), borderMode=cv2.BORDER_REPLICATE)
    bar = round(share * columns / 2) * 2
    return np.pad(leant, ((0, 0), (bar, bar), (0, 0)))


@of_frames
def automatic_exposure(frames, depth):
    """Let the exposure fall with the light of the flashes, by up to a factor of 1 + depth."""
    now = 1.0
    for frame in frames:
        yield Frame(frame.time_s, whole(frame.picture.astype(np.float32) * now))
        lit = min(1.0, float((frame.picture.max(axis=2) > 60).mean()) / 0.06)
        now += 0.4 * (1 / (1 + depth * lit) - now)


@of_frames
def rolling_shutter(frames, share):
    """Expose rows one after the other, over a share of the time between frames."""
    before = None
    for frame in frames:
        rows = 0 if before is None else round(share * len(before))
        yield frame if before is None else Frame(frame.time_s, np.vstack([before[:rows], frame.picture[rows:]]))
        before = frame.picture


@of_frames
def dropped(frames, share):
    generator = np.random.default_rng(1)
    return (frame for frame in frames if generator.random() >= share)


EFFECTS: dict[str, tuple[Callable[..., Effect], tuple[Any, ...]]] = {
    "gamma": (of_levels(lambda levels, power: 255 * (levels / 255) ** power), (0.5, 0.7, 1.6, 2.2)),
    "white balance": (of_levels(lambda levels, red: levels * np.float32([red, 1, 2 - red])), (0.3, 0.6, 1.4)),
    "bloom": (
        of_levels(lambda levels, share: levels + share * cv2.GaussianBlur(levels, (0, 0), 8.0)),
        (0.5, 1.0, 2.0, 4.0),
    ),
    "burnt out": (gain, (3.0, 10.0, 20.0, 40.0)),
    "noise reduction": (of_levels(lambda levels, side: cv2.medianBlur(levels.astype(np.uint8), side)), (3, 5)),
    "compression": (
        of_levels(lambda levels, quality: sent(levels[..., ::-1].astype(np.uint8), quality)[..., ::-1]),
        (10, 25, 50),
    ),
    "lamp": (lamp, (0.03, 0.06, 0.1, 0.2)),
    "screen": (lambda radius: lamp(radius, True, (0.8, 0.3)), (0.04, 0.08, 0.12)),
    "padded and skewed": (lambda share: padded(share, 0.5 * share), (0.05, 0.15, 0.3)),
    "automatic exposure": (automatic_exposure, (2.0, 6.0, 15.0, 40.0)),
    "rolling shutter": (rolling_shutter, (0.3, 0.7)),
    "dropped frames": (dropped, (0.1, 0.3)),
}
"""What they are made by, and the strengths at which they are tried."""


def film(effect: Effect, seed: int, *, groups: int = 1, robots: int = 8, camera: Webcam = GOOD) -> Iterator[Frame]:
    """Return the frames of robots that flash at random and then together; of two groups or more, never all together."""
    flashing = swarm(robots, CYCLES, 0 if groups > 1 else TOGETHER_FROM, seed, period_s=PERIOD_S, groups=groups)
    return effect(frame for frame, _ in shoot(camera.scaled(SCALE), flashing, FRAMES_PER_S))


def is_right(cycles: float | None, groups: int = 1) -> bool:
    """Return whether an answer, None for never, is that of `film`."""
    return cycles is None if groups > 1 else cycles is not None and math.isclose(cycles, TRUE_CYCLES, abs_tol=0.25)
