"""Links the rings of consecutive frames to flashes: where, from when and until when a ring was lit."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.rings import Ring

REACH_CM = 2.5  # largest distance of a ring from its place in the frame before; less than the radius of a robot
MAX_MISSED = 2  # number of frames in a row in which a lit ring may be missed


class Flash(NamedTuple):
    """A ring that was lit, from the first frame that shows it until the first that does not."""

    onset_s: float
    end_s: float
    x_cm: float
    """Mean place in the arena's frame."""
    y_cm: float
    light: float
    """Largest levels by which the ring was brighter than its inside."""
    x_cm_s: float = 0.0
    """Mean velocity while it was lit; 0 if a single frame shows it."""
    y_cm_s: float = 0.0


class FlashTable(NamedTuple):
    """Flashes as columns, in order of their onsets."""

    onset_s: FloatArray
    end_s: FloatArray
    places_cm: FloatArray
    """(flashes, 2) mean places."""
    velocities_cm_s: FloatArray
    """(flashes, 2) velocities while lit."""
    light: FloatArray
    """(flashes,) largest levels by which rings were brighter than their inside."""

    @classmethod
    def of(cls, flashes: Sequence[Flash]) -> Self:
        """Return flashes as columns."""
        columns = np.array(flashes, float).reshape(-1, len(Flash._fields))
        return cls(columns[:, 0], columns[:, 1], columns[:, 2:4], columns[:, 5:7], columns[:, 4])

    @property
    def speeds_cm_s(self) -> FloatArray:
        """(flashes,) speeds while lit."""
        speeds: FloatArray = np.hypot(*self.velocities_cm_s.T)
        return speeds


class _Lit:
    """A ring that is lit."""

    def __init__(self, time_s: float, ring: Ring) -> None:
        self.onset_s = time_s
        self.light = 0.0
        self.sums = [0.0] * 7
        self.see(time_s, ring)

    def see(self, time_s: float, ring: Ring) -> None:
        self.ring, self.missed, self.end_s = ring, 0, math.nan
        self.light = max(self.light, ring.light)
        since_s, x, y = time_s - self.onset_s, ring.x_cm, ring.y_cm
        terms = (1.0, x, y, since_s, since_s * since_s, since_s * x, since_s * y)
        self.sums = [total + term for total, term in zip(self.sums, terms, strict=True)]

    def miss(self, time_s: float) -> None:
        self.end_s = time_s if math.isnan(self.end_s) else self.end_s
        self.missed += 1

    def flash(self, now_s: float) -> Flash:
        end_s = now_s if math.isnan(self.end_s) else self.end_s
        frames, x, y, times, squares, x_times, y_times = self.sums
        spread = frames * squares - times * times
        velocity = [
            (frames * both - times * one) / spread if spread else 0.0 for both, one in ((x_times, x), (y_times, y))
        ]
        return Flash(self.onset_s, end_s, x / frames, y / frames, self.light, *velocity)


class FlashLinker:
    """Links rings frame by frame."""

    def __init__(self) -> None:
        self._ended: list[Flash] = []
        self._lit: list[_Lit] = []
        self._now_s = 0.0

    def add(self, time_s: float, rings: Sequence[Ring]) -> None:
        """Add the rings of the next frame: each continues the nearest flash, or begins one."""
        self._now_s = time_s
        pairs = sorted(
            (math.dist(ring[:2], lit.ring[:2]), place, index)
            for place, lit in enumerate(self._lit)
            for index, ring in enumerate(rings)
        )
        seen: dict[int, int] = {}
        for distance, place, index in pairs:
            if distance <= REACH_CM and place not in seen and index not in seen.values():
                seen[place] = index
        for place, lit in enumerate(self._lit):
            if place in seen:
                lit.see(time_s, rings[seen[place]])
            else:
                lit.miss(time_s)
        self._ended += [lit.flash(time_s) for lit in self._lit if lit.missed > MAX_MISSED]
        self._lit = [lit for lit in self._lit if lit.missed <= MAX_MISSED]
        self._lit += [_Lit(time_s, ring) for index, ring in enumerate(rings) if index not in seen.values()]

    @property
    def flashes(self) -> tuple[Flash, ...]:
        """Flashes so far, in order of their onsets; those that go on end with the last frame."""
        return tuple(sorted(self._ended + [lit.flash(self._now_s) for lit in self._lit]))

    def lit_since(self, time_s: float) -> int:
        """Return the number of rings in the last frame that have been lit since before a time."""
        return sum(lit.onset_s < time_s and not lit.missed for lit in self._lit)


def join_broken(flashes: Sequence[Flash], flash_s: float) -> tuple[Flash, ...]:
    """Return flashes, of which one that begins at the place of another, within a flash of its end, continues it.

    Poor pictures lose rings in the middle of a flash; no robot flashes again so soon.
    """
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


def frames_lit(onset_s: FloatArray, end_s: FloatArray, times_s: FloatArray) -> IntArray:
    """Return (flashes, 2) the first frame that shows each flash, and the frame after the last.

    Args:
        onset_s: (flashes,) onsets.
        end_s: (flashes,) times of the first frames that do not show them; the last frame shows a flash that ends there.
        times_s: (frames,) times of the frames, ascending.
    """
    first, end = np.searchsorted(times_s, onset_s), np.searchsorted(times_s, end_s)
    return np.column_stack([first, end + (end_s == times_s[-1])])


def count_lit(flashes: Sequence[Flash], times_s: FloatArray) -> IntArray:
    """Return (n,) how many of some flashes are lit at (n,) times, ascending."""
    change = np.zeros(len(times_s) + 1, np.int64)
    for first, end in frames_lit(*FlashTable.of(flashes)[:2], times_s):
        change[first] += 1
        change[end] -= 1
    return np.cumsum(change)[:-1]


def count_places(places_cm: Iterable[tuple[float, float]]) -> int:
    """Return the number of places that are farther apart than a ring moves between frames."""
    apart: list[tuple[float, float]] = []
    for place in places_cm:
        if all(math.dist(place, other) > REACH_CM for other in apart):
            apart.append(place)
    return len(apart)
