"""Where chance comes from: one seed for each trial, one stream of random numbers for each robot.

A trial's seed alone decides what happens in it; a robot's stream depends on its number alone, so that the order in
which robots are served, and what others draw, cannot change what it draws.
"""

import hashlib

import numpy as np
import numpy.typing as npt

from epuck_sim.util.jit import inlined_kernel

SEED_BITS = 53
"""Derived seeds have this many bits: every JSON reader and spreadsheet gives them back unchanged."""


def trial_seed(master: int, trial: int) -> int:
    """Return the seed of trial number `trial` of a run with the seed `master`.

    Trial 0 has the master seed itself, so that a seed printed in a result row, given as `--seed`, makes the same
    trial again.

    >>> trial_seed(7, 0)
    7
    >>> trial_seed(7, 1) == trial_seed(7, 1) != trial_seed(8, 1)
    True
    """
    return master if trial == 0 else _derived(master, (trial,))


def point_seed(master: int, point: str, trial: int) -> int:
    """Return the seed of trial number `trial` at the point of a sweep that is known as `point`."""
    digest = hashlib.sha256(point.encode()).digest()
    return _derived(master, (int.from_bytes(digest[:4]), int.from_bytes(digest[4:8]), trial))


def _derived(master: int, spawn_key: tuple[int, ...]) -> int:
    word = np.random.SeedSequence(master, spawn_key=spawn_key).generate_state(1, np.uint64)[0]
    return int(word) >> (64 - SEED_BITS)


def robot_streams(sequence: np.random.SeedSequence, robots: int) -> npt.NDArray[np.uint64]:
    """Return (robots, 4) the states of one stream a robot; further robots leave the others' as they were."""
    words: npt.NDArray[np.uint64] = sequence.generate_state(4 * robots, np.uint64).astype(np.uint64)
    return words.reshape(robots, 4)


@inlined_kernel
def next_word(random: npt.NDArray[np.uint64]) -> np.uint64:
    """Return 64 random bits and advance the stream `random`, (4,) (xoshiro256++, Blackman and Vigna 2019)."""
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


@inlined_kernel
def uniform(random: npt.NDArray[np.uint64]) -> float:
    """Return a random number from [0, 1) from a robot's stream."""
    return (next_word(random) >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@inlined_kernel
def below(random: npt.NDArray[np.uint64], limit: int) -> int:
    """Return a random whole number from 0 to `limit` - 1 from a robot's stream; `limit` up to 2**31."""
    return int(uniform(random) * limit)
