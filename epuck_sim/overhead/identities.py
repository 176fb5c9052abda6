"""Finds the flashes of each robot in a film, in which robots are dark between their flashes.

Each flash is linked to at most one before and one after it. Of all ways to link the flashes of some periods, the
likeliest is taken (`scipy.optimize.linear_sum_assignment`); the robots' habits are learnt from it, and flashes are
linked again. A link is as certain as the best way without it is unlikely.

How likely one flash follows another is judged by the time between them, and by how robots move. While a robot's ring is
lit, its place and its velocity are seen; in between it drives straight ahead, or turns once, or does anything that its
speed allows.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.overhead.flashes import FlashTable
from epuck_sim.overhead.synchrony import mean_shift, pairs_within

ROUNDS = 5  # number of times that flashes are linked, each time by what was learnt before
BLOCK_PERIODS = 8.0  # length of a part of the film whose flashes are linked at once
SURE = 0.95  # certainty of a link from which it counts as sure

SHORTEST, LONGEST = 0.4, 1.15
"""Bounds of a robot's cycle, in periods: flashes that it sees shorten it (thesis eq. 4.1), waiting makes it longer."""

BINS = 30  # bins between these bounds in which usual cycles are learnt
PLAIN_SPREAD = 0.02  # standard deviation of cycles around the period, in periods, before any are known
MISSED = 0.01  # probability that a flash is not seen
SPEED_SPREAD = 0.1  # width, relative to the speed, over which the density of speeds is smoothed
REACH_CM = 1.5  # distance by which a robot may be farther than its speed allows: errors of places and of the speed
PLACE_CM = 0.3  # standard deviation of places, and of deviations from a straight line, whatever the distance
TURN_EDGE_S = 0.15  # standard deviation of the duration of a turn that seems negative
LEAST_SINE = 0.15  # sine of the angle between two headings below which their lines do not show where a robot turned
PARALLEL_SINE = 0.03  # sine of the angle between two headings below which their lines count as parallel
EDGE_CM = epuck.RADIUS_CM  # distance from the walls within which no robot's middle can be


class Identities(NamedTuple):
    """The robot that each flash belongs to."""

    robot: IntArray  # (flashes,) number of the robot, from 0, in order of their first flashes
    cycle: IntArray  # (flashes,) number of the flash among those of its robot, from 1
    certainty: FloatArray
    """(flashes,) probability that the link to the robot's flash before is right, against the best alternative; NaN for
    a robot's first flash."""
    speed_cm_s: float  # speed of a robot that drives straight ahead

    @property
    def robots(self) -> int:
        """Number of robots; one that was lost and found again counts twice."""
        return int(self.robot.max(initial=-1)) + 1

    @property
    def unsure(self) -> float:
        """Share of the links whose best alternative is nearly as good."""
        links = self.certainty[~np.isnan(self.certainty)]
        return float(np.mean(links < SURE)) if len(links) else 0.0


def link_flashes(flashes: FlashTable, period_s: float, floor_cm: tuple[float, float]) -> Identities:
    """Return the identities of a film's flashes, for the period of the oscillators and the floor's width and height."""
    if not len(flashes.onset_s):
        return Identities(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), 0.0)
    onset_s, habits = flashes.onset_s, Habits.at_first(flashes, period_s, floor_cm)
    source, target = pairs_within(onset_s, onset_s, (SHORTEST * period_s, 2 * LONGEST * period_s))
    ways = ways_between(flashes, source, target, habits)
    log_area = math.log(math.tau * floor_cm[0] * floor_cm[1])
    since, until = (onset_s - onset_s[0]) / period_s, (onset_s[-1] - onset_s) / period_s
    begin, end = (np.log(np.clip(1.0 - share, MISSED / 4, 1.0)) for share in (since, until))
    for _ in range(ROUNDS):
        costs = np.minimum(-habits.log_likelihood(ways) + begin[target] - log_area + end[source], 0.0)
        links = _link(onset_s, (source, target, costs), BLOCK_PERIODS * period_s)
        is_linked = links[source] == target
        if not is_linked.any():
            break
        habits = habits.relearnt(Ways(*(column[is_linked] for column in ways)))
    robot, cycle = np.full(len(links), -1), np.ones(len(links), np.int64)
    for first, second in enumerate(links):
        if robot[first] < 0:
            robot[first] = robot.max() + 1
        if second >= 0:
            robot[second], cycle[second] = robot[first], cycle[first] + 1
    certainty = _certainties(links, (source, target, costs), onset_s, period_s)
    return Identities(robot, cycle, certainty, habits.speed_cm_s)


Costs = tuple[IntArray, IntArray, FloatArray]
"""(n,) first flashes of links, ascending, second ones, and costs: negative if likelier than a lost and a new robot."""


def _block(costs: Costs, first: int, end: int) -> tuple[IntArray, FloatArray]:
    """Return (m,) the targets of some flashes, ascending, and (flashes, m) costs."""
    part = slice(*np.searchsorted(costs[0], (first, end)))
    targets, columns = np.unique(costs[1][part], return_inverse=True)
    table = np.zeros((end - first, len(targets)))
    table[costs[0][part] - first, columns] = costs[2][part]
    return targets, table


def _assign(costs: FloatArray) -> tuple[IntArray, IntArray]:
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 takes a while to load

    rows, columns = linear_sum_assignment(costs)
    return rows, columns


def _link(onset_s: FloatArray, costs: Costs, block_s: float) -> IntArray:
    """Return (flashes,) the flash that follows each, or -1; blocks overlap, so that their ends do not matter."""
    links = np.full(len(onset_s), -1)
    begin = 0
    while begin < len(onset_s):
        end, half = (int(np.searchsorted(onset_s, onset_s[begin] + part * block_s)) for part in (1.0, 0.5))
        keep = half if end < len(onset_s) else end
        targets, table = _block(costs, begin, end)
        table[:, np.isin(targets, links[:begin])] = 0.0
        rows, columns = _assign(table)
        is_link = (table[rows, columns] < 0) & (rows < keep - begin)
        links[begin + rows[is_link]] = targets[columns[is_link]]
        begin = keep
    return links


def _certainties(links: IntArray, costs: Costs, onset_s: FloatArray, period_s: float) -> FloatArray:
    """Return (flashes,) the certainty of the link to each flash from the one before; NaN where there is none.

    Each link is forbidden in turn, and the flashes within a period of its first flash are linked anew.
    """
    certainty = np.full(len(links), np.nan)
    linked = np.flatnonzero(links >= 0)
    before = np.full(len(links), -1)
    before[links[linked]] = linked
    for source in linked:
        first, end = np.searchsorted(onset_s, onset_s[source] + period_s * np.array([-1.0, 1.0]))
        targets, table = _block(costs, first, end)
        elsewhere = (before[targets] >= 0) & ((before[targets] < first) | (before[targets] >= end))
        table[:, elsewhere] = 0.0
        rows = np.flatnonzero(links[first:end] >= 0)
        columns = np.searchsorted(targets, links[first:end][rows])
        best = table[rows, columns].sum()
        table[source - first, np.searchsorted(targets, links[source])] = 0.0
        margin = max(float(table[_assign(table)].sum() - best), 0.0)
        certainty[links[source]] = 1 / (1 + math.exp(-margin))
    return certainty


class Ways(NamedTuple):
    """Ways from one flash to another, by their deviations from a straight way and from a way with a single turn."""

    gap_s: FloatArray
    distance: FloatArray  # from place to place, cm
    along: FloatArray  # from the end of a straight way, along the mean heading, cm
    aside: FloatArray  # the same across the mean heading
    swerve: FloatArray  # difference of the headings, rad from -pi to pi
    has_turn: BoolArray
    """Whether the lines ahead of the first and back from the second flash meet on the floor, in time."""
    turn_s: FloatArray  # time left for the turn, if there is one
    wall_s: FloatArray  # time after which the line ahead of the first flash meets a wall


class Habits(NamedTuple):
    """Usual motion and flashing of the robots of a film."""

    period_s: float
    speed_cm_s: float  # speed of a robot that drives straight ahead
    floor_cm: tuple[float, float]
    cycles: FloatArray  # (BINS,) density of cycles between `SHORTEST` and `LONGEST` periods, per period
    kinds: FloatArray  # (3,) shares of ways that are straight, have one turn, or are anything else
    along: float  # standard deviation along a straight way, relative to its length
    aside: float  # standard deviation across a straight way, relative to its length
    swerve: float  # standard deviation of the heading's change on a straight way, rad
    turn_s: float  # mean duration of a turn

    @classmethod
    def at_first(cls, flashes: FlashTable, period_s: float, floor_cm: tuple[float, float]) -> Self:
        """Return the habits that are assumed before any flash is linked."""
        middles = SHORTEST + (np.arange(BINS) + 0.5) * (LONGEST - SHORTEST) / BINS
        plain = np.exp(-(((middles - 1) / PLAIN_SPREAD) ** 2) / 2)
        shortened = np.where((middles > 0.5) & (middles < 1), 1.0, 0.02)
        cycles = (plain / plain.sum() + shortened / shortened.sum()) / 2 * BINS / (LONGEST - SHORTEST)
        speed_cm_s, kinds = commonest_speed(flashes.speeds_cm_s), np.array([0.5, 0.3, 0.2])
        return cls(period_s, speed_cm_s, floor_cm, cycles, kinds, along=0.03, aside=0.06, swerve=0.2, turn_s=0.7)

    def relearnt(self, ways: Ways) -> Self:
        """Return the habits learnt from the ways of robots, mixed with a weak prior."""
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

    def log_likelihood(self, ways: Ways) -> FloatArray:
        """Return (ways,) the logarithm of the density of each way's end, per cm, cm, rad and period."""
        share = ways.gap_s / self.period_s
        single, double = self._cycle_density(share), self._cycle_density(share / 2) / 2
        total: FloatArray = np.log(np.maximum(single + MISSED * double, 1e-300))
        total += np.log(np.maximum(self.kinds @ (self._parts(ways) / self.kinds[:, None]), 1e-300))
        return total

    def _cycle_density(self, share: FloatArray) -> FloatArray:
        place = np.floor((share - SHORTEST) / (LONGEST - SHORTEST) * BINS).astype(int)
        inside = (place >= 0) & (place < BINS)
        return np.asarray(np.where(inside, self.cycles[np.clip(place, 0, BINS - 1)], 0.0))

    def _parts(self, ways: Ways) -> FloatArray:
        """Return (3, ways) densities of a way's end if it is straight, has one turn, or neither, times `kinds`."""
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
        return np.asarray(self.kinds[:, None] * np.array([straight, turned, anything]))


def _normal(off: FloatArray, spread: FloatArray | float) -> FloatArray:
    return np.asarray(np.exp(-((off / spread) ** 2) / 2) / (spread * math.sqrt(math.tau)))


def commonest_speed(speeds_cm_s: FloatArray) -> float:
    """Return the speed that is commonest among the faster half: that of robots that do not turn."""
    fast = float(np.median(speeds_cm_s[speeds_cm_s >= np.median(speeds_cm_s)]))
    return mean_shift(speeds_cm_s, np.ones(len(speeds_cm_s)), fast, SPEED_SPREAD * fast)[0] if fast else 0.0


def ways_between(flashes: FlashTable, first: IntArray, second: IntArray, habits: Habits) -> Ways:
    """Return the ways from the flashes `first` to the flashes `second`, (ways,) indices into the table."""
    gap_s, speed = flashes.onset_s[second] - flashes.onset_s[first], max(habits.speed_cm_s, 0.05)
    apart = flashes.places_cm[second] - flashes.places_cm[first]
    ahead, after = (_directions(flashes.velocities_cm_s[each]) for each in (first, second))
    mean = _directions(ahead + after)
    along, aside = np.sum(apart * mean, axis=1) - speed * gap_s, _cross(mean, apart)
    sine = _cross(ahead, after)
    swerve = np.arctan2(sine, np.sum(ahead * after, axis=1))
    safe = np.where(sine == 0, 1.0, sine)
    ahead_cm, back_cm = _cross(apart, after) / safe, _cross(ahead, apart) / safe
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


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def _directions(vectors: FloatArray) -> FloatArray:
    """Return (n, 2) vectors of length 1; (1, 0) for those of length 0."""
    length = np.hypot(*vectors.T)[:, None]
    return np.asarray(np.where(length > 0, vectors / np.maximum(length, 1e-12), (1.0, 0.0)))
