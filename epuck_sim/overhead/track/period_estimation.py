"""What a film itself tells about its oscillators: period and flash; and the threshold of their spread (Appendix C)."""

import math

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.track.lag_density import Events, bell, centre, common_lags_s, lags
from epuck_sim.overhead.track.spread import frame_ends

LEAST_PERIODS = 2.5
"""A film of fewer tells no period: whatever happens to look alike twice would do."""

CLEAR = 0.3
"""Correlation of the counts with those a period later from which a film of many periods tells it. Robots that flash at
random stay below in films of a minute or more, simulated trials with a synchronised cycle or two at the end above."""

AS_HIGH = 0.92
"""A peak of the correlation so high, beside the highest, is its equal; the shortest lag wins, not a multiple of it."""

AS_OFTEN = 0.7
"""A lag over several cycles, beside that over one, if that often a robot keeps its rhythm."""

MOST_CYCLES = 10
"""Over more, a period is not made more exact: clocks differ by more than what is left."""

AROUND = (0.9, 1.2)
"""Where a period lies, as multiples of the correlation's. That is too short rather than too long, for a flash that is
seen can only shorten a cycle (thesis eq. 4.1)."""

ORDER_PARAMETER = 0.95
"""r_sync of thesis 4.2.1."""


def estimate_period_s(times_s: FloatArray, counts: IntArray) -> float | None:
    """Return the oscillators' period, from (n,) counts of lit rings in frames at (n,) times; None if it is not clear.

    About where it lies is the highest peak of the counts' autocorrelation; as counts are multiplied, cycles in which
    many rings flash together tell most of it. What it is, is the commonest time from rings that go on to rings that go
    on; while the robots are not synchronised many cycles are shortened, each by another time, so of nearly equally
    common times the longest. None, too, for films of less than `LEAST_PERIODS`. Clusters of nearly equal size that
    share the period evenly, all film long, look like one cluster of a shorter period.
    """
    times_s, counts = _growing(times_s, counts)
    if len(times_s) < 4:
        return None
    frame_s = float(np.median(np.diff(times_s)))
    near_s = _correlated_lag_s(times_s, counts, frame_s)
    if near_s is None:
        return None
    onsets = _changes(times_s, counts, 1)
    lags_s = common_lags_s(onsets, onsets, (AROUND[0] * near_s, AROUND[1] * near_s), frame_s)
    return _over_cycles_s(onsets, float(lags_s[-1]), frame_s, times_s[-1] - times_s[0]) if len(lags_s) else None


def estimate_flash_s(times_s: FloatArray, counts: IntArray) -> float | None:
    """Return for how long a ring is lit, from (n,) counts in frames at (n,) times; None if none goes on and off.

    It is the commonest time from rings that go on to rings that go off. The light of all rings divided by how often one
    goes on would be longer, for a ring that goes on in the frame in which another goes off is not counted; and shorter
    where a lit ring is missed in some frame, and seems to go on twice.
    """
    times_s, counts = _growing(times_s, counts)
    onsets, ends = _changes(times_s, counts, 1), _changes(times_s, counts, -1)
    if not len(onsets[0]) or not len(ends[0]):
        return None
    frame_s = float(np.median(np.diff(times_s)))
    lit_s = (frame_ends(times_s, times_s[-1]) - times_s) @ counts / onsets[1].sum()
    lags_s = common_lags_s(onsets, ends, (0.0, 2 * lit_s + frame_s), frame_s)
    return float(lags_s[0]) if len(lags_s) else None


def _growing(times_s: FloatArray, counts: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the frames whose times are after those of all before."""
    is_later = np.append(True, times_s[1:] > np.maximum.accumulate(times_s)[:-1])[: len(times_s)]
    return times_s[is_later], counts[is_later]


def _correlated_lag_s(times_s: FloatArray, counts: IntArray, frame_s: float) -> float | None:
    """Return the lag at which the counts are most like themselves, to a frame or so; None if they clearly never are."""
    smooth = np.convolve(_on_grid(times_s, counts, frame_s), bell(np.arange(-3.0, 4.0)), "same")
    correlation = _autocorrelation(smooth)
    shown = correlation[: int(len(correlation) / LEAST_PERIODS) + 2]
    is_peak = (shown[1:-1] >= shown[:-2]) & (shown[1:-1] > shown[2:])
    peaks = 1 + np.flatnonzero(is_peak)
    peaks = peaks[peaks > np.argmax(shown <= 0)]  # before that, a flash is compared with itself
    if not len(peaks):
        return None
    before, at, after = (shown[peaks + shift] for shift in (-1, 0, 1))
    # of the parabola through three points, as a peak may lie between frames
    heights = at - (after - before) ** 2 / (8 * (before - 2 * at + after))
    lag = peaks[np.argmax(heights >= AS_HIGH * heights.max())]
    share = lag / len(correlation)
    # by chance the correlation is higher in a shorter film, as the square root of the share
    is_clear = shown[lag] / (1 - share) >= max(CLEAR, math.sqrt(share))
    return float(lag * frame_s) if is_clear else None


def _on_grid(times_s: FloatArray, counts: IntArray, frame_s: float) -> FloatArray:
    """Return (m,) mean counts over intervals of a frame's length each, one after another."""
    ends_s = frame_ends(times_s, times_s[-1] + frame_s)
    corners_s = np.column_stack([times_s, ends_s]).ravel()
    lit_s = np.append(0.0, np.repeat(np.cumsum((ends_s - times_s) * counts), 2)[:-1])
    edges_s = np.arange(times_s[0], times_s[-1] + 1.5 * frame_s, frame_s)
    means: FloatArray = np.diff(np.interp(edges_s, corners_s, lit_s)) / frame_s
    return means


def _autocorrelation(values: FloatArray) -> FloatArray:
    """Return (m,): sums of products of (m,) values, less their mean, with those so much later; 1 at 0, or all 0."""
    values = values - values.mean()
    room = 1 << (2 * len(values)).bit_length()
    products: FloatArray = np.fft.irfft(np.abs(np.fft.rfft(values, room)) ** 2, room)[: len(values)]
    return products / products[0] if products[0] > 1e-9 else np.zeros(len(values))


def _changes(times_s: FloatArray, counts: IntArray, sign: int) -> Events:
    """Return when counts grow (sign 1) or fall (-1), in the middle between two frames, and by how much."""
    sizes = sign * np.diff(counts)
    changes = np.flatnonzero(sizes > 0)
    return (times_s[changes] + times_s[changes + 1]) / 2, sizes[changes].astype(float)


def _over_cycles_s(onsets: Events, period_s: float, frame_s: float, film_s: float) -> float:
    """Return a period more exactly, by the lag over as many cycles as are about as common as single ones.

    Frames move that lag as little as they move the first, but it is divided by more.
    """
    single = 0.0
    for cycles in range(1, MOST_CYCLES + 1):
        expected_s = cycles * period_s
        pairs = lags(onsets, onsets, (expected_s - 4 * frame_s, expected_s + 4 * frame_s))
        lag_s, weight = centre(*pairs, expected_s, frame_s)
        share = weight / max(film_s - lag_s, frame_s)
        single = single or share
        if share < AS_OFTEN * single:
            break
        period_s = lag_s / cycles
    return period_s


def firing_spread_s(period_s: float, order_parameter: float = ORDER_PARAMETER) -> float:
    """Return sigma_A: half of the firings so much early and half so much late have that order parameter, 0 to 1.

    Eq. C.2, of which the last term must read cos(2 pi sigma_A / tau).

    >>> f"{firing_spread_s(5.0):.3f}"
    '0.253'
    """
    return period_s / (2 * math.pi) * math.acos(order_parameter)


def spread_at_s(period_s: float, flash_s: float, order_parameter: float = ORDER_PARAMETER) -> float:
    """Return the spread of the histogram when the firings have an order parameter, whatever their distribution.

    Each flash adds its own length to the spread of the firings. That is what r_sync = 0.95 looks like on a film, and
    twice the thesis's 2 frames, which swarms reach some cycles later: its eq. C.3 has all flashes end within sigma_A.

    >>> f"{spread_at_s(5.0, 0.375):.3f}"
    '0.275'
    """
    return math.hypot(firing_spread_s(period_s, order_parameter), flash_s / math.sqrt(12))


def spread_threshold_s(period_s: float, flash_s: float) -> float:
    """Return the largest spread of a histogram of rings, all lit within sigma_A of its middle: the bound of eq. C.3.

    Half of the rings are lit from -sigma_A on and the other half until sigma_A (Fig. C.1b), so that the middles of the
    flashes are sigma_A - flash / 2 off. In frames, with sigma_A = 4 and flashes of 5, the bound is sqrt(6) = 2.449 for
    every even number of robots; the thesis prints 2.49, and uses 2 frames. Here time is not cut into frames.

    The longer the flash, the less room is left for its beginning, and none from 2 sigma_A on. But robots whose clocks
    differ, filmed in frames, are never closer than a frame or so. So the middles may always be sigma_A / 4 off: what
    they are at a flash of 1.5 sigma_A, where the bound is lowest, sigma_A / 2, and a frame of the thesis's camera.

    >>> f"{spread_threshold_s(5.0, 0.375):.3f}"
    '0.126'
    """
    sigma_s = firing_spread_s(period_s)
    return math.hypot(max(sigma_s - flash_s / 2, sigma_s / 4), flash_s / math.sqrt(12))
