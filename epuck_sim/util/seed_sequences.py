"""Seed sequences in compiled code: equal to the bit to numpy's `SeedSequence`, but states in arrays, and no allocation.

A sequence mixes the words of its seed, and then those of its spawn key, into a pool of four. A child's pool is its
parent's with one more number mixed in, so that a trial's seed is mixed once, and each part of the trial goes on there.
"""

import numpy as np

from epuck_sim.arrays import WordArray
from epuck_sim.util.jit import jit_inline, jit_no_alloc

SEQUENCE_WORDS = 5
"""Number of words of a seed sequence: the pool, and the factor with which the next number will be mixed in."""

_POOL = 4
_HALF, _LOWER = np.uint64(32), np.uint64(0xFFFFFFFF)
_SHIFT = np.uint64(16)
_MIX_BEGIN, _MIX_FACTOR = np.uint64(0x43B0D7E5), np.uint64(0x931E8875)
_DRAW_FACTOR = np.uint64(0x58F38DED)

DRAW_BEGIN = np.uint64(0x8B51F9DD)
"""Factor with which the first word of a sequence is drawn; see `draw_row`."""

_LEFT, _RIGHT = np.uint64(0xCA01F9DD), np.uint64(0x4973F715)


def seed_words(*seeds: int) -> WordArray:
    """Return (n,) the words of 32 bits of whole numbers, however large, as numpy splits the numbers of an entropy.

    >>> seed_words(7, 2**32 + 5).tolist()
    [7, 5, 1]
    """
    words: list[int] = []
    for seed in seeds:
        length = max(1, -(-seed.bit_length() // 32))
        words.extend(seed >> 32 * word & 0xFFFFFFFF for word in range(length))
    return np.array(words, np.uint64)


@jit_inline
def _hashed(value: np.uint64, sequence: WordArray) -> np.uint64:
    """Hash a word with the sequence's factor, which advances."""
    value ^= sequence[_POOL]
    sequence[_POOL] = sequence[_POOL] * _MIX_FACTOR & _LOWER
    value = value * sequence[_POOL] & _LOWER
    return value ^ value >> _SHIFT


@jit_no_alloc
def _mix_in(word: np.uint64, sequence: WordArray, but: int = _POOL) -> None:
    """Mix a word of 32 bits into the whole pool, `but` for a place."""
    for place in range(_POOL):
        if place != but:
            mixed = _LEFT * sequence[place] - _RIGHT * _hashed(word, sequence) & _LOWER
            sequence[place] = mixed ^ mixed >> _SHIFT


@jit_no_alloc
def begin_sequence(sequence: WordArray, words: WordArray) -> None:
    """Set a sequence to numpy's `SeedSequence(seed)`.

    Args:
        sequence: (`SEQUENCE_WORDS`,) what to set.
        words: (n,) the `seed_words` of the seed; those of a list of numbers for a list. Zeros may follow, up to 4.
    """
    sequence[_POOL] = _MIX_BEGIN
    for place in range(_POOL):
        sequence[place] = _hashed(words[place] if place < len(words) else np.uint64(0), sequence)
    for source in range(_POOL):
        _mix_in(sequence[source], sequence, source)
    for source in range(_POOL, len(words)):
        _mix_in(words[source], sequence)


@jit_no_alloc
def spawn(child: WordArray, parent: WordArray, key: int) -> None:
    """Set a sequence to the one whose spawn key is its parent's and one more number.

    Args:
        child: (`SEQUENCE_WORDS`,) what to set; may be the parent.
        parent: (`SEQUENCE_WORDS`,) which stays as it is: it does not count its children, as numpy's do.
        key: The number of the child, 0 or more.
    """
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
    """Write words that begin with the pool's first, and return the factor after them."""
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
    """Write the words of numpy's `generate_state(n, np.uint64)`.

    Args:
        words: (n,) what to write.
        sequence: (`SEQUENCE_WORDS`,) which stays as it is.
    """
    draw_row(words, sequence, DRAW_BEGIN)
