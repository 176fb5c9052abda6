"""Oscillators stored as the times of their next firings, and a fast search for the earliest (thesis 3.1.1, 5.1.1).

As long as no pulse arrives, a firing time needs no update, so that no rounding error accumulates as it would in a
phase. Times are in cycles of the nominal period, counted from the start of the present cycle: however long a trial
lasts, they keep their digits, because whole cycles are subtracted exactly.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IndexArray, IntArray
from epuck_sim.util.jit import jit_inline

BLOCK_SIZE = 32
"""Number of oscillators in a block; each block keeps its earliest firing time, and is searched again after a change."""

SIMULTANEITY_CYCLES = 1e-12
"""Firings no farther apart than this count as simultaneous: rounding separates merged oscillators by less."""


class Oscillators(NamedTuple):
    """Firing times and periods of all oscillators; times in cycles since the start of the present cycle."""

    next_firing: FloatArray
    """(agents,) time of each oscillator's next firing."""
    period: FloatArray
    """(agents,) each oscillator's period in cycles: 1 without jitter."""
    block_earliest: FloatArray
    """(blocks,) the earliest time in each block of `next_firing`."""
    is_stale: BoolArray
    """(blocks,) whether `block_earliest` must be searched for again."""
    now: FloatArray
    """(1,) the present time: usually that of the last event."""
    cycle: IntArray
    """(1,) number of the present cycle, from 0."""


def start_oscillators(phases: FloatArray, period: FloatArray) -> Oscillators:
    """Return oscillators which have the given phases, (agents,), at time 0; period: (agents,) cycles."""
    blocks = math.ceil(len(phases) / BLOCK_SIZE)
    next_firing = (1 - phases) * period
    return Oscillators(
        next_firing, period, np.empty(blocks), np.ones(blocks, np.bool_), np.zeros(1), np.zeros(1, np.int64)
    )


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


@jit_inline
def rebase_oscillators(oscillators: Oscillators) -> None:
    """Count all times from the start of the next cycle."""
    for agent in range(len(oscillators.next_firing)):
        oscillators.next_firing[agent] -= 1.0
    for block in range(len(oscillators.block_earliest)):
        oscillators.block_earliest[block] -= 1.0
    oscillators.now[0] -= 1.0
    oscillators.cycle[0] += 1


@jit_inline
def minimum(values: FloatArray, first: int, last: int) -> float:
    """Return the minimum of `values[first:last]`, inf if it is empty.

    Branch-free: the comparisons are unpredictable, so branches would be mispredicted. Four minima are kept side by
    side, because each comparison has to wait for the one before.
    """
    a = b = c = d = math.inf
    whole = last - (last - first) % 4
    for index in range(first, whole, 4):
        a = min(a, values[index])
        b = min(b, values[index + 1])
        c = min(c, values[index + 2])
        d = min(d, values[index + 3])
    for index in range(whole, last):
        a = min(a, values[index])
    return min(a, b, c, d)


@jit_inline
def argmin(values: FloatArray, last: int) -> int:
    """Return the index of the first minimum of `values[:last]`, which must not be empty; branch-free."""
    lowest = minimum(values, 0, last)
    found = last
    for index in range(last):
        found = min(found, index if values[index] == lowest else last)
    return found
