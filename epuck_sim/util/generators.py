"""Random numbers in compiled code that are equal to numpy's to the bit, draw after draw; nothing allocates.

Seed sequences are numpy's `SeedSequence`, with states in arrays: a sequence mixes the words of its seed, and then those
of its spawn key, into a pool of four. A child's pool is its parent's with one more number mixed in, so that a trial's
seed is mixed once, and each part of the trial continues from there.

Generators are numpy's SFC64 and PCG64, each a row of words, and what its `Generator` draws from them. Normal numbers
come by a ziggurat of 256 layers (Marsaglia and Tsang 2000). numpy keeps its tables in its machine code; here they are
computed, in decimals, so that they are the same on every computer. So are exponentials and logarithms: in the
tail, a few of a million normal numbers may differ from numpy's in the last digit.
"""

import math
from decimal import Decimal, localcontext

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray, WordArray
from epuck_sim.util.elementary import exp, log1p
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.rng import share_of

SEQUENCE_WORDS = 5
"""Number of words of a seed sequence: the pool, and the factor with which the next number will be mixed in."""

_POOL = 4
_HALF, _LOWER = np.uint64(32), np.uint64(0xFFFFFFFF)
_SHIFT = np.uint64(16)
_MIX_BEGIN, _MIX_FACTOR = np.uint64(0x43B0D7E5), np.uint64(0x931E8875)
_DRAW_FACTOR = np.uint64(0x58F38DED)

DRAW_BEGIN = np.uint64(0x8B51F9DD)  # factor with which the first word of a sequence is drawn; see `draw_row`

_LEFT, _RIGHT = np.uint64(0xCA01F9DD), np.uint64(0x4973F715)

GENERATOR_WORDS = 7
"""Number of words of a generator: four of its algorithm, the upper half of a word whose lower half has been drawn,
whether there is one, and whether the algorithm is PCG64."""

_UPPER, _HAS_UPPER, _IS_PCG = 4, 5, 6
_0, _1 = np.uint64(0), np.uint64(1)
_LARGEST = np.uint64(0xFFFFFFFFFFFFFFFF)
_PCG_HIGH, _PCG_LOW = np.uint64(2549297995355413924), np.uint64(4865540595714422341)

TAIL_LIMIT, TAIL_SHARE = 10_000, 50
"""numpy chooses from more than `TAIL_LIMIT` numbers by a shuffle, if it chooses more than one of `TAIL_SHARE`."""

LAYERS = 256
NORMAL_EDGE = 3.6541528853610087963519472518  # where the tail of the normal distribution begins, in standard deviations
NORMAL_AREA = 0.0049286732339746519  # area of each layer below exp(-x**2 / 2)

_DIGITS = 40
_HIGHER_LAYER = 38
"""Layer whose height numpy has one unit in the last place too high, by the exponential of the program that made it."""


@jit_inline
def _hashed(value: np.uint64, sequence: WordArray) -> np.uint64:
    """Hash a word with the sequence's factor, which advances."""
    value ^= sequence[_POOL]
    sequence[_POOL] = sequence[_POOL] * _MIX_FACTOR & _LOWER
    value = value * sequence[_POOL] & _LOWER
    return value ^ value >> _SHIFT


@jit_no_alloc
def _mix_in(word: np.uint64, sequence: WordArray, but: int = _POOL) -> None:
    """Mix a word of 32 bits into the pool, except at the place `but`."""
    for place in range(_POOL):
        if place != but:
            mixed = _LEFT * sequence[place] - _RIGHT * _hashed(word, sequence) & _LOWER
            sequence[place] = mixed ^ mixed >> _SHIFT


@jit_no_alloc
def begin_sequence(sequence: WordArray, words: WordArray) -> None:
    """Set a sequence to numpy's `SeedSequence` of the `seeds.seed_words` of a seed or a list; up to 4, 0 may follow."""
    sequence[_POOL] = _MIX_BEGIN
    for place in range(_POOL):
        sequence[place] = _hashed(words[place] if place < len(words) else np.uint64(0), sequence)
    for source in range(_POOL):
        _mix_in(sequence[source], sequence, source)
    for source in range(_POOL, len(words)):
        _mix_in(words[source], sequence)


@jit_no_alloc
def spawn(child: WordArray, parent: WordArray, key: int) -> None:
    """Set `child`, which may be the parent itself, to the parent's child of number `key`, 0 or more."""
    for place in range(SEQUENCE_WORDS):
        child[place] = parent[place]
    word = np.uint64(key)
    _mix_in(word & _LOWER, child)
    if word > _LOWER:
        _mix_in(word >> _HALF, child)


@jit_inline
def _drawn(word: np.uint64, factor: np.uint64) -> np.uint64:
    value: np.uint64 = (word ^ factor) * (factor * _DRAW_FACTOR & _LOWER) & _LOWER
    return value ^ value >> _SHIFT


@jit_no_alloc
def draw_row(row: WordArray, sequence: WordArray, factor: np.uint64) -> np.uint64:
    """Write words drawn from the pool, beginning with its first word; return the factor after them."""
    for word in range(len(row)):
        place = 2 * word % _POOL
        lower = _drawn(sequence[place], factor)
        factor = factor * _DRAW_FACTOR & _LOWER
        upper = _drawn(sequence[place + 1], factor)
        factor = factor * _DRAW_FACTOR & _LOWER
        row[word] = lower | upper << _HALF
    return factor


@jit_inline
def draw_words(words: WordArray, sequence: WordArray) -> None:
    """Write (n,) the words of numpy's `generate_state(n, np.uint64)`."""
    draw_row(words, sequence, DRAW_BEGIN)


@jit_inline
def _high_product(left: np.uint64, right: np.uint64) -> np.uint64:
    left_low, left_high = left & _LOWER, left >> _HALF
    right_low, right_high = right & _LOWER, right >> _HALF
    middle = left_high * right_low + (left_low * right_low >> _HALF)
    return left_high * right_high + (middle >> _HALF) + ((middle & _LOWER) + left_low * right_high >> _HALF)


@jit_inline
def _next_of_sfc64(generator: WordArray) -> np.uint64:
    """Return 64 random bits (sfc64, Doty-Humphrey 2010)."""
    word: np.uint64 = generator[0] + generator[1] + generator[3]
    generator[3] += _1
    generator[0] = generator[1] ^ generator[1] >> np.uint64(11)
    generator[1] = generator[2] + (generator[2] << np.uint64(3))
    generator[2] = (generator[2] << np.uint64(24) | generator[2] >> np.uint64(40)) + word
    return word


@jit_inline
def _next_of_pcg64(generator: WordArray) -> np.uint64:
    """Return 64 random bits (PCG XSL RR 128/64, O'Neill 2014): words 0 and 1 are the state, 2 and 3 its increment."""
    high, low = generator[0], generator[1]
    high = _high_product(low, _PCG_LOW) + high * _PCG_LOW + low * _PCG_HIGH + generator[2]
    low = low * _PCG_LOW + generator[3]
    if low < generator[3]:
        high += _1
    generator[0], generator[1] = high, low
    word, turns = high ^ low, high >> np.uint64(58)
    turned: np.uint64 = word >> turns | word << (np.uint64(64) - turns & np.uint64(63))
    return turned


@jit_inline
def next_uint64(generator: WordArray) -> np.uint64:
    """Return 64 random bits, of a generator of `GENERATOR_WORDS` words."""
    word: np.uint64 = _next_of_sfc64(generator) if generator[_IS_PCG] == _0 else _next_of_pcg64(generator)
    return word


@jit_inline
def next_uint32(generator: WordArray) -> np.uint64:
    """Return 32 random bits: the lower half of a word, and its upper half at the next call."""
    if generator[_HAS_UPPER] != _0:
        generator[_HAS_UPPER] = _0
        upper: np.uint64 = generator[_UPPER]
        return upper
    word = next_uint64(generator)
    generator[_HAS_UPPER], generator[_UPPER] = _1, word >> _HALF
    return word & _LOWER


@jit_inline
def next_double(generator: WordArray) -> float:
    """Return a random number from [0, 1)."""
    return share_of(next_uint64(generator))


@jit_no_alloc
def seed_sfc64(generator: WordArray, sequence: WordArray) -> None:
    """Set (`GENERATOR_WORDS`,) to numpy's `SFC64(sequence)`."""
    draw_words(generator[:3], sequence)
    generator[3] = _1
    generator[4:] = _0
    for _ in range(12):
        _next_of_sfc64(generator)


@jit_no_alloc
def seed_pcg64(generator: WordArray, sequence: WordArray) -> None:
    """Set (`GENERATOR_WORDS`,) to numpy's `PCG64(sequence)`, which is that of `default_rng(sequence)`."""
    draw_words(generator[:4], sequence)
    generator[4:] = _0
    generator[_IS_PCG] = _1
    begin_high, begin_low = generator[0], generator[1]
    generator[2] = generator[2] << _1 | generator[3] >> np.uint64(63)
    generator[3] = generator[3] << _1 | _1
    low = generator[3] + begin_low
    generator[0] = generator[2] + begin_high + (_1 if low < begin_low else _0)
    generator[1] = low
    _next_of_pcg64(generator)


@jit_inline
def fill_doubles(numbers: FloatArray, generator: WordArray) -> None:
    """Write random numbers from [0, 1), (n,), as `Generator.random` does."""
    for number in range(len(numbers)):
        numbers[number] = next_double(generator)


@jit_no_alloc
def integer_up_to(last: np.uint64, generator: WordArray) -> np.uint64:
    """Return a random integer from 0 to `last`, below 2**64 - 1 (Lemire 2019), from 32 bits where they are enough."""
    if last == _0:
        return _0
    if last == _LOWER:
        return next_uint32(generator)
    limit = last + _1
    if last < _LOWER:
        product = next_uint32(generator) * limit
        if product & _LOWER < limit:
            least = (_LOWER - last) % limit
            while product & _LOWER < least:
                product = next_uint32(generator) * limit
        return product >> _HALF
    word = next_uint64(generator)
    if word * limit < limit:
        least = (_LARGEST - last) % limit
        while word * limit < least:
            word = next_uint64(generator)
    return _high_product(word, limit)


@jit_inline
def integer_between(low: int, high: int, generator: WordArray) -> int:
    """Return a random integer from `low` to `high` - 1, as `Generator.integers` does with its own type of integers."""
    return low + int(np.int64(integer_up_to(np.uint64(high) - np.uint64(low) - _1, generator)))


@jit_no_alloc
def choose(chosen: IntArray, among: IntArray, generator: WordArray) -> None:
    """Write (k,) different numbers below n, as `Generator.choice(n, k, replace=False)` does; among: (n,) scratch."""
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


def normal_tables() -> tuple[WordArray, FloatArray, FloatArray]:
    """Return numpy's tables by layer, rounded as when made: integers surely inside, their width, the edge's height."""
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
_8, _BYTE, _52_BITS = np.uint64(8), np.uint64(0xFF), np.uint64(0xFFFFFFFFFFFFF)


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
                beyond = -_INVERSE_EDGE * log1p(-next_double(generator))
                height = -log1p(-next_double(generator))
                if height + height > beyond * beyond:
                    return -(NORMAL_EDGE + beyond) if steps >> _8 & _1 else NORMAL_EDGE + beyond
        height = (_HEIGHT[layer - 1] - _HEIGHT[layer]) * next_double(generator) + _HEIGHT[layer]
        if height < exp(-0.5 * number * number):
            return number
        word = next_uint64(generator)


@jit_inline
def standard_normal(generator: WordArray) -> float:
    """Return a normal number of mean 0 and deviation 1, as `Generator.standard_normal` does."""
    word = next_uint64(generator)
    layer = np.int64(word & _BYTE)
    steps = word >> np.uint64(9) & _52_BITS
    if steps >= _INSIDE[layer]:
        return _normal_of(word, generator)
    number: float = steps * _WIDTH[layer]
    return -number if word >> _8 & _1 else number


@jit_no_alloc
def fill_normals(numbers: FloatArray, generator: WordArray) -> None:
    """Write normal numbers, (n,), of mean 0 and deviation 1."""
    for number in range(len(numbers)):
        numbers[number] = standard_normal(generator)
