"""Where do the regimes of a swarm lie? The local minimum and the peak of T_sync against speed (thesis 4.2.2)."""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray

MIN_SPEEDS = 6
"""Fewer determined speeds than this leave a bump undetermined: a smooth curve with two bends takes four and more."""

SIGNIFICANCE = 0.05
"""A bump is found where, in a smaller share than this of all cases, noise on a falling curve would look as strong, and
noise on the curve itself would leave no bump."""

UNDETERMINED_SHARE = 0.05
"""A speed is left out where a larger share of its resamples is undetermined."""

GRID_POINTS = 300
LEAST_VARIANCE = 1e-8  # of log T; keeps curves without noise solvable, and no experiment knows T_sync to 0.01 %

# How rough log T may be: the variance of its third derivative's white noise, per decade of speed. From almost a
# parabola to a curve through every point.
ROUGHNESSES = 10.0 ** np.arange(-1, 6.5, 0.5)
# The likeliest curve has too flat peaks, and intervals about them miss the truth too often; three times as rough,
# they cover it, and the estimates are as good.
UNDERSMOOTHING = 3.0


class SmoothCurve(NamedTuple):
    """A smoothed curve of T_sync against speed, and its resamples, all smoothed alike."""

    speeds: FloatArray
    """(G,) cm/s, log-spaced between the slowest and the fastest speed determined."""
    means: FloatArray
    """(G,) cycles."""
    resampled: FloatArray
    """(B, G) cycles."""


class SpeedExtrema(NamedTuple):
    """The local minimum (V_m, T_m) and the later peak (V_p, T_p); NaN where the smoothed curve has no such pair."""

    v_m: float
    """cm/s."""
    t_m: float
    """Cycles."""
    v_p: float
    """cm/s."""
    t_p: float
    """Cycles."""
    intervals: FloatArray
    """(4, 2) the 95 % intervals of v_m, t_m, v_p, t_p: low and high."""
    rise: float
    """Of log T between the two."""
    p_value: float
    """How often noise on a falling curve rises as much as this is strong."""
    resampled: FloatArray
    """(B, 4) v_m, t_m, v_p, t_p of each resample; NaN where it has no such pair."""

    @property
    def is_found(self) -> bool:
        """Whether the pair is more than noise: noise does not make it, and noise does not undo it."""
        kept = float(np.isfinite(self.resampled[:, 0]).mean())
        return self.p_value < SIGNIFICANCE and kept > 1 - SIGNIFICANCE


def smooth_curve(speeds: FloatArray, means: FloatArray, resampled: FloatArray) -> SmoothCurve | None:
    """Return T_sync as a smooth function of speed, in logs of both; None if fewer than six speeds are determined.

    speeds: (S,) cm/s, ascending. means: (S,) cycles, NaN where undetermined. resampled: (B, S) bootstrap means.

    Left out are speed 0 and speeds where the mean or more than 5 % of the resamples are undetermined (not finite); up
    to 5 % count as the longest that is determined, since what is undetermined took too long.
    """
    fit = _fit(speeds, means, resampled)
    if fit is None:
        return None
    return SmoothCurve(fit.speeds, np.exp(fit.smoother @ fit.logs), np.exp(fit.resampled @ fit.smoother.T))


def find_minimum_and_peak(speeds: FloatArray, means: FloatArray, resampled: FloatArray) -> SpeedExtrema | None:
    """Return the local minimum and the later peak with the largest rise in log T between them.

    Arguments, and what is left out, are those of `smooth_curve`; None if fewer than six speeds are determined.

    A bump is as strong as the least of: the fall to the minimum, the rise, the fall from the peak. Noise makes rises
    too; the p-value is the share of those at least as large as that on the falling curve that fits best, under the
    noise of the resamples. Intervals are percentiles over the resamples' own pairs.
    """
    fit = _fit(speeds, means, resampled)
    if fit is None:
        return None
    noise = fit.resampled - fit.resampled.mean(axis=0)
    falling = falling_fit(fit.logs, 1 / fit.variances) + noise
    of_noise, _ = _pairs(fit.speeds, falling @ fit.smoother.T)
    pair, (strength,) = _pairs(fit.speeds, (fit.smoother @ fit.logs)[None])
    pairs, _ = _pairs(fit.speeds, fit.resampled @ fit.smoother.T)
    v_m, t_m, v_p, t_p = pair[0].tolist()
    if strength == 0:
        return SpeedExtrema(v_m, t_m, v_p, t_p, np.full((4, 2), np.nan), 0.0, 1.0, pairs)
    # the curve itself counts as one more draw, so that no finite number of resamples gives a p-value of 0
    p_value = (1 + np.count_nonzero(np.log(of_noise[:, 3] / of_noise[:, 1]) >= strength)) / (1 + len(noise))
    own = pairs[~np.isnan(pairs[:, 0])]
    intervals = np.percentile(own if len(own) else pair, [2.5, 97.5], axis=0).T
    return SpeedExtrema(v_m, t_m, v_p, t_p, intervals, float(np.log(t_p / t_m)), p_value, pairs)


def falling_fit(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the values (K,) that never rise and fit best by weighted least squares, pooling neighbours that do."""
    blocks: list[tuple[float, float, int]] = []  # value, weight, points
    for point in zip(values.tolist(), weights.tolist(), strict=True):
        value, weight, points = *point, 1
        while blocks and blocks[-1][0] < value:
            before, its_weight, its_points = blocks.pop()
            value = (before * its_weight + value * weight) / (its_weight + weight)
            weight, points = weight + its_weight, points + its_points
        blocks.append((value, weight, points))
    return np.repeat([value for value, _, _ in blocks], [points for _, _, points in blocks])


class _Fit(NamedTuple):
    speeds: FloatArray  # (G,)
    smoother: FloatArray  # (G, K): logs at the K determined speeds in, logs on the grid out
    logs: FloatArray  # (K,) of T
    resampled: FloatArray  # (B, K) logs
    variances: FloatArray  # (K,) of the logs


def _fit(speeds: FloatArray, means: FloatArray, resampled: FloatArray) -> _Fit | None:
    finite = np.isfinite(resampled)
    determined = (speeds > 0) & np.isfinite(means) & (finite.mean(axis=0) >= 1 - UNDETERMINED_SHARE)
    if np.count_nonzero(determined) < MIN_SPEEDS:
        return None
    longest = np.where(finite, resampled, 0).max(axis=0)
    log_resampled = np.log(np.where(finite, resampled, longest)[:, determined])
    x, logs = np.log10(speeds[determined]), np.log(means[determined])
    variances = np.maximum(log_resampled.var(axis=0, ddof=1), LEAST_VARIANCE)
    grid = np.linspace(x[0], x[-1], GRID_POINTS)
    roughness = UNDERSMOOTHING * _likeliest_roughness(x, logs, variances)
    return _Fit(10**grid, _smoother(x, variances / roughness, grid), logs, log_resampled, variances)


def _kernel(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the covariance, up to parabolas, of a threefold integral of white noise at x (n,) and y (m,), (n, m)."""
    return -(np.abs(x[:, None] - y) ** 5) / 240


def _smoother(x: FloatArray, penalties: FloatArray, grid: FloatArray) -> FloatArray:
    """Return the matrix (G, K) of the quintic smoothing spline: least squares plus a penalty on the third derivative.

    It leaves parabolas as they are, and extremes are such; a penalty on the curvature flattens them.
    """
    parabola = np.vander(x, 3)
    system = np.block([[_kernel(x, x) + np.diag(penalties), parabola], [parabola.T, np.zeros((3, 3))]])
    inverse = np.linalg.inv(system)[:, : len(x)]
    return np.hstack([_kernel(grid, x), np.vander(grid, 3)]) @ inverse


def _likeliest_roughness(x: FloatArray, logs: FloatArray, variances: FloatArray) -> float:
    """Return the roughness of largest likelihood, given the noise and with parabolas projected out."""
    contrasts = np.linalg.qr(np.vander(x, 3), "complete")[0][:, 3:]
    seen = contrasts.T @ logs
    rough = contrasts.T @ _kernel(x, x) @ contrasts
    noise = contrasts.T @ np.diag(variances) @ contrasts

    def surprise(roughness: float) -> float:
        covariance = roughness * rough + noise
        return float(seen @ np.linalg.solve(covariance, seen) + np.linalg.slogdet(covariance)[1])

    return float(min(ROUGHNESSES, key=surprise))


def _pairs(speeds: FloatArray, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return v_m, t_m, v_p, t_p (B, 4) of curves of log T (B, G), NaN if none, and their strengths (B,), 0 if none."""
    rising = np.diff(logs, axis=1) >= 0
    inner = logs[:, 1:-1]
    troughs = np.where(~rising[:, :-1] & rising[:, 1:], inner, np.inf)
    lowest = np.minimum.accumulate(troughs, axis=1)
    rises = np.where(rising[:, :-1] & ~rising[:, 1:], inner, -np.inf) - lowest
    curve, peak = np.arange(len(logs)), rises.argmax(axis=1)
    trough = (troughs == lowest[curve, peak, None]).argmax(axis=1) + 1
    rise, peak = rises[curve, peak], peak + 1
    t_m, t_p = logs[curve, trough], logs[curve, peak]
    fall_before = np.maximum.accumulate(logs, axis=1)[curve, trough] - t_m
    fall_after = t_p - np.minimum.accumulate(logs[:, ::-1], axis=1)[:, ::-1][curve, peak]
    exists = np.isfinite(rise)
    pairs = np.column_stack([speeds[trough], np.exp(t_m), speeds[peak], np.exp(t_p)])
    strengths = np.minimum(np.minimum(fall_before, rise), fall_after)
    return np.where(exists[:, None], pairs, np.nan), np.where(exists, strengths, 0.0)
