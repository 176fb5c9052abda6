"""T_sync of two oscillators, of swarms that stand, and of swarms so fast that all links are new at each instant.

A pair follows from the response curve alone. Both kinds of swarms are Markov chains of phases on snapshots: the frozen
swarm keeps its snapshot, the fast one draws another at each instant, which is the mean field with the same links
(thesis 2.4, 3.4). An instant has the rules of `particles.events`; the response curve is a table, in which a chain
interpolates between phases.
"""

import math
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
GRID = (np.arange(400) + 0.5) / 400  # phases from which a pair is followed
MOST_FIRINGS = 20_000  # firings of a pair after which it counts as one that never synchronises


class Pair(NamedTuple):
    """Two oscillators that receive each other's pulses."""

    lead: float  # ln of the factor by which a small lead, of one that has just fired, grows at a pulse
    lag: float  # the same for a small lag, of one that is about to fire; minus infinity where the pulse makes it fire
    growth: float
    """ln of the factor by which 1 - r of a pair near synchrony changes in a cycle, in which each receives a pulse."""
    cycles: float  # mean T_sync from random phases, in cycles; infinite where some phases never synchronise


def measure_pair(response: Response, threshold: float) -> Pair:
    """Measure a response curve on two oscillators, which are synchronised at a threshold of the order parameter."""
    offsets = np.array([SMALL, 1 - SMALL])
    lead, lag = np.abs(offsets + phase_shift(response, offsets) - [0, 1]).tolist()
    square = (lead**2 + lag**2) / (2 * SMALL**2)  # 1 - r of two is proportional to the square of their distance
    near = math.acos(min(threshold, 1.0)) / math.pi
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
    return Pair(_log(lead / SMALL), _log(lag / SMALL), _log(square), float(firings.mean()) / 2)


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
    response: Response,
    threshold: float,
    snapshots: BoolArray,
    hold: float,
    jitter: float = 0.0,
    chains: int = CHAINS,
) -> Limit:
    """Return T_sync on snapshots of a swarm, (snapshots, agents, agents): sender, receiver; for `hold` see `Limit`."""
    if not len(snapshots):
        return Limit(hold, UNDETERMINED, Estimate(0.0))
    random, agents = np.random.default_rng(0), snapshots.shape[1]
    counts = snapshots.sum(2)
    receivers = np.argsort(~snapshots, axis=2, kind="stable")[:, :, : counts.max()]
    grid = np.linspace(0, 1, TABLE)
    after = grid + phase_shift(response, grid)
    times, has_ended, instants = [], [], 0
    for _ in range(chains):
        which = random.integers(len(snapshots), size=1 if hold == math.inf else MOST_INSTANTS)
        periods = np.maximum(1 + jitter * random.standard_normal(agents), 0.1)
        phases = random.random((agents,))
        taken, cycles, ended = run_chain(
            after, response.refractory, threshold, receivers, counts, which, hold, phases, periods
        )
        times.append(cycles)
        has_ended.append(ended)
        instants += taken
        if instants > ALL_INSTANTS:
            break
    count = sum(has_ended)
    ended_share = share(np.array(has_ended, np.bool_))
    if not count:
        return Limit(hold, UNDETERMINED, ended_share, sum(times))
    value = sum(times) / count
    spread = float(np.std(times, ddof=1)) / value if len(times) == count > 1 else 1.0
    factor = math.exp(QUANTILE * spread / math.sqrt(count))
    return Limit(hold, Estimate(value, value / factor, value * factor), ended_share, sum(times))


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
