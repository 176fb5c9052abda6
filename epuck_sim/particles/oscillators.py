"""When oscillators fire: a time for each, and the earliest of them without looking at all (thesis 3.1.1, 5.1.1).

An oscillator is known by the time at which it will fire, not by its phase: while nobody hears a pulse nothing needs to
be changed, and nothing adds up. Times are in cycles of the nominal period and count from the beginning of the present
cycle, so that they keep their digits however long a trial lasts: a whole number is taken off, which is exact.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.util.jit import jit_inline

BLOCK = 32
"""Of so many oscillators the earliest time is kept; of a block that has lost its earliest it is found anew."""

ONE_INSTANT = 1e-12
"""Firings no farther apart than this, in cycles, happen at once: rounding parts what has merged by less."""


class Oscillators(NamedTuple):
    """The oscillators, in cycles."""

    due: FloatArray
    """(agents,) when each fires next."""
    period: FloatArray
    """(agents,) 1, but for jitter."""
    earliest: FloatArray
    """(blocks,) the earliest time in each block."""
    is_stale: BoolArray
    """(blocks,) whether it has to be found anew."""
    now: FloatArray
    """(1,) the time of the last instant, from the beginning of the present cycle."""
    cycle: IntArray
    """(1,) cycles before the present one."""


def start_oscillators(phases: FloatArray, period: FloatArray) -> Oscillators:
    """Return clocks that stand at these phases, (agents,), at time 0; period: (agents,) in cycles."""
    blocks = math.ceil(len(phases) / BLOCK)
    due = (1 - phases) * period
    return Oscillators(due, period, np.empty(blocks), np.ones(blocks, np.bool_), np.zeros(1), np.zeros(1, np.int64))


@jit_inline
def set_next_firing(clocks: Oscillators, agent: int, time: float) -> None:
    """Have an oscillator fire at `time`."""
    block = agent // BLOCK
    if clocks.due[agent] <= clocks.earliest[block]:
        clocks.is_stale[block] = True
    clocks.due[agent] = time
    clocks.earliest[block] = min(clocks.earliest[block], time)


@jit_inline
def earliest_firing(clocks: Oscillators) -> float:
    """Return when the next oscillator fires."""
    soonest = math.inf
    for block in range(len(clocks.earliest)):
        if clocks.is_stale[block]:
            last = min((block + 1) * BLOCK, len(clocks.due))
            clocks.earliest[block] = minimum(clocks.due, block * BLOCK, last)
            clocks.is_stale[block] = False
        soonest = min(soonest, clocks.earliest[block])
    return soonest


@jit_inline
def firing_now(clocks: Oscillators, time: float, found: IntArray) -> int:
    """Write the numbers of all who fire at the instant `time` to `found`, (agents + 1,); return how many they are."""
    count = 0
    for block in range(len(clocks.earliest)):
        if clocks.earliest[block] <= time + ONE_INSTANT:
            for agent in range(block * BLOCK, min((block + 1) * BLOCK, len(clocks.due))):
                found[count] = agent  # overwritten by the next one if it is not due: no branch
                count += clocks.due[agent] <= time + ONE_INSTANT
    return count


@jit_inline
def phase_at(clocks: Oscillators, agent: int, time: float) -> float:
    """Return an oscillator's phase at `time`, no later than it fires."""
    phase: float = 1 - (clocks.due[agent] - time) / clocks.period[agent]
    return phase


@jit_inline
def begin_next_cycle(clocks: Oscillators) -> None:
    """Count times from a cycle later."""
    for agent in range(len(clocks.due)):
        clocks.due[agent] -= 1.0
    for block in range(len(clocks.earliest)):
        clocks.earliest[block] -= 1.0
    clocks.now[0] -= 1.0
    clocks.cycle[0] += 1


@jit_inline
def minimum(values: FloatArray, first: int, last: int) -> float:
    """Return the minimum of `values[first:last]`, inf if it is empty, without branches.

    Which of two values is smaller cannot be predicted, so that branches would often be mispredicted. Four minima are
    kept side by side, because each comparison has to wait for the one before.
    """
    a = b = c = d = math.inf
    whole = last - (last - first) % 4
    for place in range(first, whole, 4):
        a = min(a, values[place])
        b = min(b, values[place + 1])
        c = min(c, values[place + 2])
        d = min(d, values[place + 3])
    for place in range(whole, last):
        a = min(a, values[place])
    return min(a, b, c, d)


@jit_inline
def argmin(values: FloatArray, last: int) -> int:
    """Return the index of the first minimum of `values[:last]`, at least one value, without branches."""
    lowest = minimum(values, 0, last)
    found = 0
    for place in range(last - 1, -1, -1):
        found = place if values[place] == lowest else found
    return found
