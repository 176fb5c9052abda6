"""T_sync of two oscillators, of swarms that stand, and of swarms so fast that all links are new at each instant.

A pair follows from the response curve alone. Both kinds of swarms are Markov chains of phases on snapshots: the frozen
swarm keeps its snapshot, the fast one draws another at each instant, which is the mean field with the same links
(thesis 2.4, 3.4). An instant has the rules of `particles.events`; the response curve is a table, in which a chain
interpolates between phases.

In between, a chain keeps the links of a snapshot for some cycles, its hold, and then takes those of another, as the
blinking networks of Belykh, Belykh and Hasler (2004) do. T_sync over the hold has the shape of T_sync over the speed:
with a shorter hold it falls, because swarms wait for links less long, down to that of the fast limit. In between it may
rise, where links last long enough for clusters to agree, but not for clusters to agree with each other: an intermediate
regime. Beardo, Prignano, Sagarra and Diaz-Guilera (2018, arXiv 1801.03973) find this where networks are sparse and not
reciprocal: clusters are frustrated there.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.estimate import UNDETERMINED, Estimate
from epuck_sim.particles.phase_response import Response, phase_shift
from epuck_sim.statistics.survival import QUANTILE
from epuck_sim.theory.snapshots import share
from epuck_sim.util.jit import jit

CHAINS = 60  # default number of chains that are run, if they end soon enough

MOST_INSTANTS, ALL_INSTANTS = 40_000, 100_000
"""Number of instants after which a chain is censored, and that of all chains of a limit after which no other begins."""

TABLE = 20_001  # number of phases from 0 to 1 at which a response curve is tabulated
SIMULTANEOUS = 1e-12  # cycles within which firings are at one instant, as in the models

SMALL = 1e-4  # lead and lag, in cycles, that count as small
GRID = (np.arange(400) + 0.5) / 400  # phases of the other of a pair when the first one fires: as likely as large
MOST_FIRINGS = 20_000  # firings of a pair after which it counts as one that never synchronises


class Pair(NamedTuple):
    """Two oscillators that receive each other's pulses."""

    lead: float  # ln of the factor by which a small lead, of one that has just fired, grows at a pulse
    lag: float  # the same for a small lag, of one that is about to fire; minus infinity where the pulse makes it fire
    growth: float
    """ln of the factor by which 1 - r of a pair near synchrony changes at a pulse, on average of a lead and a lag."""
    cycles: float  # mean T_sync from random phases, in cycles; infinite where some phases never synchronise


def measure_pair(response: Response, threshold: float) -> Pair:
    """Measure a response curve on two oscillators, which are synchronised at a threshold of the order parameter."""
    offsets = np.array([SMALL, 1 - SMALL])
    lead, lag = np.abs(offsets + phase_shift(response, offsets) - [0, 1]).tolist()
    square = (lead**2 + lag**2) / (2 * SMALL**2)  # 1 - r of two is proportional to the square of their distance
    near = math.acos(threshold) / math.pi
    phases, firings = GRID.copy(), np.ones(len(GRID))
    for _ in range(MOST_FIRINGS):
        apart = (phases > near) & (phases < 1 - near)
        if not apart.any():
            break
        firings[apart] += 1
        met = phases[apart] + phase_shift(response, phases[apart])
        phases[apart] = 1 - met  # phase of the next to fire, at the other's firing; applied twice, thesis eq. 5.2
    else:
        firings[:] = math.inf
    return Pair(_log(lead / SMALL), _log(lag / SMALL), _log(square), float(np.average(firings, weights=GRID)) / 2)


def _log(factor: float) -> float:
    return math.log(factor) if factor > 0 else -math.inf


class Limit(NamedTuple):
    """T_sync in a limit."""

    hold: float  # cycles for which links stay: 0 if they are new at each instant, infinite if they are never renewed
    cycles: Estimate
    """Mean T_sync; NaN if no chain has ended. Where some are censored, times are taken to be exponential."""
    ended: Estimate  # share of chains that have ended before they were censored
    waited: float = math.nan  # cycles that all chains have taken together


def find_limit(
    response: Response, threshold: float, snapshots: BoolArray, hold: float, jitter: float = 0.0, chains: int = CHAINS
) -> Limit:
    """Return T_sync on snapshots of a swarm, (snapshots, agents, agents): sender, receiver; for `hold` see `Limit`."""
    if not len(snapshots):
        return Limit(hold, UNDETERMINED, Estimate(0.0))
    random, agents = np.random.default_rng(0), snapshots.shape[1]
    counts = snapshots.sum(2)
    receivers = np.argsort(~snapshots, axis=2, kind="stable")[:, :, : counts.max()]
    grid = np.linspace(0, 1, TABLE)
    rules = grid + phase_shift(response, grid), response.refractory, threshold, receivers, counts
    times, has_ended, instants = [], [], 0
    for _ in range(chains):
        which = random.integers(len(snapshots), size=1 if hold == math.inf else MOST_INSTANTS)
        periods = np.maximum(1 + jitter * random.standard_normal(agents), 0.1)
        taken, cycles, ended = run_chain(*rules, which, hold, random.random((agents,)), periods)
        times.append(cycles)
        has_ended.append(ended)
        instants += taken
        if instants > ALL_INSTANTS:
            break
    mean = UNDETERMINED
    if count := sum(has_ended):
        value = sum(times) / count
        spread = float(np.std(times, ddof=1)) / value if len(times) == count > 1 else 1.0
        factor = math.exp(QUANTILE * spread / math.sqrt(count))
        mean = Estimate(value, value / factor, value * factor)
    return Limit(hold, mean, share(np.array(has_ended, np.bool_)), sum(times))


@jit
def run_chain(
    after: FloatArray,
    refractory: float,
    threshold: float,
    receivers: IntArray,
    counts: IntArray,
    which: IntArray,
    hold: float,
    phases: FloatArray,
    periods: FloatArray,
) -> tuple[int, int, bool]:
    """Run a chain to its end; return instants, firings of the reference, and whether it is synchronised.

    `after` is the tabulated phase after a pulse, `receivers` are (snapshots, agents, most receivers), of which `counts`
    are taken; `which` are the indices of the snapshots in turn. Phases are overwritten.
    """
    agents, last, cycles = len(phases), len(after) - 1, 0
    elapsed = 0.0
    fired, is_done = np.zeros(agents, np.int64), np.zeros(agents, np.bool_)
    for instant in range(MOST_INSTANTS):
        turn = int(elapsed / hold) if hold > 0 else instant
        snapshot = which[turn % len(which)]
        left = math.inf
        for agent in range(agents):
            left = min(left, (1 - phases[agent]) * periods[agent])
        elapsed += left
        count = 0
        for agent in range(agents):
            phases[agent] += left / periods[agent]
            is_done[agent] = phases[agent] >= 1 - SIMULTANEOUS
            if is_done[agent]:
                fired[count] = agent
                count += 1
        sent = 0
        while sent < count:
            sender = fired[sent]
            for rank in range(counts[snapshot, sender]):
                other = receivers[snapshot, sender, rank]
                if is_done[other] or phases[other] <= refractory:
                    continue
                is_done[other] = True
                place = phases[other] * last
                index = min(int(place), last - 1)
                phases[other] = after[index] + (place - index) * (after[index + 1] - after[index])
                if phases[other] >= 1 - SIMULTANEOUS:
                    fired[count] = other
                    count += 1
            sent += 1
        has_reference = False
        for index in range(count):
            phases[fired[index]] = 0.0
            has_reference |= fired[index] == 0  # agents are alike: the first is the reference
        if has_reference:
            cycles += 1
            cosines = sines = 0.0
            for agent in range(agents):
                cosines += math.cos(2 * math.pi * phases[agent])
                sines += math.sin(2 * math.pi * phases[agent])
            if math.sqrt(cosines * cosines + sines * sines) >= threshold * agents:
                return instant + 1, cycles, True
    return MOST_INSTANTS, cycles, False


EVIDENCE = (-2.9, 3.4, 2.0)
"""Log odds of an intermediate regime without evidence, and what `Rise.log_ratio` and `Rise.excess` add to them per
unit; fixed on trials of 130 random scenarios. docs/theory.md says how well they do on others."""

HIDDEN, BEHIND_FALL = 0.3, 4.0
"""Rise below which the peak is looked for behind the steepest fall, and its hold over that where the fall begins."""

YES, NO = 0.7, 0.3  # least probability for the verdict yes, and largest for no; open in between


class Rise(NamedTuple):
    """The rise of T_sync over the hold that is most certain."""

    log_ratio: float
    """Logarithm of T_sync at the peak over that at the minimum before it, less its standard error; 0 without a rise."""
    excess: float
    """Logarithm of the steepest fall when the hold is halved, over 2, less its standard error; 0 or more.

    A swarm that only waits for links then takes half as long. One that takes much less has left a peak, though chains
    may not end there, nor at the minimum before it."""
    minimum: float  # hold at the minimum, in cycles; NaN where it is not seen
    peak: float  # hold at the peak, in cycles


class Verdict(NamedTuple):
    """Whether there is an intermediate regime."""

    verdict: str  # `yes`, `no` or `open`
    probability: float


def find_rise(course: Sequence[Limit]) -> Rise:
    """Return the most certain rise of a course: T_sync with each hold, from the longest on, at last in the fast limit.

    >>> times = {4: 50, 2: 10, 1: 40}
    >>> find_rise([Limit(hold, Estimate(t, t / 1.1, t * 1.1), Estimate(1.0), t) for hold, t in times.items()])[2:]
    (2, 1)
    """
    known = [(limit, *_log_time(limit)) for limit in course if limit.hold > 0]
    rises = [(0.0, math.nan, math.nan)]
    for place, (peak, top, top_error) in enumerate(known):
        for minimum, bottom, error in known[:place]:
            if not math.isnan(minimum.cycles.value):
                rises.append((top - bottom - math.hypot(top_error, error), minimum.hold, peak.hold))
    log_ratio, minimum_at, peak_at = max(rises)
    falls = [(0.0, math.nan)]
    for (slower, top, top_error), (faster, bottom, error) in pairwise(known):
        if faster.hold >= 1:
            halved = math.log(slower.hold / faster.hold)
            falls.append((top - bottom - halved - math.hypot(top_error, error), slower.hold))
    excess, begin = max(falls)
    if log_ratio < HIDDEN:
        minimum_at, peak_at = math.nan, BEHIND_FALL * begin
    return Rise(log_ratio, excess, minimum_at, peak_at)


def judge(rise: Rise) -> Verdict:
    """Return the verdict on a swarm whose pulses shift phases."""
    base, by_rise, by_fall = EVIDENCE
    probability = 1 / (1 + math.exp(-base - by_rise * rise.log_ratio - by_fall * rise.excess))
    return Verdict("yes" if probability >= YES else "no" if probability <= NO else "open", probability)


def time_at(course: Sequence[Limit], hold: float) -> Estimate:
    """Return T_sync with a hold, interpolated in a course; below its shortest hold, that of the fast limit."""
    *slower, fast = course
    if slower[0].hold <= hold < math.inf:
        return slower[0].cycles.apply(lambda cycles: cycles * hold / slower[0].hold)
    if hold < slower[-1].hold:
        return fast.cycles
    place, rows = -np.log([limit.hold for limit in slower]), np.array([limit.cycles.ends for limit in slower])
    value, low, high = (math.exp(np.interp(-math.log(hold), place, np.log(column))) for column in rows.T)
    return Estimate(value, low, high)


def _log_time(limit: Limit) -> tuple[float, float]:
    """Return the logarithm of T_sync and its standard error; if no chain has ended, that of all chains' time, and 1."""
    value, low, _ = limit.cycles.ends
    if math.isnan(value):
        return math.log(max(limit.waited, 1.0)), 1.0
    return math.log(value), math.log(value / low) / QUANTILE
