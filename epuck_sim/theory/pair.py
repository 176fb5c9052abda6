"""What a response curve does to two oscillators: when they synchronise, and how a small lead or lag grows."""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.particles.phase_response import Response, phase_shift

SMALL = 1e-4  # lead and lag, in cycles, that count as small
GRID = (np.arange(400) + 0.5) / 400  # phases from which a pair is followed
MOST_FIRINGS = 20_000  # firings of a pair after which it counts as one that never synchronises


class Pair(NamedTuple):
    """Two oscillators that receive each other's pulses."""

    lead: float  # ln of the factor by which a small lead grows at a pulse: of who has just fired
    lag: float  # the same for a small lag: of who is about to fire; minus infinity where the pulse makes it fire
    growth: float
    """ln of the factor by which 1 - r of a pair near synchrony changes in a cycle, in which each receives a pulse."""
    cycles: float  # mean T_sync from random phases, in cycles; infinite where some phases never synchronise


def _after(response: Response, phases: FloatArray) -> FloatArray:
    """Return the phase of who fires when the other one fires next, which a pulse has met at these phases.

    Taken twice, it is the return map of thesis eq. 5.2.
    """
    return 1 - (phases + phase_shift(response, phases))


def measure_pair(response: Response, threshold: float) -> Pair:
    """Return what a curve does to two oscillators, which count as one at a threshold of the order parameter."""
    offsets = np.array([SMALL, 1 - SMALL])
    lead, lag = np.abs(offsets + phase_shift(response, offsets) - [0, 1]).tolist()
    square = (lead**2 + lag**2) / (2 * SMALL**2)  # 1 - r of two is in proportion to the square of their distance
    near = math.acos(min(threshold, 1.0)) / math.pi
    phases, firings = GRID.copy(), np.ones(len(GRID))
    for _ in range(MOST_FIRINGS):
        apart = (phases > near) & (phases < 1 - near)
        if not apart.any():
            break
        firings[apart] += 1
        phases[apart] = _after(response, phases[apart])
    else:
        firings[:] = math.inf
    return Pair(_log(lead / SMALL), _log(lag / SMALL), _log(square), float(firings.mean()) / 2)


def _log(factor: float) -> float:
    return math.log(factor) if factor > 0 else -math.inf
