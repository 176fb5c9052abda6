"""How long after some events others come: peaks of the density of all lags between them, to a fraction of a frame."""

import numpy as np

from epuck_sim.arrays import FloatArray

Events = tuple[FloatArray, FloatArray]
"""Times, (n,) s, ascending, and sizes, (n,): how many rings go on or off."""

NEARLY_AS_COMMON = 0.8
"""A lag so common, beside the commonest, is its equal."""

ROUNDS = 10
"""So often is a peak looked for where the mean of what is around the last one is."""


def common_lags_s(causes: Events, effects: Events, range_s: tuple[float, float], frame_s: float) -> FloatArray:
    """Return the commonest lags from some events to others within a range, ascending, to a fraction of a frame."""
    lags_s, weights = lags(causes, effects, range_s)
    peaks_s = _peaks_s(lags_s, weights, frame_s) if len(lags_s) else ()
    return np.array([centre(lags_s, weights, peak_s, frame_s)[0] for peak_s in peaks_s])


def lags(causes: Events, effects: Events, range_s: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return (pairs,) lags from some events to others within a range, and (pairs,) products of their sizes."""
    first, end = (np.searchsorted(effects[0], causes[0] + edge_s) for edge_s in range_s)
    cause = np.repeat(np.arange(len(first)), end - first)
    effect = np.arange(len(cause)) + np.repeat(end - np.cumsum(end - first), end - first)
    return effects[0][effect] - causes[0][cause], causes[1][cause] * effects[1][effect]


def _peaks_s(lags_s: FloatArray, weights: FloatArray, frame_s: float) -> FloatArray:
    """Return where the density of (pairs,) lags is highest or nearly so, ascending, to a quarter of a frame."""
    bin_s = frame_s / 4
    edges_s = np.arange(lags_s.min() - 13.5 * bin_s, lags_s.max() + 14 * bin_s, bin_s)
    histogram, _ = np.histogram(lags_s, edges_s, weights=weights)
    density = np.convolve(histogram, bell(np.arange(-12, 13) / 4), "same")
    peaks = 1 + np.flatnonzero((density[1:-1] >= density[:-2]) & (density[1:-1] > density[2:]))
    common = peaks[density[peaks] >= NEARLY_AS_COMMON * density.max()]
    middles_s: FloatArray = edges_s[common] + bin_s / 2
    return middles_s


def centre(lags_s: FloatArray, weights: FloatArray, peak_s: float, frame_s: float) -> tuple[float, float]:
    """Return the peak of the density of (pairs,) lags to which another place leads, and the density there.

    peak_s: that place, within some frames of a lag; where none is near, it is returned, and 0.
    """
    for _ in range(ROUNDS):
        near = weights * bell((lags_s - peak_s) / frame_s)
        if not near.any():
            return peak_s, 0.0
        peak_s = float(np.average(lags_s, weights=near))
    return peak_s, float(near.sum())


def bell(frames: FloatArray) -> FloatArray:
    """Return what something (n,) frames away adds to a density: frames let one lag appear as two, which must merge."""
    density: FloatArray = np.exp(-(frames**2) / 2)
    return density
