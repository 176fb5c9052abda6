"""Estimates the period of oscillators and the duration of their flashes from counts of lit rings (thesis Appendix C).

`times_s` are (n,) times of frames, `counts` (n,) the lit rings in them. Lags between events are located as peaks of
their density, to a fraction of a frame.
"""

import math

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.synchrony import frame_ends

Events = tuple[FloatArray, FloatArray]
"""Times, (n,) s, ascending, and sizes, (n,): how many rings go on or off."""

MIN_PERIODS = 2.5  # minimum number of periods in a film; with fewer, any chance repetition would pass for the period

MIN_CORRELATION = 0.3
"""Minimum autocorrelation at the period in a film of many periods. Robots that flash at random stay below it in films
of a minute or more; simulated trials that end with a synchronised cycle or two are above it."""

AS_HIGH = 0.92
"""Height of a peak of the autocorrelation, relative to the highest, from which it counts as equally high. The shortest
lag of equally high peaks is the period; the others are its multiples."""

PERIOD_RANGE = (0.9, 1.2)
"""Bounds of the period, as multiples of the autocorrelation's lag. That lag is too short rather than too long, because
a flash that is seen can only shorten a cycle (thesis eq. 4.1)."""

AS_COMMON = 0.7  # relative frequency at which a lag over several cycles is trusted to refine the period
MAX_CYCLES = 10  # cycles over which the period is refined; over more, clocks differ by more than the gain
NEARLY_AS_COMMON = 0.8  # density of a lag, relative to the highest, from which it counts as equally common
MEAN_SHIFTS = 10  # iterations by which a peak of the density is located


def estimate_period_s(times_s: FloatArray, counts: IntArray) -> float | None:
    """Return the oscillators' period; None if the film is too short (`MIN_PERIODS`) or does not clearly repeat.

    The highest peak of the counts' autocorrelation gives a first estimate; cycles in which many rings flash together
    weigh most. The period is then the commonest time between rings going on. Before synchrony many cycles are
    shortened, each by a different time; so the longest of nearly equally common times is taken. Clusters of nearly
    equal size that are spaced evenly over the period, all film long, look like one cluster of a shorter period.
    """
    times_s, counts = _increasing(times_s, counts)
    if len(times_s) < 4:
        return None
    frame_s = float(np.median(np.diff(times_s)))
    near_s = _correlated_lag_s(times_s, counts, frame_s)
    if near_s is None:
        return None
    onsets = _changes(times_s, counts, 1)
    lags_s = _common_lags_s(onsets, onsets, (PERIOD_RANGE[0] * near_s, PERIOD_RANGE[1] * near_s), frame_s)
    return _refine_period_s(onsets, float(lags_s[-1]), frame_s, times_s[-1] - times_s[0]) if len(lags_s) else None


def estimate_flash_s(times_s: FloatArray, counts: IntArray) -> float | None:
    """Return the duration of a flash; None if no ring goes on and off.

    It is the commonest time from rings going on to rings going off. The light of all rings divided by the number of
    times one goes on would be too long where one ring goes on in the frame in which another goes off, and too short
    where a lit ring is missed in a frame and seems to go on twice.
    """
    times_s, counts = _increasing(times_s, counts)
    onsets, ends = _changes(times_s, counts, 1), _changes(times_s, counts, -1)
    if not len(onsets[0]) or not len(ends[0]):
        return None
    frame_s = float(np.median(np.diff(times_s)))
    lit_s = (frame_ends(times_s, times_s[-1]) - times_s) @ counts / onsets[1].sum()
    lags_s = _common_lags_s(onsets, ends, (0.0, 2 * lit_s + frame_s), frame_s)
    return float(lags_s[0]) if len(lags_s) else None


def _increasing(times_s: FloatArray, counts: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the frames whose times are after those of all frames before."""
    is_later = np.append(True, times_s[1:] > np.maximum.accumulate(times_s)[:-1])[: len(times_s)]
    return times_s[is_later], counts[is_later]


def _correlated_lag_s(times_s: FloatArray, counts: IntArray, frame_s: float) -> float | None:
    """Return the lag of the highest autocorrelation, to about a frame; None if no lag stands out."""
    smooth = np.convolve(_on_grid(times_s, counts, frame_s), _gaussian(np.arange(-3.0, 4.0)), "same")
    correlation = _autocorrelation(smooth)
    shown = correlation[: int(len(correlation) / MIN_PERIODS) + 2]
    peaks = _local_maxima(shown)
    peaks = peaks[peaks > np.argmax(shown <= 0)]  # at shorter lags, a flash is compared with itself
    if not len(peaks):
        return None
    before, at, after = (shown[peaks + shift] for shift in (-1, 0, 1))
    # heights of parabolas through three points, because a peak may lie between frames
    heights = at - (after - before) ** 2 / (8 * (before - 2 * at + after))
    lag = peaks[np.argmax(heights >= AS_HIGH * heights.max())]
    share = lag / len(correlation)
    # in a shorter film chance correlations are higher, as the square root of the share
    is_clear = shown[lag] / (1 - share) >= max(MIN_CORRELATION, math.sqrt(share))
    return float(lag * frame_s) if is_clear else None


def _on_grid(times_s: FloatArray, counts: IntArray, frame_s: float) -> FloatArray:
    """Return (m,) mean counts over consecutive intervals of the length of a frame."""
    ends_s = frame_ends(times_s, times_s[-1] + frame_s)
    corners_s = np.column_stack([times_s, ends_s]).ravel()
    lit_s = np.append(0.0, np.repeat(np.cumsum((ends_s - times_s) * counts), 2)[:-1])
    edges_s = np.arange(times_s[0], times_s[-1] + 1.5 * frame_s, frame_s)
    means: FloatArray = np.diff(np.interp(edges_s, corners_s, lit_s)) / frame_s
    return means


def _autocorrelation(values: FloatArray) -> FloatArray:
    """Return the (m,) autocorrelation of (m,) values at lags 0 to m - 1: 1 at lag 0, or all 0 for constant values.

    scipy.signal.correlate would replace one line; loading it takes a second.
    """
    values = values - values.mean()
    padded = 1 << (2 * len(values)).bit_length()
    products: FloatArray = np.fft.irfft(np.abs(np.fft.rfft(values, padded)) ** 2, padded)[: len(values)]
    return products / products[0] if products[0] > 1e-9 else np.zeros(len(values))


def _changes(times_s: FloatArray, counts: IntArray, sign: int) -> Events:
    """Return when counts rise (sign 1) or fall (-1), midway between two frames, and by how much."""
    sizes = sign * np.diff(counts)
    changes = np.flatnonzero(sizes > 0)
    return (times_s[changes] + times_s[changes + 1]) / 2, sizes[changes].astype(float)


def _refine_period_s(onsets: Events, period_s: float, frame_s: float, film_s: float) -> float:
    """Return the period refined by lags over several cycles, as long as these are about as common as single ones.

    A lag over several cycles is as exact as one over a single cycle, but is divided by their number.
    """
    single = 0.0
    for cycles in range(1, MAX_CYCLES + 1):
        expected_s = cycles * period_s
        pairs = _lags(onsets, onsets, (expected_s - 4 * frame_s, expected_s + 4 * frame_s))
        lag_s, weight = mean_shift(*pairs, expected_s, frame_s)
        share = weight / max(film_s - lag_s, frame_s)
        single = single or share
        if share < AS_COMMON * single:
            break
        period_s = lag_s / cycles
    return period_s


def _common_lags_s(causes: Events, effects: Events, range_s: tuple[float, float], frame_s: float) -> FloatArray:
    """Return the commonest lags, ascending, from some events to others; they are within a range, but for its end."""
    lags_s, weights = _lags(causes, effects, range_s)
    peaks_s = _peaks_s(lags_s, weights, frame_s) if len(lags_s) else ()
    return np.array([mean_shift(lags_s, weights, peak_s, frame_s)[0] for peak_s in peaks_s])


def _lags(causes: Events, effects: Events, range_s: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
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
    density = np.convolve(histogram, _gaussian(np.arange(-12, 13) / 4), "same")
    peaks = _local_maxima(density)
    common = peaks[density[peaks] >= NEARLY_AS_COMMON * density.max()]
    middles_s: FloatArray = edges_s[common] + bin_s / 2
    return middles_s


def _local_maxima(values: FloatArray) -> IntArray:
    """Return (peaks,) the indices of (n,) values that are as large as the one before and larger than the one after.

    scipy.signal.find_peaks would give the same but for the place within a plateau; loading it takes a second.
    """
    return 1 + np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:]))


def mean_shift(lags_s: FloatArray, weights: FloatArray, start_s: float, frame_s: float) -> tuple[float, float]:
    """Climb to a peak of the density of (pairs,) lags with weights, from a start within a few frames of some lag.

    Returns:
        The peak and the density there; `start_s` and 0 if no lag is near.
    """
    peak_s = start_s
    for _ in range(MEAN_SHIFTS):
        near = weights * _gaussian((lags_s - peak_s) / frame_s)
        if not near.any():
            return peak_s, 0.0
        peak_s = float(np.average(lags_s, weights=near))
    return peak_s, float(near.sum())


def _gaussian(frames: FloatArray) -> FloatArray:
    """Return the kernel of the density, as wide as a frame: one lag may appear as two that differ by one."""
    density: FloatArray = np.exp(-(frames**2) / 2)
    return density
