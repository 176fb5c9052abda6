"""Random numbers in compiled code: each robot draws from a stream of its own (see `epuck_sim.util.seeds`)."""

import numpy as np

from epuck_sim.arrays import StreamArray
from epuck_sim.util.jit import jit_inline


@jit_inline
def next_word(random: StreamArray) -> np.uint64:
    """Return 64 random bits and advance the stream (xoshiro256++, Blackman and Vigna 2019).

    Args:
        random: (4,) the state of the stream.
    """
    total = random[0] + random[3]
    word: np.uint64 = ((total << np.uint64(23)) | (total >> np.uint64(41))) + random[0]
    shifted = random[1] << np.uint64(17)
    random[2] ^= random[0]
    random[3] ^= random[1]
    random[1] ^= random[2]
    random[0] ^= random[3]
    random[2] ^= shifted
    random[3] = (random[3] << np.uint64(45)) | (random[3] >> np.uint64(19))
    return word


@jit_inline
def share_of(word: np.uint64) -> float:
    """Return the number from [0, 1) that the upper 53 of 64 bits stand for."""
    return (word >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@jit_inline
def uniform(random: StreamArray) -> float:
    """Return a random number from [0, 1) and advance the stream."""
    return share_of(next_word(random))


@jit_inline
def randint(random: StreamArray, limit: int) -> int:
    """Return a random integer from 0 to `limit` - 1 and advance the stream.

    Args:
        random: (4,) the state of the stream.
        limit: At most 2**31.
    """
    return int(uniform(random) * limit)
