"""The order parameter at a firing of the reference (thesis eqs. 3.4 and 5.7), and a test of when it can be skipped."""

import math

from epuck_sim.particles.oscillators import Oscillators, phase_at
from epuck_sim.util.jit import jit_inline

ROUNDING_MARGIN = 1e-12
"""Upper bound, with a wide margin, of the rounding error of an order parameter."""

COMPLEX = 0
"""Metric of eq. 5.7: the modulus of the mean phasor."""

REFERENCE = 1
"""Metric of eq. 3.4: the mean cosine of the phases relative to the reference."""

METRIC_CODES = {"complex": COMPLEX, "reference": REFERENCE}
"""Codes of the metrics that a scenario's `stop.metric` names; the same metrics as `order_parameter.METRICS`."""


@jit_inline
def are_phases_within(oscillators: Oscillators, max_offset: float, time: float) -> bool:
    """Return whether all phases at `time` are within `max_offset` cycles of 0, the reference's phase when it fires."""
    for agent in range(len(oscillators.next_firing)):
        phase = phase_at(oscillators, agent, time)
        if min(phase, 1 - phase) > max_offset:
            return False
    return True


@jit_inline
def measure_order(oscillators: Oscillators, metric: int, time: float) -> float:
    """Return the order parameter at `time`, at which the phase of the reference is 0."""
    cosines, sines = 0.0, 0.0
    for agent in range(len(oscillators.next_firing)):
        angle = 2 * math.pi * phase_at(oscillators, agent, time)
        cosines += math.cos(angle)
        sines += math.sin(angle)
    if metric == REFERENCE:
        return cosines / len(oscillators.next_firing)
    return math.hypot(cosines, sines) / len(oscillators.next_firing)


def max_phase_offset(agents: int, threshold: float) -> float:
    """Return how far, in cycles, a phase may be from the reference's if the order parameter reaches `threshold`.

    With two of n oscillators an angle d apart, n r <= n - 2 + 2 cos(d / 2); eta is never larger than r.
    """
    cosine = 1 - agents * (1 - threshold + ROUNDING_MARGIN) / 2
    return math.acos(cosine) / math.pi if -1 < cosine < 1 else 1.0
