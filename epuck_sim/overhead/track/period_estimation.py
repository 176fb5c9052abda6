"""Estimates period and flash duration from the counts of a film, and the threshold of the spread (Appendix C)."""

import math

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.track.lag_density import Events, common_lags_s, gaussian, lags, local_maxima, mean_shift
from epuck_sim.overhead.track.spread import frame_ends

MIN_PERIODS = 2.5
"""Minimum number of periods in a film; with fewer, any chance repetition would pass for the period."""

MIN_CORRELATION = 0.3
"""Minimum autocorrelation at the period in a film of many periods. Robots that flash at random stay below it in films
of a minute or more; simulated trials that end with a synchronised cycle or two are above it."""

AS_HIGH = 0.92
"""Height of a peak of the autocorrelation, relative to the highest, from which it counts as equally high. The shortest
lag of equally high peaks is the period; the others are its multiples."""

AS_COMMON = 0.7
"""Relative frequency at which a lag over several cycles is trusted to refine the period."""

MAX_CYCLES = 10
"""Largest number of cycles over which the period is refined; over more, clocks differ by more than the gain."""

PERIOD_RANGE = (0.9, 1.2)
"""Bounds of the period, as multiples of the autocorrelation's lag. That lag is too short rather than too long, because
a flash that is seen can only shorten a cycle (thesis eq. 4.1)."""

ORDER_PARAMETER = 0.95
"""Order parameter r_sync at which a swarm counts as synchronised (thesis 4.2.1)."""


def estimate_period_s(times_s: FloatArray, counts: IntArray) -> float | None:
    """Return the oscillators' period; None if the film is too short (`MIN_PERIODS`) or does not clearly repeat.

    The highest peak of the counts' autocorrelation gives a first estimate; cycles in which many rings flash together
    weigh most. The period is then the commonest time between rings going on. Before synchrony many cycles are
    shortened, each by a different time; so the longest of nearly equally common times is taken. Clusters of nearly
    equal size that are spaced evenly over the period, all film long, look like one cluster of a shorter period.

    Args:
        times_s: (n,) times of the frames.
        counts: (n,) lit rings in them.
    """
    times_s, counts = _increasing(times_s, counts)
    if len(times_s) < 4:
        return None
    frame_s = float(np.median(np.diff(times_s)))
    near_s = _correlated_lag_s(times_s, counts, frame_s)
    if near_s is None:
        return None
    onsets = _changes(times_s, counts, 1)
    lags_s = common_lags_s(onsets, onsets, (PERIOD_RANGE[0] * near_s, PERIOD_RANGE[1] * near_s), frame_s)
    return _refine_period_s(onsets, float(lags_s[-1]), frame_s, times_s[-1] - times_s[0]) if len(lags_s) else None


def estimate_flash_s(times_s: FloatArray, counts: IntArray) -> float | None:
    """Return the duration of a flash; None if no ring goes on and off.

    It is the commonest time from rings going on to rings going off. The light of all rings divided by the number of
    times one goes on would be too long where one ring goes on in the frame in which another goes off, and too short
    where a lit ring is missed in a frame and seems to go on twice.

    Args:
        times_s: (n,) times of the frames.
        counts: (n,) lit rings in them.
    """
    times_s, counts = _increasing(times_s, counts)
    onsets, ends = _changes(times_s, counts, 1), _changes(times_s, counts, -1)
    if not len(onsets[0]) or not len(ends[0]):
        return None
    frame_s = float(np.median(np.diff(times_s)))
    lit_s = (frame_ends(times_s, times_s[-1]) - times_s) @ counts / onsets[1].sum()
    lags_s = common_lags_s(onsets, ends, (0.0, 2 * lit_s + frame_s), frame_s)
    return float(lags_s[0]) if len(lags_s) else None


def _increasing(times_s: FloatArray, counts: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the frames whose times are after those of all frames before."""
    is_later = np.append(True, times_s[1:] > np.maximum.accumulate(times_s)[:-1])[: len(times_s)]
    return times_s[is_later], counts[is_later]


def _correlated_lag_s(times_s: FloatArray, counts: IntArray, frame_s: float) -> float | None:
    """Return the lag of the highest autocorrelation, to about a frame; None if no lag stands out."""
    smooth = np.convolve(_on_grid(times_s, counts, frame_s), gaussian(np.arange(-3.0, 4.0)), "same")
    correlation = _autocorrelation(smooth)
    shown = correlation[: int(len(correlation) / MIN_PERIODS) + 2]
    peaks = local_maxima(shown)
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
        pairs = lags(onsets, onsets, (expected_s - 4 * frame_s, expected_s + 4 * frame_s))
        lag_s, weight = mean_shift(*pairs, expected_s, frame_s)
        share = weight / max(film_s - lag_s, frame_s)
        single = single or share
        if share < AS_COMMON * single:
            break
        period_s = lag_s / cycles
    return period_s


def firing_spread_s(period_s: float, order_parameter: float = ORDER_PARAMETER) -> float:
    """Return sigma_A: if half of the firings are early by it and half are late by it, they have this order parameter.

    The source is eq. C.2, whose last term must read cos(2 pi sigma_A / tau).

    >>> f"{firing_spread_s(5.0):.3f}"
    '0.253'
    """
    return period_s / (2 * math.pi) * math.acos(order_parameter)


def spread_at_s(period_s: float, flash_s: float, order_parameter: float = ORDER_PARAMETER) -> float:
    """Return the spread of the histogram when the firings have this order parameter, whatever their distribution.

    Each flash adds its duration to the spread of the firings. For r_sync = 0.95 the result is twice the thesis's 2
    frames, which swarms reach some cycles later: in its eq. C.3 all flashes end within sigma_A.

    >>> f"{spread_at_s(5.0, 0.375):.3f}"
    '0.275'
    """
    return math.hypot(firing_spread_s(period_s, order_parameter), flash_s / math.sqrt(12))


def spread_threshold_s(period_s: float, flash_s: float) -> float:
    """Return the bound of eq. C.3: the largest spread of a histogram if all rings are lit within sigma_A of its middle.

    Half of the rings are lit from -sigma_A on and the other half until sigma_A (Fig. C.1b), so that the middles of the
    flashes are sigma_A - flash / 2 off. In frames, with sigma_A = 4 and flashes of 5, the bound is sqrt(6) = 2.449 for
    every even number of robots; the thesis prints 2.49, and uses 2 frames. Here time is not cut into frames.

    The longer the flash, the less room is left for its beginning, and none from 2 sigma_A on. But robots whose clocks
    differ, filmed in frames, are never closer than about a frame. So the middles may always be off by sigma_A / 4: a
    frame of the thesis's camera, and their distance at a flash of 1.5 sigma_A, where the bound is lowest, sigma_A / 2.

    >>> f"{spread_threshold_s(5.0, 0.375):.3f}"
    '0.126'
    """
    sigma_s = firing_spread_s(period_s)
    return math.hypot(max(sigma_s - flash_s / 2, sigma_s / 4), flash_s / math.sqrt(12))
