"""Normal random numbers in compiled code, equal to numpy's to the bit: by a ziggurat of 256 layers.

The method is that of Marsaglia and Tsang (2000). numpy keeps its tables in its machine code; here they are computed,
in decimals, so that they are the same on every computer.
"""

import math
from decimal import Decimal, localcontext

import numpy as np

from epuck_sim.arrays import FloatArray, WordArray
from epuck_sim.util.generators import next_double, next_uint64
from epuck_sim.util.jit import jit_inline, jit_no_alloc

LAYERS = 256
NORMAL_EDGE = 3.6541528853610087963519472518
"""Where the tail of the normal distribution begins, in standard deviations."""
NORMAL_AREA = 0.0049286732339746519
"""Area of each layer below exp(-x**2 / 2)."""

_DIGITS = 40
_HIGHER_LAYER = 38
"""Layer whose edge numpy has one unit in the last place too high, by the exponential of the program that made it."""


def normal_tables() -> tuple[WordArray, FloatArray, FloatArray]:
    """Return numpy's tables of the normal distribution, rounded to a float at each step as they were when made.

    For each layer: the integer below which a draw is surely inside, the width of an integer, the height of the edge.
    """
    with localcontext(prec=_DIGITS):
        edges, heights = np.empty(LAYERS), np.ones(LAYERS)
        edges[-1] = NORMAL_EDGE
        for layer in range(LAYERS - 1, 0, -1):
            edge = float(edges[layer])
            heights[layer] = height = float(Decimal(-0.5 * edge * edge).exp())
            if layer == _HIGHER_LAYER:
                heights[layer] = height = math.nextafter(height, 1.0)
            edges[layer - 1] = math.sqrt(-2 * float(Decimal(min(height + NORMAL_AREA / edge, 1.0)).ln()))
    inside = np.concatenate([[NORMAL_EDGE * heights[-1] / NORMAL_AREA, 0.0], edges[1:-1] / edges[2:]])
    edges[0] = NORMAL_AREA / heights[-1]
    return np.rint(inside * 2.0**52).astype(np.uint64), edges / 2.0**52, heights


_INSIDE, _WIDTH, _HEIGHT = normal_tables()
_INVERSE_EDGE = 0.27366123732975827203338247596
_1, _8, _BYTE, _52_BITS = np.uint64(1), np.uint64(8), np.uint64(0xFF), np.uint64(0xFFFFFFFFFFFFF)


@jit_no_alloc
def _normal_of(word: np.uint64, generator: WordArray) -> float:
    """Return a standard normal number that begins with a word outside the middle of its layer."""
    while True:
        layer = np.int64(word & _BYTE)
        steps = word >> np.uint64(9) & _52_BITS
        number: float = steps * _WIDTH[layer]
        number = -number if word >> _8 & _1 else number
        if steps < _INSIDE[layer]:
            return number
        if layer == 0:
            while True:
                beyond = -_INVERSE_EDGE * math.log1p(-next_double(generator))
                height = -math.log1p(-next_double(generator))
                if height + height > beyond * beyond:
                    return -(NORMAL_EDGE + beyond) if steps >> _8 & _1 else NORMAL_EDGE + beyond
        height = (_HEIGHT[layer - 1] - _HEIGHT[layer]) * next_double(generator) + _HEIGHT[layer]
        if height < math.exp(-0.5 * number * number):
            return number
        word = next_uint64(generator)


@jit_inline
def standard_normal(generator: WordArray) -> float:
    """Return a normal number of mean 0 and deviation 1, as `Generator.standard_normal` does.

    Args:
        generator: See `util.generators`.
    """
    word = next_uint64(generator)
    layer = np.int64(word & _BYTE)
    steps = word >> np.uint64(9) & _52_BITS
    if steps >= _INSIDE[layer]:
        return _normal_of(word, generator)
    number: float = steps * _WIDTH[layer]
    return -number if word >> _8 & _1 else number
