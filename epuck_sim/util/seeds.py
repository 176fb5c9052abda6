"""Seeds of trials, and the initial states of robots' streams of random numbers.

A trial's seed alone decides what happens in it. A robot's stream depends on the robot's number alone, so that neither
the order in which robots are served nor what other robots draw can change its numbers.
"""

import hashlib
from functools import lru_cache

import numpy as np

from epuck_sim.arrays import StreamArray, WordArray

SEED_BITS = 53  # number of bits of a derived seed: every JSON reader and spreadsheet keeps such integers unchanged


def trial_seed(master: int, trial: int) -> int:
    """Return the seed of trial number `trial` in a run whose master seed is `master`.

    Trial 0 has the master seed itself: a seed printed in a result row and given as `--seed` makes the same trial again.

    >>> trial_seed(7, 0)
    7
    >>> trial_seed(7, 1) == trial_seed(7, 1) != trial_seed(8, 1)
    True
    """
    return master if trial == 0 else _derived(master, (trial,))


@lru_cache(maxsize=4096)  # of each trial of a chunk it is asked several times
def point_seed(master: int, point: str, trial: int) -> int:
    """Return the seed of a trial at a point of a sweep, whose key is its axis values as text."""
    digest = hashlib.sha256(point.encode()).digest()
    return _derived(master, (int.from_bytes(digest[:4]), int.from_bytes(digest[4:8]), trial))


def _derived(master: int, spawn_key: tuple[int, ...]) -> int:
    """Return the seed from numpy's `SeedSequence` of a master seed and a spawn key, numbers below 2**32."""
    words = np.array([*_padded_words(master), *spawn_key], np.uint32)  # ready for numpy, in half of the time
    return int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0]) >> (64 - SEED_BITS)


def seed_words(*seeds: int) -> WordArray:
    """Return (n,) the words of 32 bits of whole numbers, however large, as numpy splits the numbers of an entropy.

    >>> seed_words(7, 2**32 + 5).tolist()
    [7, 5, 1]
    """
    counts = [(seed, max(1, -(-seed.bit_length() // 32))) for seed in seeds]
    return np.array([seed >> 32 * word & 0xFFFFFFFF for seed, count in counts for word in range(count)], np.uint64)


@lru_cache
def _padded_words(master: int) -> tuple[int, ...]:
    """Return the `seed_words` of a master seed, with zeros up to the four that numpy has before a spawn key."""
    words: list[int] = seed_words(master).tolist()
    return (*words, *[0] * (4 - len(words)))


def robot_streams(sequence: np.random.SeedSequence, robots: int) -> StreamArray:
    """Return (robots, 4) the initial state of one stream for each robot.

    A larger number of robots leaves the streams of the first ones unchanged.
    """
    return sequence.generate_state(4 * robots, np.uint64).astype(np.uint64).reshape(robots, 4)
