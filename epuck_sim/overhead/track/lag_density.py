"""The commonest lags from some events to others: peaks of the density of all lags, to a fraction of a frame."""

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray

Events = tuple[FloatArray, FloatArray]
"""Times, (n,) s, ascending, and sizes, (n,): how many rings go on or off."""

NEARLY_AS_COMMON = 0.8
"""Density of a lag, relative to the highest, from which it counts as equally common."""

MEAN_SHIFTS = 10
"""Mean-shift iterations by which a peak of the density is located."""


def common_lags_s(causes: Events, effects: Events, range_s: tuple[float, float], frame_s: float) -> FloatArray:
    """Return the commonest lags from some events to others, ascending, to a fraction of a frame.

    Args:
        causes: Events from which lags are measured.
        effects: Events to which lags are measured.
        range_s: Shortest lag that counts, and the shortest beyond it that does not.
        frame_s: Time from one frame to the next.
    """
    lags_s, weights = lags(causes, effects, range_s)
    peaks_s = _peaks_s(lags_s, weights, frame_s) if len(lags_s) else ()
    return np.array([mean_shift(lags_s, weights, peak_s, frame_s)[0] for peak_s in peaks_s])


def lags(causes: Events, effects: Events, range_s: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return (pairs,) the lags within a range from any of `causes` to any of `effects`, and products of their sizes."""
    first, end = (np.searchsorted(effects[0], causes[0] + edge_s) for edge_s in range_s)
    cause = np.repeat(np.arange(len(first)), end - first)
    effect = np.arange(len(cause)) + np.repeat(end - np.cumsum(end - first), end - first)
    return effects[0][effect] - causes[0][cause], causes[1][cause] * effects[1][effect]


def _peaks_s(lags_s: FloatArray, weights: FloatArray, frame_s: float) -> FloatArray:
    """Return where the density of (pairs,) lags is highest or nearly so, ascending, to a quarter of a frame."""
    bin_s = frame_s / 4
    edges_s = np.arange(lags_s.min() - 13.5 * bin_s, lags_s.max() + 14 * bin_s, bin_s)
    histogram, _ = np.histogram(lags_s, edges_s, weights=weights)
    density = np.convolve(histogram, gaussian(np.arange(-12, 13) / 4), "same")
    peaks = local_maxima(density)
    common = peaks[density[peaks] >= NEARLY_AS_COMMON * density.max()]
    middles_s: FloatArray = edges_s[common] + bin_s / 2
    return middles_s


def local_maxima(values: FloatArray) -> IntArray:
    """Return (peaks,) the indices of (n,) values that are as large as the one before and larger than the one after.

    scipy.signal.find_peaks would give the same but for the place within a plateau; loading it takes a second.
    """
    return 1 + np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:]))


def mean_shift(lags_s: FloatArray, weights: FloatArray, start_s: float, frame_s: float) -> tuple[float, float]:
    """Climb to a peak of the density of lags.

    Args:
        lags_s: (pairs,) lags.
        weights: (pairs,) their weights.
        start_s: Lag from which to climb, within a few frames of some lag.
        frame_s: Time from one frame to the next.

    Returns:
        The peak and the density there; `start_s` and 0 if no lag is near.
    """
    peak_s = start_s
    for _ in range(MEAN_SHIFTS):
        near = weights * gaussian((lags_s - peak_s) / frame_s)
        if not near.any():
            return peak_s, 0.0
        peak_s = float(np.average(lags_s, weights=near))
    return peak_s, float(near.sum())


def gaussian(frames: FloatArray) -> FloatArray:
    """Return (n,) the kernel of the density at (n,) distances in frames.

    Its width is a frame, because one lag may appear as two that differ by a frame and must merge.
    """
    density: FloatArray = np.exp(-(frames**2) / 2)
    return density
