"""Compares a film with simulated trials of a scenario, by the same quantities, and fits the scenario to the film.

Trials are not rendered: the tracker gets the exact places of rings, at the film's frame rate and for its duration.
The errors that pictures add, tenths of a millimetre, are left out.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.errors import FilmError
from epuck_sim.estimate import UNDETERMINED, Estimate
from epuck_sim.overhead import ROUNDING
from epuck_sim.overhead.flashes import CountedRings, FlashLinker
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.robots import MANY_UNSURE, Robots, find_robots
from epuck_sim.overhead.synchrony import mean_shift
from epuck_sim.overhead.tags import Readings
from epuck_sim.overhead.track import Track, analyse
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import with_values, write_scenario
from epuck_sim.trial.model import run_trial
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.seeds import trial_seed

NEAR_MODE = 0.15  # largest relative difference from the commonest speed of a robot that drives straight ahead
NEAR_CYCLE_FRAMES = 1.5
"""Number of frames by which a cycle may differ from the commonest long one and still be the robot's own period: a
flash that is seen shortens a cycle by more (thesis eq. 4.1)."""
SHARE_AT_MODE = 0.25  # least share of cycles that last the robots' own period, for the film to determine it
SCALE_ERROR = 0.005  # relative error of lengths from the geometry; our estimate, for corners that are half a pixel off
LIT_SHARE = 0.5  # frames by which a flash may be shorter than it seems: a ring lit for part of an exposure is seen
CUT = 4.74
"""Fall of the log-likelihood at the ends of 95 % intervals: half the quantile of chi-square with four degrees of
freedom, which the range of draws from a uniform distribution approaches."""
GRID = 81  # values of each parameter for which the likelihood is computed
LEAST_ERROR = 1e-12  # least standard error of a value, in its unit, so that values that are all 0 have a density
SPEED = "robots.0.parameters.speed_cm_s"
FEW = 3  # fewest robots, or flashes of a robot, whose differences are estimated


def fit_film(robots: Robots, step_s: float = 0.0) -> dict[str, Estimate]:
    """Return the quantities that a film determines, by the keys of a scenario whose robots are all alike.

    Rings are lit for whole control steps of `step_s`, up to one step longer than the flash fraction.
    """
    track, group, period_s = robots.track, "robots.0.parameters", robots.track.period_s
    speed, speeds = _fit_speeds(robots)
    fitted = {SPEED: speed}
    if robots.identities.unsure <= MANY_UNSURE:  # otherwise each robot that is found mixes several
        period, clocks = _fit_clocks(robots)
        fitted |= {"spread.wheel_speed": speeds, f"{group}.period_s": period, "spread.clock_rate": clocks}
        period_s = period_s if math.isnan(period.value) else period.value
    fitted[f"{group}.flash_fraction"] = _fit_flash(robots, period_s, step_s)
    frames_s = np.diff(track.times_s)
    usual = frames_s[np.abs(frames_s / np.median(frames_s) - 1) < 0.5]
    if len(usual):  # not three frames, say, of which two are close together
        error_s = 2 * float(usual.std()) / math.sqrt(len(usual)) + 1e-3 / len(usual)  # times are stamped in ms, say
        mean_s = float(usual.mean())
        fitted["overhead.frames_per_s"] = Estimate(1 / mean_s, 1 / (mean_s + error_s), 1 / (mean_s - error_s))
    return {key: value for key, value in fitted.items() if not math.isnan(value.value)}


def _cycles(robots: Robots) -> list[FloatArray]:
    """Return the times from each flash to the next, for each robot."""
    return [np.diff(robots.flashes.onset_s[robots.identities.robot == number]) for number in robots.numbers]


def _fit_speeds(robots: Robots) -> tuple[Estimate, Estimate]:
    """Return the speed straight ahead, and the half-width of the factors by which robots differ in it."""
    usual = robots.identities.speed_cm_s
    values, errors = [], []
    for number in robots.numbers if usual else ():  # 0 if they stand, or each flash is in a single frame
        speeds = robots.flashes.speeds_cm_s[robots.identities.robot == number]
        straight = speeds[np.abs(speeds - usual) <= NEAR_MODE * usual]
        if len(straight) >= FEW:
            values.append(float(np.median(straight)))
            errors.append(1.25 * float(straight.std(ddof=1)) / math.sqrt(len(straight)))
    mean, spread = fit_uniform(np.array(values), np.array(errors))
    return mean._replace(low=mean.low * (1 - SCALE_ERROR), high=mean.high * (1 + SCALE_ERROR)), spread


def _fit_clocks(robots: Robots) -> tuple[Estimate, Estimate]:
    """Return the period of robots that see no flash, and the half-width of the factors by which clocks differ."""
    track, frame_s, cycles = robots.track, 1 / robots.track.fps, _cycles(robots)
    every = np.concatenate([*cycles, np.empty(0)])
    near = every[np.abs(every / track.period_s - 1) < 0.1]
    usual_s, _ = mean_shift(near, np.ones(len(near)), track.period_s, frame_s)
    own = [each[np.abs(each - usual_s) <= NEAR_CYCLE_FRAMES * frame_s] for each in cycles]
    if sum(map(len, own)) < SHARE_AT_MODE * len(every):
        return UNDETERMINED, UNDETERMINED
    many = [each for each in own if len(each) >= FEW]
    means, numbers = np.array([each.mean() for each in many]), np.array([len(each) for each in many])
    return fit_uniform(means, frame_s / np.sqrt(6 * numbers))


def _fit_flash(robots: Robots, period_s: float, step_s: float) -> Estimate:
    track, durations = robots.track, (robots.flashes.end_s - robots.flashes.onset_s)[:-1]
    usual = durations[np.abs(durations - track.flash_ms / 1000) <= 2 / track.fps]
    if len(usual) < FEW:
        return UNDETERMINED
    mean_s = float(usual.mean())
    # a robot in step with the camera has all its flashes cut in the same way
    error_s = 2 * float(usual.std(ddof=1)) / math.sqrt(len(robots.numbers))
    shortest_s = mean_s - step_s - error_s - LIT_SHARE / track.fps
    found = Estimate(max(mean_s - step_s / 2, 0.0), max(shortest_s, 0.0), mean_s + error_s)
    return found.apply(lambda lit_s: lit_s / period_s)


def fit_uniform(values: FloatArray, errors: FloatArray) -> tuple[Estimate, Estimate]:
    """Return the mean and the relative half-width of the uniform distribution of robots' values.

    Values are 0 or more; `errors` are their standard errors. Both results are undetermined for fewer than `FEW` robots,
    and the half-width if the interval of the mean reaches 0.
    """
    if len(values) < FEW:
        return UNDETERMINED, UNDETERMINED
    from scipy.special import ndtr  # noqa: PLC0415 takes a while to load

    errors = np.maximum(errors, max(1e-9 * np.abs(values).max(), LEAST_ERROR))
    low, high = values.min() - 3 * errors.max(), values.max() + 3 * errors.max()
    means = np.linspace(low, high, GRID)
    widths = np.linspace(0, 1.5 * max(high - low, 1e-9), GRID)
    likely = np.zeros((GRID, GRID))
    for value, error in zip(values, errors, strict=True):
        wide, off = np.maximum(widths, 0.05 * error), value - means[:, None]  # narrower ones change nothing
        share = ndtr((off + wide) / error) - ndtr((off - wide) / error)
        likely += np.log(np.maximum(share, 1e-300) / (2 * wide))
    likely -= likely.max()
    place = np.unravel_index(likely.argmax(), likely.shape)
    centre = float(means[place[0]])
    ends = []  # of the intervals with a profile likelihood above the cut, at most a step wider
    for grid, other in ((means, 1), (widths, 0)):
        inside, step = grid[likely.max(axis=other) >= -CUT], grid[1] - grid[0]
        ends.append((float(max(inside[0] - step, grid[0])), float(inside[-1] + step)))
    if ends[0][0] <= 0:  # a mean that may be 0 has no relative half-width
        return Estimate(centre, *ends[0]), UNDETERMINED
    return Estimate(centre, *ends[0]), Estimate(float(widths[place[1]]), *ends[1]).apply(lambda width: width / centre)


UNLIKE = 0.05  # largest p-value at which a film is unlike the trials
FEWEST_TRIALS = 19  # fewest trials with which a film can have so small a p-value
FEWEST_KNOWN = 0.5  # least share of film and trials that must have a quantity for it to be judged
LEAST_SPREAD = 0.005  # least standard deviation of a quantity, relative to its largest value: films are no more exact
FARTHEST_TIED = 4.0
"""Largest distance, in standard deviations, of a value from others most of which are the same, as these tell no scale:
more than nearly all distances of other quantities, less than that of a film that is clearly off."""
FLASH, CYCLE = "flash duration", "median cycle"  # quantities that a wrong clock changes by the same factor
LONGER, HIGHER = ("shorter", "longer"), ("lower", "higher")  # words for smaller and larger times, and other values
TIME_UNITS = ("cycles", "periods", "ms", "s")
NEAR_WALL_CM = 5.0  # largest distance of a robot's middle that is near a wall, as in the measure `near_walls`
SEEN_SHARE = 0.1  # share of an exposure for which a ring must be lit to be seen; our estimate


class QuantityComparison(NamedTuple):
    """A quantity of a film, compared with that of simulated trials."""

    name: str
    unit: str
    film: float
    trials: FloatArray  # (trials,) the same quantity of trials; NaN where it is unknown
    end: float = 0.0  # the film's end, in cycles: the lower bound of values beyond it

    @property
    def beyond(self) -> int:
        """Number of trials whose value is beyond the film's end."""
        return int(np.isinf(self.trials).sum())

    @property
    def unknown(self) -> int:
        """Number of trials whose value is unknown."""
        return int(np.isnan(self.trials).sum())

    @property
    def percentile(self) -> float:
        """Percentage of trials with smaller values, plus half of those with the same; NaN if film or trials lack it."""
        known = self.trials[~np.isnan(self.trials)]
        if math.isnan(self.film) or not len(known):
            return math.nan
        is_same = np.isclose(known, self.film, rtol=ROUNDING, atol=0)
        return float(100 * (np.mean((known < self.film) & ~is_same) + np.mean(is_same) / 2))

    def distances(self) -> FloatArray:
        """Return (1 + trials,) distances of the film and of each trial from the others, in their standard deviations.

        A time beyond the film's end counts as that end, or as the longest known time if it is longer. Unknown values
        have distance 0, and so have all if the film or most of the trials do not have the quantity. If most values are
        the same, the others are `FARTHEST_TIED` away at most.
        """
        values = np.append(self.film, self.trials)
        is_finite, is_known = np.isfinite(values), ~np.isnan(values)
        distances = np.zeros(len(values))
        if not is_known[0] or not is_finite.any() or is_known.sum() < max(3.0, FEWEST_KNOWN * len(values)):
            return distances
        values = np.where(np.isinf(values), max(values[is_finite].max(), self.end), values)
        for index in np.flatnonzero(is_known):
            others = values[is_known & (np.arange(len(values)) != index)]
            spread = max(float(others.std(ddof=1)), LEAST_SPREAD * float(np.abs(others).max()), 1e-12)
            distances[index] = (values[index] - others.mean()) / spread
        is_tied = np.isclose(values[is_known], np.median(values[is_known]), rtol=ROUNDING, atol=0).mean() > 0.5
        return FARTHEST_TIED * np.tanh(distances / FARTHEST_TIED) if is_tied else distances


class Verdict(NamedTuple):
    """Whether a film is like simulated trials, by all quantities together."""

    p_value: float
    """Share of the film and the trials whose farthest quantity is at least as far from the others as the film's; NaN if
    nothing can be said."""
    sentence: str  # the verdict in words, and what to do if it says little


def judge(rows: Sequence[QuantityComparison]) -> Verdict:
    """Return the verdict of one test of all quantities; the distances of trials from the rest give its distribution.

    The distribution of the largest distance accounts for testing many quantities, which depend on each other.
    """
    trials = len(rows[0].trials)
    distances = np.array([row.distances() for row in rows])
    largest = np.abs(distances).max(axis=0)
    if trials < FEWEST_TRIALS:
        least = f"give --trials {FEWEST_TRIALS} or more"
        return Verdict(math.nan, f"{trials} trials are too few to tell whether the film is like them; {least}")
    if not largest[0]:
        return Verdict(math.nan, "nothing can be said: no quantity is known of both the film and the trials")
    caution = ""
    beyond, known = rows[0].beyond, trials - rows[0].unknown
    if 2 * beyond > known:
        short = f"{beyond} of {known} trials are not synchronised when the film ends, so film for longer"
        caution = f"{short}; as far as it goes, "
    p_value = float(np.count_nonzero(largest >= largest[0]) / (1 + trials))
    if p_value > UNLIKE:
        return Verdict(p_value, f"{caution}the film is like the simulated trials (p = {p_value:.2g})")
    alone = np.mean(np.abs(distances) >= np.abs(distances[:, :1]), axis=1)  # p-values of each quantity alone
    far = [index for index in np.argsort(-np.abs(distances[:, 0])) if alone[index] <= UNLIKE]
    ways = [LONGER if row.unit in TIME_UNITS else HIGHER for row in rows]
    named = [f"{rows[index].name} {ways[index][int(distances[index, 0] > 0)]}" for index in far]
    unlike = f"the film is unlike the simulated trials (p = {p_value:.2g}): {', '.join(named)} than theirs"
    if any({f"{FLASH} {way}", f"{CYCLE} {way}"} <= set(named) for way in LONGER):
        unlike += "; if flash and cycle are so by the same factor, check the film's clock (--fps)"
    return Verdict(p_value, caution + unlike)


def compare_film(
    film: Robots, scenario: EmbodiedScenario, trials: int, progress: Callable[[Iterable[int]], Iterable[int]]
) -> list[QuantityComparison]:
    """Compare quantities of a film with those of trials, simulated with the scenario's seeds."""
    values = np.full((len(QUANTITIES), trials), np.nan)
    for trial in progress(range(trials)):
        try:
            found = track_trial(scenario, trial_seed(scenario.seed, trial), film.track)
        except FilmError:  # nothing is known of it
            continue
        values[:, trial] = [measured(found) for measured in QUANTITIES.values()]
    rows = zip(QUANTITIES.items(), values, strict=True)
    end = film.track.duration_s / film.track.period_s
    return [QuantityComparison(*named, measured(film), row, end) for (named, measured), row in rows]


def track_trial(scenario: EmbodiedScenario, seed: int, film: Track) -> Robots:
    """Return the robots of a simulated trial, as if it were filmed like another film; raise as `analyse`.

    The tracker knows the number of robots if it knew the film's, and reads tags in all frames if it read the film's.
    """
    times_s, poses, is_lit = _simulate(scenario, seed, film)
    linker, unseen = FlashLinker(), np.zeros(len(times_s), np.int64)
    for time_s, places, lit in zip(times_s.tolist(), poses[..., :2], is_lit, strict=True):
        rings = [Ring(x_cm, y_cm, epuck.RING_RADIUS_CM, 0.0, 0.0, 0.0, 100.0) for x_cm, y_cm in places[lit].tolist()]
        linker.add(time_s, rings)
    geometry = film.geometry._replace(floor_cm=(scenario.arena.width_cm, scenario.arena.height_cm))
    counted = CountedRings(len(times_s), times_s, is_lit.sum(axis=1), unseen, linker.flashes, geometry)
    robots = None if film.options.robots is None else int(is_lit.any(axis=0).sum())
    options = film.options._replace(robots=robots, tag_numbers=None)
    track = analyse(f"trial {seed} of {scenario.name}", counted, options, ())
    if film.tags is not None:
        at, who = np.nonzero(~np.isnan(poses[..., 0]))
        track = track._replace(tags=Readings(times_s[at], who, poses[at, who]))
    return find_robots(track)


def _within(track: Track, value: float | None) -> float:
    never = math.nan if track.confidence == "none" else math.inf
    return never if value is None else value


def _median_cycle(robots: Robots) -> float:
    every = np.concatenate([*_cycles(robots), np.empty(0)])
    return float(np.median(every)) if len(every) else math.nan


def _near_walls(robots: Robots) -> float:
    places, geometry = robots.flashes.places_cm, robots.track.geometry
    if not len(places) or not geometry.knows_floor:  # then places are relative to each other
        return math.nan
    return float(np.mean(np.minimum(places, geometry.floor_cm - places).min(axis=1) <= NEAR_WALL_CM))


def _slow(robots: Robots) -> float:
    speeds = robots.flashes.speeds_cm_s
    return float(np.mean(speeds < robots.identities.speed_cm_s / 2)) if len(speeds) else math.nan


QUANTITIES: dict[tuple[str, str], Callable[[Robots], float]] = {
    ("T_sync", "cycles"): lambda film: _within(film.track, film.track.t_sync_cycles),
    ("T_sync by the histogram", "periods"): lambda film: _within(film.track, film.track.histogram_periods),
    (FLASH, "ms"): lambda film: film.track.flash_ms,
    (CYCLE, "s"): _median_cycle,
    ("speed straight ahead", "cm/s"): lambda film: film.identities.speed_cm_s,
    ("flashes of robots that turn or stand", "share"): _slow,
    (f"flashes within {NEAR_WALL_CM:g} cm of a wall", "share"): _near_walls,
    ("half-width of clock rates", "share"): lambda film: fit_film(film).get("spread.clock_rate", UNDETERMINED).value,
}
"""Quantities of films and trials, by name and unit: NaN if unknown, inf if beyond the film's end."""


def _simulate(scenario: EmbodiedScenario, seed: int, film: Track) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Simulate a trial at the frame rate and for the duration of a film, whatever ends the scenario's trials.

    Return (frames,) s; (frames, robots, 3) poses in cm and rad, NaN where a robot is not in the arena; and
    (frames, robots) whether rings are seen to be lit.
    """
    limits = {"order_parameter": None, "when": None, "further_cycles": 0, "max_cycles": 10**9}
    end_s = film.duration_s + 2 * scenario.timing.step_ms / 1000
    stop = scenario.stop.model_copy(update={**limits, "max_time_s": end_s})
    steps: list[tuple[float, FloatArray, BoolArray]] = []

    def keep(step: Step, _: object) -> None:
        steps.append((step.time_s, step.poses.copy(), step.ring_on & step.present))

    run_trial(Simulation(scenario.model_copy(update={"stop": stop}), seed), [keep])
    steps_s, poses, ring_on = map(np.array, zip(*steps, strict=True))
    exposure_s = min(scenario.overhead.exposure_ms / 1000, 1 / film.fps)
    frames_s = np.arange(0.0, film.duration_s - exposure_s, 1 / film.fps)
    at_s = frames_s + exposure_s / 2
    seen = poses[np.searchsorted(steps_s, at_s, side="right") - 1]  # headings of the step before are enough
    for robot in range(poses.shape[1]):
        for axis in (0, 1):
            seen[:, robot, axis] = np.interp(at_s, steps_s, poses[:, robot, axis])
    moments = (frames_s + share * exposure_s for share in (SEEN_SHARE, 1 - SEEN_SHARE))
    begin, end = (ring_on[np.searchsorted(steps_s, moment, side="right") - 1] for moment in moments)
    is_there: BoolArray = ~np.isnan(seen).any(axis=2)  # a robot is absent between a step with it and one without it
    return frames_s, np.where(is_there[..., None], seen, np.nan), (begin | end) & is_there


def fitted_values(scenario: EmbodiedScenario, film: Robots) -> dict[str, Estimate]:
    """Return the values that a film determines, by the keys of a scenario.

    With several groups, a film does not show which group has which values: it determines only those of the camera.
    """
    known = {f"robots.0.parameters.{name}" for name in scenario.robots[0].parameters}
    fitted = fit_film(film, scenario.timing.step_ms / 1000)
    if len(scenario.robots) > 1:
        return {key: value for key, value in fitted.items() if key.startswith("overhead.")}
    return {key: value for key, value in fitted.items() if key in known or not key.startswith("robots.")}


def save_fitted(path: Path, scenario: EmbodiedScenario, fitted: dict[str, Estimate], film: str) -> None:
    """Write a scenario of one group with fitted values, intervals as comments; raise EpuckSimError where it cannot."""
    digits = {key: 3 if key.endswith(".period_s") else 6 for key in fitted}  # periods are whole milliseconds
    values = {key: round(value.value, digits[key]) for key, value in fitted.items()}
    if SPEED in values:  # the measured speed may exceed what wheels can do
        values[SPEED] = min(values[SPEED], scenario.group_kinds[0].wheel_limit_cm_s)
    longest_ms = 1000 / values.get("overhead.frames_per_s", scenario.overhead.frames_per_s)
    if scenario.overhead.exposure_ms > longest_ms:  # an exposure is no longer than a frame
        values["overhead.exposure_ms"] = longest_ms
    changed = with_values(scenario, {**values, "name": f"{scenario.name}-fitted"}, scenario.name)
    lines = [f"# Fitted to {film}, with 95 % intervals; all else is as it was."]
    lines += [f"# {key}: {each.value:.6g} ({each.low:.6g} to {each.high:.6g})" for key, each in fitted.items()]
    with atomic_write(path) as part:
        part.write_text("\n".join([*lines, write_scenario(changed)]), encoding="utf-8")
