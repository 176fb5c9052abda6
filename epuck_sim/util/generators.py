"""Generators of random numbers in compiled code: numpy's SFC64 and PCG64, and what its `Generator` draws from them.

All is equal to the bit to numpy, draw after draw. A generator is a row of words; nothing allocates.
See `util.ziggurat` for normal numbers, and `util.selections` for choices.
"""

import numpy as np

from epuck_sim.arrays import FloatArray, WordArray
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.seed_sequences import draw_words

GENERATOR_WORDS = 7
"""Number of words of a generator: four of its algorithm, the upper half of a word whose lower half has been drawn,
whether there is one, and whether the algorithm is PCG64."""

_UPPER, _HAS_UPPER, _IS_PCG = 4, 5, 6
_0, _1 = np.uint64(0), np.uint64(1)
_HALF, _LOWER = np.uint64(32), np.uint64(0xFFFFFFFF)
_LARGEST = np.uint64(0xFFFFFFFFFFFFFFFF)
_PCG_HIGH, _PCG_LOW = np.uint64(2549297995355413924), np.uint64(4865540595714422341)


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
    return (next_uint64(generator) >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@jit_no_alloc
def seed_sfc64(generator: WordArray, sequence: WordArray) -> None:
    """Set a generator to numpy's `SFC64(sequence)`.

    Args:
        generator: (`GENERATOR_WORDS`,) what to set.
        sequence: The seed sequence; see `util.seed_sequences`.
    """
    draw_words(generator[:3], sequence)
    generator[3] = _1
    generator[4:] = _0
    for _ in range(12):
        _next_of_sfc64(generator)


@jit_no_alloc
def seed_pcg64(generator: WordArray, sequence: WordArray) -> None:
    """Set a generator to numpy's `PCG64(sequence)`, which is that of `default_rng(sequence)`.

    Args:
        generator: (`GENERATOR_WORDS`,) what to set.
        sequence: The seed sequence; see `util.seed_sequences`.
    """
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
