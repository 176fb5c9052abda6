"""The order parameter at a firing of the reference (thesis eqs. 3.4 and 5.7), and when it need not be worked out."""

import math

from epuck_sim.particles.oscillators import Oscillators, phase_at
from epuck_sim.util.jit import jit_inline

ROUNDING = 1e-12
"""Far more than the order parameter is off by."""

COMPLEX, REFERENCE = range(2)
"""Metrics: eqs. 5.7 and 3.4."""


@jit_inline
def are_near(clocks: Oscillators, near: float, time: float) -> bool:
    """Whether no phase is farther than `near`, in cycles, from that of the reference, which is 0 at `time`."""
    for agent in range(len(clocks.due)):
        phase = phase_at(clocks, agent, time)
        if min(phase, 1 - phase) > near:
            return False
    return True


@jit_inline
def measure_order(clocks: Oscillators, metric: int, time: float) -> float:
    """Return the order parameter at `time`, at which the reference is at phase 0."""
    cosines, sines = 0.0, 0.0
    for agent in range(len(clocks.due)):
        angle = 2 * math.pi * phase_at(clocks, agent, time)
        cosines += math.cos(angle)
        sines += math.sin(angle)
    if metric == REFERENCE:
        return cosines / len(clocks.due)
    return math.hypot(cosines, sines) / len(clocks.due)


def near_enough(agents: int, threshold: float) -> float:
    """Return how far, in cycles, a phase may be from the reference's if `threshold` is to be reached.

    With two of n oscillators an angle d apart, n r <= n - 2 + 2 cos(d / 2); eta is never larger than r.
    """
    cosine = 1 - agents * (1 - threshold + ROUNDING) / 2
    return math.acos(cosine) / math.pi if -1 < cosine < 1 else 1.0
