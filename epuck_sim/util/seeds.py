"""Seeds of trials, and the streams of random numbers of robots.

A trial's seed alone decides what happens in it; a robot's stream depends on its number alone, so that the order in
which robots are served, and what others draw, cannot change what it draws.
"""

import hashlib

import numpy as np

from epuck_sim.arrays import StreamArray

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


def robot_streams(sequence: np.random.SeedSequence, robots: int) -> StreamArray:
    """Return (robots, 4) the states of one stream a robot; further robots leave the others' as they were."""
    words: StreamArray = sequence.generate_state(4 * robots, np.uint64).astype(np.uint64)
    return words.reshape(robots, 4)
