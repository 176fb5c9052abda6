"""When oscillators fire: a time for each, and the earliest of them without looking at all (thesis 3.1.1, 5.1.1).

An oscillator is known by the time at which it will fire, not by its phase: while nobody hears a pulse nothing needs to
be changed, and nothing adds up. Times are in cycles of the nominal period and count from the beginning of the present
cycle, so that they keep their digits however long a trial lasts: a whole number is taken off, which is exact.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.particles.least import least
from epuck_sim.util.jit import inlined_kernel

Floats = npt.NDArray[np.float64]

BLOCK = 32
"""Of so many oscillators the earliest time is kept; of a block that has lost its earliest it is found anew."""

ONE_INSTANT = 1e-12
"""Firings no farther apart than this, in cycles, happen at once: rounding parts what has merged by less."""


class Clocks(NamedTuple):
    """The oscillators, in cycles."""

    due: Floats
    """(agents,) when each fires next."""
    period: Floats
    """(agents,) 1, but for jitter."""
    earliest: Floats
    """(blocks,) the earliest time in each block."""
    is_stale: npt.NDArray[np.bool_]
    """(blocks,) whether it has to be found anew."""
    now: Floats
    """(1,) the time of the last instant, from the beginning of the present cycle."""
    cycle: npt.NDArray[np.int64]
    """(1,) cycles before the present one."""


def start_clocks(phases: Floats, period: Floats) -> Clocks:
    """Return clocks that stand at these phases, (agents,), at time 0; period: (agents,) in cycles."""
    blocks = math.ceil(len(phases) / BLOCK)
    due = (1 - phases) * period
    return Clocks(due, period, np.empty(blocks), np.ones(blocks, np.bool_), np.zeros(1), np.zeros(1, np.int64))


@inlined_kernel
def set_due(clocks: Clocks, agent: int, time: float) -> None:
    """Have an oscillator fire at `time`."""
    block = agent // BLOCK
    if clocks.due[agent] <= clocks.earliest[block]:
        clocks.is_stale[block] = True
    clocks.due[agent] = time
    clocks.earliest[block] = min(clocks.earliest[block], time)


@inlined_kernel
def next_due(clocks: Clocks) -> float:
    """Return when the next oscillator fires."""
    soonest = math.inf
    for block in range(len(clocks.earliest)):
        if clocks.is_stale[block]:
            last = min((block + 1) * BLOCK, len(clocks.due))
            clocks.earliest[block] = least(clocks.due, block * BLOCK, last)
            clocks.is_stale[block] = False
        soonest = min(soonest, clocks.earliest[block])
    return soonest


@inlined_kernel
def find_due(clocks: Clocks, time: float, found: npt.NDArray[np.int64]) -> int:
    """Write the numbers of all who fire at the instant `time` to `found`, (agents + 1,); return how many they are."""
    count = 0
    for block in range(len(clocks.earliest)):
        if clocks.earliest[block] <= time + ONE_INSTANT:
            for agent in range(block * BLOCK, min((block + 1) * BLOCK, len(clocks.due))):
                found[count] = agent  # overwritten by the next one if it is not due: no branch
                count += clocks.due[agent] <= time + ONE_INSTANT
    return count


@inlined_kernel
def phase_at(clocks: Clocks, agent: int, time: float) -> float:
    """Return an oscillator's phase at `time`, no later than it fires."""
    phase: float = 1 - (clocks.due[agent] - time) / clocks.period[agent]
    return phase


@inlined_kernel
def begin_next_cycle(clocks: Clocks) -> None:
    """Count times from a cycle later."""
    for agent in range(len(clocks.due)):
        clocks.due[agent] -= 1.0
    for block in range(len(clocks.earliest)):
        clocks.earliest[block] -= 1.0
    clocks.now[0] -= 1.0
    clocks.cycle[0] += 1
