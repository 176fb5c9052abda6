"""How likely one flash follows another of the same robot: by the time between them, and by how robots move.

A robot is dark between its flashes. While its ring is lit, its place and its velocity are seen; in between it drives
straight ahead, or turns once, or does anything that its speed allows. What is usual is learnt from the film.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.overhead.track.flashes import Flash
from epuck_sim.overhead.track.lag_density import mean_shift

SHORTEST, LONGEST = 0.4, 1.15
"""Bounds of a robot's cycle, in periods: flashes that it sees shorten it (thesis eq. 4.1), waiting makes it longer."""

BINS = 30
"""Number of bins between these bounds in which usual cycles are learnt."""

PLAIN_SPREAD = 0.02
"""Standard deviation of cycles around the period, in periods, before any are known."""

MISSED = 0.01
"""Probability that a flash is not seen."""

SPEED_SPREAD = 0.1
"""Width, relative to the speed, over which the density of speeds is smoothed."""

REACH_CM = 1.5
"""Distance by which a robot may be farther than its speed allows: errors of positions, and of the speed."""

PLACE_CM = 0.3
"""Standard deviation of places, and of what the straight line ignores, whatever the distance."""

TURN_EDGE_S = 0.15
"""Time by which a turn may seem to have lasted less than nothing."""

LEAST_SINE = 0.15
"""Sine of the angle between two headings below which their lines do not tell where a robot turned."""

PARALLEL_SINE = 0.03
"""Sine of the angle between two headings below which their lines count as parallel."""

EDGE_CM = epuck.RADIUS_CM
"""Distance from the walls within which no robot's middle can be."""


class FlashTable(NamedTuple):
    """Flashes as columns, in order of their onsets."""

    onset_s: FloatArray
    end_s: FloatArray
    places_cm: FloatArray
    """(flashes, 2) mean places."""
    velocities_cm_s: FloatArray
    """(flashes, 2) velocities while lit."""

    @classmethod
    def of(cls, flashes: Sequence[Flash]) -> Self:
        """Return flashes as columns."""
        columns = np.array(flashes, float).reshape(-1, len(Flash._fields))
        return cls(columns[:, 0], columns[:, 1], columns[:, 2:4], columns[:, 5:7])

    @property
    def speeds_cm_s(self) -> FloatArray:
        """(flashes,) speeds while lit."""
        speeds: FloatArray = np.hypot(*self.velocities_cm_s.T)
        return speeds


class Habits(NamedTuple):
    """What is usual of the robots of a film."""

    period_s: float
    speed_cm_s: float
    """Speed of a robot that drives straight ahead."""
    floor_cm: tuple[float, float]
    cycles: FloatArray
    """(BINS,) density of cycles between `SHORTEST` and `LONGEST` periods, per period."""
    kinds: FloatArray
    """(3,) shares of ways that are straight, have one turn, or are anything else."""
    along: float
    """Standard deviation along a straight way, relative to its length."""
    aside: float
    """Standard deviation across a straight way, relative to its length."""
    swerve: float
    """Standard deviation of the heading's change on a straight way, rad."""
    turn_s: float
    """Mean duration of a turn."""

    @classmethod
    def at_first(cls, flashes: FlashTable, period_s: float, floor_cm: tuple[float, float]) -> Self:
        """Return what is assumed before any flash is linked."""
        middles = SHORTEST + (np.arange(BINS) + 0.5) * (LONGEST - SHORTEST) / BINS
        plain = np.exp(-(((middles - 1) / PLAIN_SPREAD) ** 2) / 2)
        shortened = np.where((middles > 0.5) & (middles < 1), 1.0, 0.02)
        cycles = 0.5 * plain / plain.sum() + 0.5 * shortened / shortened.sum()
        return cls(
            period_s,
            commonest_speed(flashes.speeds_cm_s),
            floor_cm,
            cycles * BINS / (LONGEST - SHORTEST),
            np.array([0.5, 0.3, 0.2]),
            along=0.03,
            aside=0.06,
            swerve=0.2,
            turn_s=0.7,
        )

    def relearnt(self, ways: "Ways") -> Self:
        """Return what is usual of ways that robots have gone, with a little of what was assumed before."""
        counts, _ = np.histogram(ways.gap_s / self.period_s, BINS, (SHORTEST, LONGEST))
        smooth = np.convolve(counts + 0.02 * len(ways.gap_s) / BINS, (0.2, 0.6, 0.2), "same")
        likely = self._parts(ways)
        shares = likely / np.maximum(likely.sum(axis=0), 1e-300)
        kinds = shares.sum(axis=1) + 1.0
        straight = shares[0] + 1e-9
        length = np.maximum(self.speed_cm_s * ways.gap_s, 1.0)
        ends, sides = (np.sqrt(np.average((off / length) ** 2, weights=straight)) for off in (ways.along, ways.aside))
        swerve = math.sqrt(np.average(ways.swerve**2, weights=straight))
        turn_s = np.average(np.clip(ways.turn_s, 0.0, None), weights=np.where(ways.has_turn, shares[1], 0.0) + 1e-9)
        return self._replace(
            cycles=smooth / smooth.sum() * BINS / (LONGEST - SHORTEST),
            kinds=kinds / kinds.sum(),
            along=max(float(ends), 0.005),
            aside=max(float(sides), 0.01),
            swerve=max(swerve, 0.03),
            turn_s=max(float(turn_s), 0.1),
        )

    def log_likelihood(self, ways: "Ways") -> FloatArray:
        """Return (ways,) the logarithm of the density of each way's end, per cm, cm, rad and period."""
        share = ways.gap_s / self.period_s
        single = self._cycle_density(share)
        double = self._cycle_density(share / 2) / 2
        total: FloatArray = np.log(np.maximum(single + MISSED * double, 1e-300))
        total += np.log(np.maximum(self.kinds @ (self._parts(ways) / self.kinds[:, None]), 1e-300))
        return total

    def _cycle_density(self, share: FloatArray) -> FloatArray:
        place = np.floor((share - SHORTEST) / (LONGEST - SHORTEST) * BINS).astype(int)
        inside = (place >= 0) & (place < BINS)
        density: FloatArray = np.where(inside, self.cycles[np.clip(place, 0, BINS - 1)], 0.0)
        return density

    def _parts(self, ways: "Ways") -> FloatArray:
        """Return (3, ways) densities of a way's end if it is straight, has one turn, or is anything, times `kinds`."""
        length = self.speed_cm_s * ways.gap_s
        straight = (
            _normal(ways.along, np.hypot(self.along * length, PLACE_CM))
            * _normal(ways.aside, np.hypot(self.aside * length, PLACE_CM))
            * _normal(ways.swerve, self.swerve)
        )
        late = np.exp(-np.maximum(ways.turn_s, 0) / self.turn_s) / (self.turn_s + TURN_EDGE_S)
        late *= np.exp(-((np.minimum(ways.turn_s, 0) / TURN_EDGE_S) ** 2) / 2)
        where = 1 / np.clip(np.minimum(ways.gap_s, ways.wall_s), 0.3, None)
        spread = math.tau * max(self.speed_cm_s, 0.1) ** 2 * np.maximum(np.abs(np.sin(ways.swerve)), LEAST_SINE)
        turned = np.where(ways.has_turn, late * where / spread, 0.0)
        area = np.minimum(math.pi * (length + REACH_CM) ** 2, self.floor_cm[0] * self.floor_cm[1])
        anything = np.where(ways.distance <= length + REACH_CM, 1 / (math.tau * area), 0.0)
        parts: FloatArray = self.kinds[:, None] * np.array([straight, turned, anything])
        return parts


def commonest_speed(speeds_cm_s: FloatArray) -> float:
    """Return the speed that is commonest among the faster half: that of robots that do not turn."""
    fast = float(np.median(speeds_cm_s[speeds_cm_s >= np.median(speeds_cm_s)]))
    return mean_shift(speeds_cm_s, np.ones(len(speeds_cm_s)), fast, SPEED_SPREAD * fast)[0] if fast else 0.0


class Ways(NamedTuple):
    """Ways from one flash to another: how they would differ from a straight one, and from one with a single turn."""

    gap_s: FloatArray
    distance: FloatArray
    """Distance in cm."""
    along: FloatArray
    """Distance, along the mean heading, from the end of a straight way, cm."""
    aside: FloatArray
    """The same across the mean heading."""
    swerve: FloatArray
    """Difference of the headings, rad from -pi to pi."""
    has_turn: BoolArray
    """Whether the lines ahead of the first and back from the second flash meet on the floor, in time."""
    turn_s: FloatArray
    """Time left for the turn, where they do."""
    wall_s: FloatArray
    """Time after which the line ahead of the first flash meets a wall."""


def ways_between(flashes: FlashTable, first: IntArray, second: IntArray, habits: Habits) -> Ways:
    """Return the ways from some flashes to others, (ways,) numbers of each."""
    gap_s = flashes.onset_s[second] - flashes.onset_s[first]
    apart = flashes.places_cm[second] - flashes.places_cm[first]
    ahead, after = (_directions(flashes.velocities_cm_s[each]) for each in (first, second))
    speed = max(habits.speed_cm_s, 0.05)
    mean = _directions(ahead + after)
    way = speed * gap_s
    along = np.sum(apart * mean, axis=1) - way
    aside = mean[:, 0] * apart[:, 1] - mean[:, 1] * apart[:, 0]
    sine = ahead[:, 0] * after[:, 1] - ahead[:, 1] * after[:, 0]
    swerve = np.arctan2(sine, np.sum(ahead * after, axis=1))
    safe = np.where(sine == 0, 1.0, sine)
    ahead_cm = (apart[:, 0] * after[:, 1] - apart[:, 1] * after[:, 0]) / safe
    back_cm = (ahead[:, 0] * apart[:, 1] - ahead[:, 1] * apart[:, 0]) / safe
    corner = flashes.places_cm[first] + ahead_cm[:, None] * ahead
    is_inside = np.all((corner >= EDGE_CM - 1) & (corner <= np.array(habits.floor_cm) - EDGE_CM + 1), axis=1)
    turn_s = gap_s - (ahead_cm + back_cm) / speed
    meet = np.abs(sine) > PARALLEL_SINE
    has_turn = meet & is_inside & (ahead_cm >= -0.5) & (back_cm >= -0.5) & (turn_s > -3 * TURN_EDGE_S)
    sides = np.where(ahead > 0, np.array(habits.floor_cm) - EDGE_CM, EDGE_CM)
    is_along = np.abs(ahead) < PARALLEL_SINE
    to_sides = np.where(is_along, np.inf, (sides - flashes.places_cm[first]) / np.where(is_along, 1.0, ahead))
    wall_s = np.maximum(to_sides.min(axis=1), 0.0) / speed
    return Ways(gap_s, np.hypot(*apart.T), along, aside, swerve, has_turn, turn_s, wall_s)


def _directions(vectors: FloatArray) -> FloatArray:
    """Return (n, 2) vectors of length 1; (1, 0) for those of length 0."""
    length = np.hypot(*vectors.T)[:, None]
    unit: FloatArray = np.where(length > 0, vectors / np.maximum(length, 1e-12), (1.0, 0.0))
    return unit


def _normal(off: FloatArray, spread: FloatArray | float) -> FloatArray:
    density: FloatArray = np.exp(-((off / spread) ** 2) / 2) / (spread * math.sqrt(math.tau))
    return density
