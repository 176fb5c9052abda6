"""Counts of lit rings, as a camera that misses none would have them."""

import numpy as np


def uneven(times: np.ndarray, random: np.random.Generator, dropped: float = 0.03) -> np.ndarray:
    """Return times that are up to a third of a frame late, without some of the frames."""
    late = times + np.median(np.diff(times)) * random.uniform(0, 1 / 3, len(times))
    return late[random.random(len(times)) >= dropped]


def counted(onsets: np.ndarray, flash_s: float, times: np.ndarray) -> np.ndarray:
    """Return (n,) how many rings are lit at (n,) times, of those that go on at the onsets, of any shape."""
    onsets = np.sort(np.ravel(onsets))
    begun, ended = (np.searchsorted(each, times + 1e-9, side="right") for each in (onsets, onsets + flash_s))
    return begun - ended


def steady(phases_s: np.ndarray, period_s: float, seconds: float) -> np.ndarray:
    """Return when robots fire that do so at (n,) phases of every period."""
    return np.asarray(phases_s) + period_s * np.arange(-1, seconds / period_s + 1)[:, None]
