"""Choices of numbers in compiled code, equal to those of numpy's `Generator`."""

import numpy as np

from epuck_sim.arrays import IntArray, WordArray
from epuck_sim.util.generators import integer_up_to
from epuck_sim.util.jit import jit_inline, jit_no_alloc

TAIL_LIMIT, TAIL_SHARE = 10_000, 50
"""numpy chooses from more than `TAIL_LIMIT` numbers by a shuffle, if it chooses more than one of `TAIL_SHARE`."""


@jit_no_alloc
def choose(chosen: IntArray, among: IntArray, generator: WordArray) -> None:
    """Write different random numbers from 0 to n - 1, as `Generator.choice(n, k, replace=False)` does.

    Args:
        chosen: (k,) what to write; k is at most n.
        among: (n,) room for the numbers, whose contents are lost.
        generator: What to draw from.
    """
    count, numbers = len(chosen), len(among)
    if numbers > TAIL_LIMIT and count > numbers // TAIL_SHARE:
        for number in range(numbers):
            among[number] = number
        _settle_from(max(numbers - count, 1), among, generator)
        for place in range(count):
            chosen[place] = among[numbers - count + place]
        return
    among[:] = 0  # now whether a number is chosen (Floyd; Bentley 1987)
    for place in range(count):
        last = numbers - count + place
        chosen[place] = np.int64(integer_up_to(np.uint64(last), generator))
        if among[chosen[place]]:
            chosen[place] = last
        among[chosen[place]] = 1
    _settle_from(1, chosen, generator)


@jit_inline
def _settle_from(first: int, numbers: IntArray, generator: WordArray) -> None:
    """Shuffle numbers, (n,), so far that those from `first` on have their final places."""
    for last in range(len(numbers) - 1, first - 1, -1):
        other = np.int64(integer_up_to(np.uint64(last), generator))
        numbers[last], numbers[other] = numbers[other], numbers[last]
