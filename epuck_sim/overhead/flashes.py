"""Counts the lit rings of a film frame by frame, and links them to flashes of robots."""

import math
from array import array
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple, Self

import cv2
import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.overhead.camera import Frame, Geometry, Light
from epuck_sim.overhead.rings import LEAST_LIGHT, LIT_LEVEL, Background, Ring, RingFinder, reduced

REACH_CM = 2.5  # largest distance of a ring from its place in the frame before, at high frame rates
FASTEST_CM_S = 1.05 * epuck.WHEEL_LIMIT_CM_S  # highest speed of a ring, which gives this distance at low frame rates
MOST_REACH_CM = 1.6 * epuck.RADIUS_CM  # distance beyond which it is another ring: robots that touch are 2 radii apart
ENOUGH_PX_PER_CM = 6.0  # pixels per cm at rings, by which they are located; larger pictures are reduced: that is faster
MAX_MISSED = 2  # number of frames in a row in which a lit ring may be missed

# lit areas
SAMPLED = 4  # distance of the pixels of a row, or of a column, whose median is its usual light
OUTLINE_POINTS = 16  # points on each side of the floor's outline, which distortion bows
SAMPLED_LINES = 120  # approximate number of rows, or columns, in which lit pixels are counted
_COS, _SIN = (function(np.linspace(0, 2 * np.pi, 8, endpoint=False)) for function in (np.cos, np.sin))


class Flash(NamedTuple):
    """A ring that was lit, from the first frame that shows it until the first that does not."""

    onset_s: float
    end_s: float
    x_cm: float  # mean place in the arena's frame
    y_cm: float
    light: float  # largest levels by which the ring was brighter than its inside
    x_cm_s: float = 0.0  # mean velocity while it was lit; 0 if a single frame shows it
    y_cm_s: float = 0.0


class FlashTable(NamedTuple):
    """Flashes as columns, in order of their onsets."""

    onset_s: FloatArray
    end_s: FloatArray
    places_cm: FloatArray  # (flashes, 2) mean places
    velocities_cm_s: FloatArray  # (flashes, 2) velocities while lit
    light: FloatArray  # (flashes,) largest levels by which rings were brighter than their inside

    @classmethod
    def of(cls, flashes: Sequence[Flash]) -> Self:
        """Return flashes as columns."""
        columns = np.array(flashes, float).reshape(-1, len(Flash._fields))
        return cls(columns[:, 0], columns[:, 1], columns[:, 2:4], columns[:, 5:7], columns[:, 4])

    @property
    def speeds_cm_s(self) -> FloatArray:
        """(flashes,) speeds while lit."""
        return np.asarray(np.hypot(*self.velocities_cm_s.T))

    def frames(self, times_s: FloatArray) -> IntArray:
        """Return (flashes, 2) the first of (frames,) that shows each, and the frame after the last that does."""
        first, end = np.searchsorted(times_s, self.onset_s), np.searchsorted(times_s, self.end_s)
        return np.column_stack([first, end + (self.end_s == times_s[-1])])  # the film's last frame shows it

    def count_lit(self, times_s: FloatArray) -> IntArray:
        """Return (n,) the number of flashes that are lit at each of (n,) ascending times."""
        begun, ended = (np.bincount(each, minlength=len(times_s) + 1) for each in self.frames(times_s).T)
        return np.cumsum(begun - ended)[:-1]


class _Lit:
    def __init__(self, time_s: float, ring: Ring) -> None:
        self.onset_s = time_s
        self.seen: list[tuple[float, float, float, float]] = []
        self.see(time_s, ring)

    def see(self, time_s: float, ring: Ring) -> None:
        self.ring, self.missed_s = ring, list[float]()
        self.seen.append((time_s, ring.x_cm, ring.y_cm, ring.light))

    def reach_cm(self, now_s: float) -> float:
        return min(max(REACH_CM, FASTEST_CM_S * (now_s - self.seen[-1][0])), MOST_REACH_CM)

    def flash(self, now_s: float) -> Flash:
        times_s, x, y, light = np.array(self.seen).T
        since_s = times_s - times_s.mean()
        speed = since_s / max(since_s @ since_s, 1e-12)  # 0 if a single frame shows it
        end_s = self.missed_s[0] if self.missed_s else now_s
        return Flash(self.onset_s, end_s, *map(float, (x.mean(), y.mean(), light.max(), speed @ x, speed @ y)))


class FlashLinker:
    """Links rings frame by frame."""

    def __init__(self) -> None:
        self._ended: list[Flash] = []
        self._lit: list[_Lit] = []
        self._now_s = 0.0

    def add(self, time_s: float, rings: Sequence[Ring]) -> None:
        """Add the rings of the next frame: each continues the nearest flash, or begins one."""
        self._now_s = time_s
        pairs: list[tuple[float, int, int]] = []
        for place, lit in enumerate(self._lit):
            away_cm, reach_cm = [math.dist(ring[:2], lit.ring[:2]) for ring in rings], lit.reach_cm(time_s)
            pairs += [(each, place, index) for index, each in enumerate(away_cm) if each <= reach_cm]
        dark, new = dict(enumerate(self._lit)), dict(enumerate(rings))
        for _, place, index in sorted(pairs):
            if place in dark and index in new:
                dark.pop(place).see(time_s, new.pop(index))
        for lit in dark.values():
            lit.missed_s.append(time_s)
        self._ended += [lit.flash(time_s) for lit in self._lit if len(lit.missed_s) > MAX_MISSED]
        self._lit = [lit for lit in self._lit if len(lit.missed_s) <= MAX_MISSED]
        self._lit += [_Lit(time_s, ring) for ring in new.values()]

    @property
    def flashes(self) -> tuple[Flash, ...]:
        """Flashes so far, in order of their onsets; those that still shine end with the last frame."""
        return tuple(sorted(self._ended + [lit.flash(self._now_s) for lit in self._lit]))

    def lit_since(self, time_s: float) -> int:
        """Return the number of rings in the last frame that have been lit since before a time."""
        return sum(lit.onset_s < time_s and not lit.missed_s for lit in self._lit)


def join_broken(flashes: Sequence[Flash], flash_s: float) -> tuple[Flash, ...]:
    """Join flashes at one place that are less than a flash apart: poor pictures lose rings in the middle of a flash."""
    joined: list[Flash] = []
    first = 0
    for flash in flashes:
        while first < len(joined) and joined[first].onset_s < flash.onset_s - 4 * flash_s:
            first += 1
        for index in range(first, len(joined)):
            before = joined[index]
            is_near = math.dist(before[2:4], flash[2:4]) <= REACH_CM
            if is_near and 0 <= flash.onset_s - before.end_s <= flash_s:
                joined[index] = before._replace(end_s=flash.end_s, light=max(before.light, flash.light))
                break
        else:
            joined.append(flash)
    return tuple(joined)


def count_places(places_cm: Iterable[tuple[float, float]]) -> int:
    """Return the number of places that are farther apart than a ring moves between frames."""
    apart: list[tuple[float, float]] = []
    for place in places_cm:
        if all(math.dist(place, other) > REACH_CM for other in apart):
            apart.append(place)
    return len(apart)


class CountedRings(NamedTuple):
    """The lit rings of a trial that was filmed, or simulated as if it was filmed."""

    frames: int  # number of frames, including those of a lit beginning
    times_s: FloatArray  # (frames,) s: times of the trial's frames on the film's clock; it begins with the first
    counts: IntArray  # (frames,) lit rings in each of them
    areas_px: IntArray  # (frames,) pixels of the floor that are lit in each of them; 0 where there are no pictures
    flashes: tuple[Flash, ...]  # flashes of the trial, in order of their onsets
    geometry: Geometry
    outside: int = 0  # number of rings seen outside of the floor: those of a neighbour, or mirror images
    always_lit: Sequence[Ring] = ()  # rings on the floor that never went off
    dazzled: float = 0.0  # share of the floor that always shines as brightly as rings
    rings: Sequence[Sequence[Ring]] = ()
    """Rings on the floor in each frame, including frames of a lit beginning; empty if the trial was not filmed."""


class LightMeter:
    """Measures the lit area in pictures of one camera."""

    def __init__(self, geometry: Geometry) -> None:
        camera = geometry.camera
        self._step = max(min(camera.width_px, camera.height_px) // SAMPLED_LINES, 1)
        floor = np.ones((camera.height_px, camera.width_px), np.uint8)
        if geometry.knows_floor:
            floor[:] = 0
            corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]) * geometry.floor_cm
            sides = [np.linspace(*ends, OUTLINE_POINTS, False) for ends in pairwise(corners)]
            outline_cm = np.column_stack([np.vstack(sides), np.zeros(4 * OUTLINE_POINTS)])
            cv2.fillPoly(floor, [np.round(camera.project(outline_cm)).astype(np.int32)], (1,))
        self._floor = reduced(floor, self._step) > 0

    def lit_px(self, levels: Light, background: Light | None = None, usual: float = 0.0) -> int:
        """Return about how many of (height_px, width_px) levels are lit on the floor, or anywhere if it is not known.

        Flickering lamps do not count. Those that light the room raise whole rows where a camera exposes one row after
        the other, whole columns if the film is turned, and else all pixels. Lamps in the picture, and screens, flicker
        by less than the background there exceeds its usual level.
        """
        if cv2.minMaxLoc(levels)[1] < LEAST_LIGHT:
            return 0
        is_small = self._step == 1  # or else noise is averaged anyhow
        light = np.asarray(cv2.blur(levels, (3, 3)), np.uint8) if is_small else reduced(levels, self._step)
        beyond = _beyond_usual(light, self._floor)
        beyond = _beyond_usual(beyond.T, self._floor.T).T
        is_light = (beyond >= LEAST_LIGHT) & self._floor
        if background is not None:
            is_light &= beyond + usual >= reduced(background, self._step)
        return self._step**2 * int(np.count_nonzero(is_light))

    def share(self, levels: Light, least: float) -> float:
        """Return the share of the floor, or of the picture if it is not known, that has the level `least` or more."""
        return float(np.mean(reduced(levels, self._step)[self._floor] >= least))


def _beyond_usual(light: Light, floor: BoolArray) -> Light:
    """Return (rows, columns) the light beyond the median of the floor in its row."""
    beside = ~floor[:, ::SAMPLED]
    ascending = np.sort(light[:, ::SAMPLED] | -beside.view(np.uint8), axis=1, kind="stable")  # by radix; 255 beside it
    middle = (beside.shape[1] - np.count_nonzero(beside, axis=1)) // 2
    usual = np.take_along_axis(ascending, middle[:, None], axis=1)
    return np.asarray(np.maximum(light, usual) - usual, np.uint8)


def light_on_circle(background: Light, ring: Ring, times: int) -> float:
    """Return the mean level, in a picture that is `reduced` so many times, on the circle of a ring."""
    shown = np.array([ring.x_px + ring.radius_px * _COS, ring.y_px + ring.radius_px * _SIN])
    columns, rows = np.rint((shown + 0.5) / times - 0.5).astype(int).clip(0, np.array(background.shape)[::-1, None] - 1)
    return float(background[rows, columns].mean())


class RingCounter:
    """Counts the lit rings in the frames of a film, frame after frame.

    A film may begin in the light, before the robots start (thesis 4.3.1: they "only started moving once the room lights
    were switched off"). The trial begins with the first dark frame after that, and earlier counts are discarded. Once a
    ring has been seen in the dark, the light may go on and off.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = geometry
        camera = geometry.camera
        px_per_cm = camera.lens.focal_px / (camera.position_cm[2] - epuck.RING_HEIGHT_CM)
        self._reduced_by = times = max(math.floor(px_per_cm / ENOUGH_PX_PER_CM), 1)
        self._finder = RingFinder(camera, geometry.ring_light, sees_discs=geometry.knows_floor, times=times)
        self._background = Background(geometry.background, times)
        self._meter = LightMeter(geometry._replace(camera=camera.reduced(times)))
        self._was_lit, self._has_begun = True, False
        self._rings: list[list[Ring]] = []
        self._begin(0.0)

    def process(self, frame: Frame) -> list[Ring]:
        """Find the lit rings on the floor in the next frame, count them, and return them."""
        light, lit = self._background.light_beyond(frame)
        background, usual = None if lit else self._background.levels, self._background.usual()
        seen = self._finder.find(light, room_is_lit=lit)
        if background is not None:  # a lamp that flickers may have the shape of a ring
            seen = [ring for ring in seen if ring.light + usual >= light_on_circle(background, ring, self._reduced_by)]
        rings = self._on_floor(seen)
        if not self._rings or (self._was_lit and not lit and not self._has_begun):
            self._begin(frame.time_s)
        self._was_lit = lit
        self._has_begun |= bool(rings) and not lit
        area_px = self._meter.lit_px(light, background, usual)
        self._times.append(frame.time_s)  # all at once: Ctrl-C, which ends a live film, must not come in between
        self._counts.append(len(rings))
        self._areas.append(area_px)
        self.linker.add(frame.time_s, rings)
        self._outside += len(seen) - len(rings)
        self._rings.append(rings)
        return rings

    def _begin(self, start_s: float) -> None:
        self.start_s = start_s  # of the trial, on the film's clock; earlier counts are discarded
        self._times, self._counts, self._areas = array("d"), array("q"), array("q")
        self.linker = FlashLinker()
        self._outside = 0

    def _on_floor(self, rings: list[Ring]) -> list[Ring]:
        """Return the rings on the floor: a robot at a wall is its radius inside, its mirror image as far outside."""
        width_cm, height_cm = self._geometry.floor_cm
        is_known = self._geometry.knows_floor
        return [ring for ring in rings if not is_known or (0 <= ring.x_cm <= width_cm and 0 <= ring.y_cm <= height_cm)]

    @property
    def lit(self) -> tuple[FloatArray, IntArray]:
        """(frames,) s: times of the trial's frames; (frames,) lit rings in each."""
        return np.array(self._times, np.float64), np.array(self._counts, np.int64)

    def counted(self) -> CountedRings:
        """Return the counts so far."""
        times_s, counts = self.lit
        background = self._background.levels
        bright = max(LIT_LEVEL, self._geometry.ring_light)
        return CountedRings(
            frames=len(self._rings),
            times_s=times_s,
            counts=counts,
            areas_px=np.array(self._areas, np.int64),
            flashes=self.linker.flashes,
            outside=self._outside,
            always_lit=[] if background is None else self._on_floor(self._finder.find(background)),
            geometry=self._geometry,
            dazzled=0.0 if background is None else self._meter.share(background, bright),
            rings=self._rings,
        )
