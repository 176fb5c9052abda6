"""Oscillators as the times of their next firings, a fast search for the earliest, and the order parameter.

See thesis 3.1.1 and 5.1.1, and equations 3.4 and 5.7. As long as no pulse arrives, a firing time needs no update, so
that no rounding error accumulates as it would in a phase.
"""

import math

from epuck_sim.arrays import IndexArray
from epuck_sim.particles.selection import minimum
from epuck_sim.particles.swarm import Arrays, Oscillators
from epuck_sim.util.elementary import hypot, sin_cos
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import unlikely

BRANCHES = 32
"""Number of oscillators in a block, and in large swarms of blocks in a group, and of groups in a part. All these keep
their earliest firing time, or -inf until it is searched again: a firing costs little however many there are."""

FLAT = 2048  # largest number of oscillators without groups and parts: to look at all blocks is as fast

SIMULTANEITY_CYCLES = 1e-12
"""Firings no farther apart than this count as simultaneous: rounding separates merged oscillators by less."""

Moment = tuple[float, float]  # a cycle, from 0, and the time in it, 0 to 1
ROUNDING_MARGIN = 1e-12  # upper bound, with a wide margin, of the rounding error of an order parameter


@jit_inline
def set_next_firing(oscillators: Oscillators, agent: int, time: float) -> None:
    """Set the time of an oscillator's next firing."""
    block = agent // BRANCHES
    # a block that may lose its earliest firing is searched again when needed
    earliest = -math.inf if oscillators.next_firing[agent] <= oscillators.block_earliest[block] else time
    oscillators.next_firing[agent] = time
    oscillators.block_earliest[block] = min(oscillators.block_earliest[block], earliest)
    if unlikely(len(oscillators.part_earliest) > 0):
        group, part = block // BRANCHES, block // BRANCHES**2
        oscillators.group_earliest[group] = min(oscillators.group_earliest[group], earliest)
        oscillators.part_earliest[part] = min(oscillators.part_earliest[part], earliest)


def forget_earliest(swarm: Arrays) -> None:
    """Mark the earliest firing times of all blocks as stale, after firing times have been set."""
    for earliest in (swarm.block_earliest, swarm.group_earliest, swarm.part_earliest):
        earliest[:] = -math.inf


@jit_inline
def earliest_firing(oscillators: Oscillators) -> float:
    """Return the time of the earliest next firing; search stale blocks again."""
    if unlikely(len(oscillators.part_earliest) > 0):
        return _earliest_of_parts(oscillators)
    return _earliest_of_blocks(oscillators, 0, len(oscillators.block_earliest))


@jit_inline
def _earliest_of_blocks(oscillators: Oscillators, first: int, end: int) -> float:
    earliest = math.inf
    for block in range(first, end):
        if oscillators.block_earliest[block] == -math.inf:
            last = min((block + 1) * BRANCHES, len(oscillators.next_firing))
            oscillators.block_earliest[block] = minimum(oscillators.next_firing, block * BRANCHES, last)
        earliest = min(earliest, oscillators.block_earliest[block])
    return earliest


@jit_no_alloc
def _earliest_of_parts(oscillators: Oscillators) -> float:
    groups, parts = oscillators.group_earliest, oscillators.part_earliest
    for part in range(len(parts)):
        if parts[part] == -math.inf:
            last = min((part + 1) * BRANCHES, len(groups))
            for group in range(part * BRANCHES, last):
                if groups[group] == -math.inf:
                    end = min((group + 1) * BRANCHES, len(oscillators.block_earliest))
                    groups[group] = _earliest_of_blocks(oscillators, group * BRANCHES, end)
            parts[part] = minimum(groups, part * BRANCHES, last)
    return minimum(parts, 0, len(parts))


@jit_inline
def firing_now(oscillators: Oscillators, time: float, found: IndexArray) -> int:
    """Write the indices of all oscillators that fire at `time` to `found`, (agents + 1,); return their number."""
    if unlikely(len(oscillators.part_earliest) > 0):
        return _firing_in_parts(oscillators, time + SIMULTANEITY_CYCLES, found)
    return _firing_in_blocks(oscillators, 0, len(oscillators.block_earliest), time + SIMULTANEITY_CYCLES, found, 0)


@jit_inline
def _firing_in_blocks(
    oscillators: Oscillators, begin: int, end: int, limit: float, found: IndexArray, count: int
) -> int:
    """Add the oscillators of some blocks that fire up to `limit` to the `count` found so far; return the new count."""
    for block in range(begin, end):
        if oscillators.block_earliest[block] <= limit:
            first = block * BRANCHES
            times = oscillators.next_firing[first : first + BRANCHES]
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


@jit_no_alloc
def _firing_in_parts(oscillators: Oscillators, limit: float, found: IndexArray) -> int:
    count, groups = 0, oscillators.group_earliest
    for part in range(len(oscillators.part_earliest)):
        if oscillators.part_earliest[part] <= limit:
            for group in range(part * BRANCHES, min((part + 1) * BRANCHES, len(groups))):
                if groups[group] <= limit:
                    end = min((group + 1) * BRANCHES, len(oscillators.block_earliest))
                    count = _firing_in_blocks(oscillators, group * BRANCHES, end, limit, found, count)
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
    """Return the order parameter at `time`, at which the phase of the reference is 0: one of `order_parameter.METRICS`.

    It is the modulus of the mean phasor (eq. 5.7), or the mean cosine of phases relative to the reference's (eq. 3.4).
    """
    cosines, sines = 0.0, 0.0
    for agent in range(len(oscillators.next_firing)):
        sine, cosine = sin_cos(2 * math.pi * phase_at(oscillators, agent, time))
        cosines += cosine
        sines += sine
    if oscillators.scene.is_relative:
        return cosines / len(oscillators.next_firing)
    return hypot(cosines, sines) / len(oscillators.next_firing)


def last_firing_before(moment: Moment) -> Moment:
    """Return the latest moment of firings that are simultaneous with a moment, and thus precede a change at it."""
    cycle, time = moment
    later, within = divmod(time + SIMULTANEITY_CYCLES, 1.0)
    return cycle + later, within


def max_phase_offset(agents: int, threshold: float) -> float:
    """Return how far, in cycles, a phase may be from the reference's if the order parameter reaches `threshold`.

    With two of n oscillators an angle d apart, n r <= n - 2 + 2 cos(d / 2); eta is never larger than r.
    """
    cosine = 1 - agents * (1 - threshold + ROUNDING_MARGIN) / 2
    return math.acos(cosine) / math.pi if -1 < cosine < 1 else 1.0
