"""What a film tells of its robots, as numbers with intervals: speed, clocks, flashes, and how far robots differ."""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.flashes import FlashTable
from epuck_sim.overhead.period import mean_shift
from epuck_sim.overhead.robots import MANY_UNSURE, Robots
from epuck_sim.overhead.track import Track

NEAR_MODE = 0.15  # relative distance of a speed from the commonest one within which a robot drove straight ahead
NEAR_CYCLE_FRAMES = 1.5
"""Number of frames by which a cycle may differ from the commonest long one and still be the robot's own period: a
flash that is seen shortens a cycle by more (thesis eq. 4.1)."""
SHARE_AT_MODE = 0.25  # cycles of the own period, relative to all, below which the film does not tell it
SCALE_ERROR = 0.005  # relative error of lengths by the geometry; our estimate, for corners that are half a pixel off
LIT_SHARE = 0.5  # frames by which a flash may be shorter than it seems: a ring lit for part of an exposure is seen
CUT = 4.74
"""Fall of the log-likelihood at the ends of 95 % intervals: half of the quantile of chi-square with four degrees of
freedom, which the range of draws from a uniform distribution approaches."""
GRID = 81  # values of each parameter for which the likelihood is computed
LEAST_ERROR = 1e-12  # least standard error of a value, in its unit, so that values that are all 0 have a density
FEW = 3  # robots, or flashes of a robot, below which nothing is said about their differences


class Fitted(NamedTuple):
    """A number that a film tells, with a 95 % interval."""

    value: float
    low: float
    high: float


def fit_film(track: Track, robots: Robots) -> dict[str, Fitted]:
    """Return what a film determines, by the keys of a scenario whose robots are all alike.

    Quantities that the film does not determine are left out.
    """
    flashes = FlashTable.of(track.flashes)
    group = "robots.0.parameters"
    fitted: dict[str, Fitted | None] = {}
    fitted[f"{group}.speed_cm_s"], speeds = _fit_speeds(flashes, robots)
    period_s = track.period_s
    if robots.identities.unsure <= MANY_UNSURE:  # else each seeming robot is some of several
        period, clocks = _fit_clocks(flashes, robots, track)
        fitted |= {"spread.wheel_speed": speeds, f"{group}.period_s": period, "spread.clock_rate": clocks}
        period_s = period.value if period else period_s
    fitted[f"{group}.flash_fraction"] = _fit_flash(flashes, robots, track, period_s)
    fitted["overhead.frames_per_s"] = _fit_rate(track.times_s)
    return {key: value for key, value in fitted.items() if value is not None}


def cycles_of(flashes: FlashTable, robot: IntArray, numbers: IntArray) -> list[FloatArray]:
    """Return the times from each flash to the next, for each of some numbers of robots; robot: whose each flash is."""
    return [np.diff(flashes.onset_s[robot == number]) for number in numbers]


def _fit_speeds(flashes: FlashTable, robots: Robots) -> tuple[Fitted | None, Fitted | None]:
    """Return the speed straight ahead, and the half-width of the factors by which robots differ in it."""
    usual = robots.identities.speed_cm_s
    if not usual:  # robots stand, or each flash is in a single frame
        return None, None
    values, errors = [], []
    for number in robots.numbers:
        speeds = flashes.speeds_cm_s[robots.identities.robot == number]
        straight = speeds[np.abs(speeds - usual) <= NEAR_MODE * usual]
        if len(straight) >= FEW:
            values.append(float(np.median(straight)))
            errors.append(1.25 * float(straight.std(ddof=1)) / math.sqrt(len(straight)))
    mean, spread = fit_uniform(np.array(values), np.array(errors))
    if mean is not None:
        mean = mean._replace(low=mean.low * (1 - SCALE_ERROR), high=mean.high * (1 + SCALE_ERROR))
    return mean, spread


def _fit_clocks(flashes: FlashTable, robots: Robots, track: Track) -> tuple[Fitted | None, Fitted | None]:
    """Return the period of robots that see no flash, and the half-width of the factors by which clocks differ."""
    frame_s = 1 / track.fps
    cycles = cycles_of(flashes, robots.identities.robot, robots.numbers)
    every = np.concatenate([*cycles, np.empty(0)])
    near = every[np.abs(every / track.period_s - 1) < 0.1]
    if not len(near):
        return None, None
    usual_s, _ = mean_shift(near, np.ones(len(near)), track.period_s, frame_s)
    own = [each[np.abs(each - usual_s) <= NEAR_CYCLE_FRAMES * frame_s] for each in cycles]
    if sum(map(len, own)) < SHARE_AT_MODE * len(every):
        return None, None
    many = [each for each in own if len(each) >= FEW]
    means, numbers = np.array([each.mean() for each in many]), np.array([len(each) for each in many])
    return fit_uniform(means, frame_s / np.sqrt(6 * numbers))


def _fit_flash(flashes: FlashTable, robots: Robots, track: Track, period_s: float) -> Fitted | None:
    durations = (flashes.end_s - flashes.onset_s)[:-1]
    usual = durations[np.abs(durations - track.flash_ms / 1000) <= 2 / track.fps]
    if len(usual) < FEW:
        return None
    mean_s = float(usual.mean())
    # a robot in step with the camera has all its flashes cut in the same way
    error_s = 2 * float(usual.std(ddof=1)) / math.sqrt(len(robots.numbers))
    shortest_s = mean_s - error_s - LIT_SHARE / track.fps
    return Fitted(mean_s / period_s, shortest_s / period_s, (mean_s + error_s) / period_s)


def _fit_rate(times_s: FloatArray) -> Fitted | None:
    frames_s = np.diff(times_s)
    usual = frames_s[np.abs(frames_s / np.median(frames_s) - 1) < 0.5]
    if not len(usual):  # three frames, say, of which two are close together
        return None
    error_s = 2 * float(usual.std()) / math.sqrt(len(usual)) + 1e-3 / len(usual)  # times are stamped in ms, say
    mean_s = float(usual.mean())
    return Fitted(1 / mean_s, 1 / (mean_s + error_s), 1 / (mean_s - error_s))


def fit_uniform(values: FloatArray, errors: FloatArray) -> tuple[Fitted | None, Fitted | None]:
    """Return the mean, and the relative half-width, of a uniform distribution from which robots have their values.

    There is neither of fewer than `FEW` robots, and no half-width of a mean whose interval reaches 0.

    Args:
        values: (robots,) what was measured of each, 0 or more.
        errors: (robots,) standard errors of these.
    """
    if len(values) < FEW:
        return None, None
    from scipy.special import ndtr  # noqa: PLC0415 takes a while to load

    errors = np.maximum(errors, max(1e-9 * np.abs(values).max(), LEAST_ERROR))
    low, high = values.min() - 3 * errors.max(), values.max() + 3 * errors.max()
    means = np.linspace(low, high, GRID)
    widths = np.linspace(0, 1.5 * max(high - low, 1e-9), GRID)
    likely = np.zeros((GRID, GRID))
    for value, error in zip(values, errors, strict=True):
        wide, off = np.maximum(widths, 0.05 * error), value - means[:, None]  # narrower ones differ by nothing
        share = ndtr((off + wide) / error) - ndtr((off - wide) / error)
        likely += np.log(np.maximum(share, 1e-300) / (2 * wide))
    likely -= likely.max()
    place = np.unravel_index(likely.argmax(), likely.shape)
    centre = float(means[place[0]])
    ends = [_ends(axis, likely.max(axis=other)) for axis, other in ((means, 1), (widths, 0))]
    if ends[0][0] <= 0:  # a mean that may be 0 has no relative half-width
        return Fitted(centre, *ends[0]), None
    widths_fitted = [each / centre for each in (float(widths[place[1]]), *ends[1])]
    return Fitted(centre, *ends[0]), Fitted(*widths_fitted)


def _ends(grid: FloatArray, likely: FloatArray) -> tuple[float, float]:
    """Return the ends of the interval in which a profile is likely enough, a step wider at most."""
    inside = np.flatnonzero(likely >= -CUT)
    step = grid[1] - grid[0]
    low, high = float(grid[inside[0]] - step), float(grid[inside[-1]] + step)
    return max(low, float(grid[0])), high
