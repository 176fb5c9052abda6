"""The least of some numbers, and where it stands; without branches, for which number is less cannot be foretold."""

import math

from epuck_sim.arrays import FloatArray
from epuck_sim.util.jit import jit_inline


@jit_inline
def least(values: FloatArray, first: int, last: int) -> float:
    """Return the least of `values[first:last]`, inf if there are none.

    Four are compared at a time, because each comparison has to wait for the one before.
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
def place_of_least(values: FloatArray, last: int) -> int:
    """Return where the least of `values[:last]`, of which there is one, stands first."""
    lowest = least(values, 0, last)
    found = 0
    for place in range(last - 1, -1, -1):
        found = place if values[place] == lowest else found
    return found
