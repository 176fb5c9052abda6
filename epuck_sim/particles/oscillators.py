"""Oscillators as the times of their next firings, a fast search for the earliest, and the order parameter.

See thesis 3.1.1 and 5.1.1, and equations 3.4 and 5.7. As long as no pulse arrives, a firing time needs no update, so
that no rounding error accumulates as it would in a phase.
"""

import math

from epuck_sim.arrays import IndexArray
from epuck_sim.particles.selection import minimum
from epuck_sim.particles.swarm import Oscillators
from epuck_sim.util.jit import jit_inline, jit_no_alloc

BLOCK_SIZE = 32
"""Number of oscillators in a block; each block keeps its earliest firing time, and is searched again after a change."""

SIMULTANEITY_CYCLES = 1e-12
"""Firings no farther apart than this count as simultaneous: rounding separates merged oscillators by less."""

ROUNDING_MARGIN = 1e-12
"""Upper bound, with a wide margin, of the rounding error of an order parameter."""

COMPLEX, REFERENCE = range(2)
"""Metrics: the modulus of the mean phasor (eq. 5.7), the mean cosine of phases relative to the reference (eq. 3.4)."""

METRIC_CODES = {"complex": COMPLEX, "reference": REFERENCE}
"""Codes of the metrics that a scenario's `stop.metric` names; the same metrics as `order_parameter.METRICS`."""


@jit_inline
def set_next_firing(oscillators: Oscillators, agent: int, time: float) -> None:
    """Set the time of an oscillator's next firing."""
    block = agent // BLOCK_SIZE
    if oscillators.next_firing[agent] <= oscillators.block_earliest[block]:
        oscillators.is_stale[block] = True
    oscillators.next_firing[agent] = time
    oscillators.block_earliest[block] = min(oscillators.block_earliest[block], time)


@jit_inline
def earliest_firing(oscillators: Oscillators) -> float:
    """Return the time of the earliest next firing; searches stale blocks again."""
    earliest = math.inf
    for block in range(len(oscillators.block_earliest)):
        if oscillators.is_stale[block]:
            last = min((block + 1) * BLOCK_SIZE, len(oscillators.next_firing))
            oscillators.block_earliest[block] = minimum(oscillators.next_firing, block * BLOCK_SIZE, last)
            oscillators.is_stale[block] = False
        earliest = min(earliest, oscillators.block_earliest[block])
    return earliest


@jit_inline
def firing_now(oscillators: Oscillators, time: float, found: IndexArray) -> int:
    """Write the indices of all oscillators that fire at `time` to `found`, (agents + 1,); return their number."""
    limit = time + SIMULTANEITY_CYCLES
    count = 0
    for block in range(len(oscillators.block_earliest)):
        if oscillators.block_earliest[block] <= limit:
            first = block * BLOCK_SIZE
            times = oscillators.next_firing[first : first + BLOCK_SIZE]
            firing, sum_of_indices = 0, 0
            for index in range(len(times)):
                firing += times[index] <= limit
                sum_of_indices += index * (times[index] <= limit)
            if firing == 1:  # as a rule; the two sums vectorise
                found[count] = first + sum_of_indices
                count += 1
            else:
                for index in range(len(times)):
                    found[count] = first + index  # overwritten by the next one if this one does not fire: no branch
                    count += times[index] <= limit
    return count


@jit_inline
def phase_at(oscillators: Oscillators, agent: int, time: float) -> float:
    """Return an oscillator's phase at a time which is not after its next firing."""
    phase: float = 1 - (oscillators.next_firing[agent] - time) / oscillators.period[agent]
    return phase


@jit_no_alloc
def are_phases_within(oscillators: Oscillators, max_offset: float, time: float) -> bool:
    """Return whether all phases at `time` are within `max_offset` cycles of 0, the reference's phase when it fires."""
    for agent in range(len(oscillators.next_firing)):
        phase = phase_at(oscillators, agent, time)
        if min(phase, 1 - phase) > max_offset:
            return False
    return True


@jit_no_alloc
def measure_order(oscillators: Oscillators, time: float) -> float:
    """Return the order parameter at `time`, at which the phase of the reference is 0."""
    cosines, sines = 0.0, 0.0
    for agent in range(len(oscillators.next_firing)):
        angle = 2 * math.pi * phase_at(oscillators, agent, time)
        cosines += math.cos(angle)
        sines += math.sin(angle)
    if oscillators.scene.metric == REFERENCE:
        return cosines / len(oscillators.next_firing)
    return math.hypot(cosines, sines) / len(oscillators.next_firing)


def max_phase_offset(agents: int, threshold: float) -> float:
    """Return how far, in cycles, a phase may be from the reference's if the order parameter reaches `threshold`.

    With two of n oscillators an angle d apart, n r <= n - 2 + 2 cos(d / 2); eta is never larger than r.
    """
    cosine = 1 - agents * (1 - threshold + ROUNDING_MARGIN) / 2
    return math.acos(cosine) / math.pi if -1 < cosine < 1 else 1.0
