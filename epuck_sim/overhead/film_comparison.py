"""A film beside simulated trials of a scenario: the same quantities of both, found in the same way.

Of a simulated trial, rings are given to the tracker where they are, at the film's frame rate and for its duration; what
pictures add, tenths of a millimetre, is left out.
"""

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import FilmError
from epuck_sim.overhead.track.analysis import analyse
from epuck_sim.overhead.track.film_fit import Fitted, cycles_of, fit_film
from epuck_sim.overhead.track.flash_motion import FlashTable
from epuck_sim.overhead.track.result import Track
from epuck_sim.overhead.track.ring_counter import RingCounter
from epuck_sim.overhead.track.ring_detection import Ring
from epuck_sim.overhead.track.robots import Robots, robots_by_motion
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario, write_scenario
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.seeds import trial_seed

NEAR_WALL_CM = 5.0
"""Distance from a wall within which a robot's middle is near it, as in the measure `near_walls`."""

UNUSUAL_PERCENT = 2.5
"""Percentage of the trials beyond which a film is unusual, at either end."""


SEEN_SHARE = 0.1
"""Share of an exposure for which a ring must be lit to be seen; our estimate: rings are much brighter than needed."""


class Quantity(NamedTuple):
    """A number that a film and trials have."""

    name: str
    unit: str
    of: Callable[[Track, Robots], float]
    """Returns it: NaN if the film does not tell, infinity if it is beyond the film's end."""


def _within(track: Track, value: float | None) -> float:
    if value is not None:
        return value
    return math.nan if track.confidence == "none" else math.inf


def _median_cycle(track: Track, robots: Robots) -> float:
    cycles = cycles_of(robots.identities.robot, FlashTable.of(track.flashes).onset_s)
    return float(np.median(cycles)) if len(cycles) else math.nan


def _near_walls(track: Track, _: Robots) -> float:
    places, floor_cm = FlashTable.of(track.flashes).places_cm, np.array(track.geometry.floor_cm)
    from_walls_cm = np.minimum(places, floor_cm - places).min(axis=1, initial=math.inf)
    return float(np.mean(from_walls_cm <= NEAR_WALL_CM)) if len(places) else math.nan


def _slow(track: Track, robots: Robots) -> float:
    speeds = FlashTable.of(track.flashes).speeds_cm_s
    return float(np.mean(speeds < robots.identities.speed_cm_s / 2)) if len(speeds) else math.nan


def _fitted(key: str) -> Callable[[Track, Robots], float]:
    def value(track: Track, robots: Robots) -> float:
        fitted = fit_film(track, robots)
        return fitted[key].value if key in fitted else math.nan

    return value


QUANTITIES = (
    Quantity("T_sync", "periods", lambda track, _: _within(track, track.t_sync_periods)),
    Quantity("T_sync by onsets", "periods", lambda track, _: _within(track, track.t_sync_onsets_periods)),
    Quantity("flash", "ms", lambda track, _: track.flash_ms),
    Quantity("median cycle", "s", _median_cycle),
    Quantity("speed straight ahead", "cm/s", lambda _, robots: robots.identities.speed_cm_s),
    Quantity("flashes of robots that turn or stand", "share", _slow),
    Quantity(f"flashes within {NEAR_WALL_CM:g} cm of a wall", "share", _near_walls),
    Quantity("half-width of clock rates", "share", _fitted("spread.clock_rate")),
)


class Beside(NamedTuple):
    """A quantity of a film beside that of simulated trials."""

    quantity: Quantity
    film: float
    trials: FloatArray
    """(trials,) the same of trials; NaN where they do not tell."""

    @property
    def percentile(self) -> float:
        """Percentage of the trials with smaller values, and half of those with the same; NaN if nothing tells."""
        known = self.trials[~np.isnan(self.trials)]
        if math.isnan(self.film) or not len(known):
            return math.nan
        return float(100 * (np.mean(known < self.film) + np.mean(known == self.film) / 2))

    @property
    def is_unusual(self) -> bool:
        """Whether fewer than 2.5 % of the trials are as extreme; needs 40 trials."""
        known = self.trials[~np.isnan(self.trials)]
        if math.isnan(self.film) or len(known) * UNUSUAL_PERCENT < 100:
            return False
        return bool(100 * min(np.mean(known <= self.film), np.mean(known >= self.film)) < UNUSUAL_PERCENT)


class _SimulatedCounter(RingCounter):
    """Counts rings that are known."""

    def see(self, time_s: float, places_cm: FloatArray) -> None:
        """Add a frame in which rings are lit at (n, 2) cm."""
        rings = [Ring(x_cm, y_cm, epuck.RING_RADIUS_CM, 0.0, 0.0, 0.0, 100.0) for x_cm, y_cm in places_cm.tolist()]
        self._times.append(time_s)
        self._counts.append(len(rings))
        self._areas.append(0)
        self._linker.add(time_s, rings)
        self.frames += 1

    def always_lit(self) -> list[Ring]:
        """Return no rings."""
        return []


def track_trial(scenario: EmbodiedScenario, seed: int, film: Track) -> Track:
    """Return what would be found in a film of a simulated trial, of the same duration as another film.

    Args:
        scenario: The scenario; its conditions of ending do not count.
        seed: Seed of the trial.
        film: The other film, whose frame rate and options are taken.

    Raises:
        FilmError: The film is too short, or has no flashes.
    """
    steps_s, poses, ring_on = _steps(scenario, seed, film.duration_s)
    exposure_s = min(scenario.overhead.exposure_ms / 1000, 1 / film.fps)
    frames_s = np.arange(0.0, film.duration_s - exposure_s, 1 / film.fps)
    at_s = frames_s + exposure_s / 2
    robots = range(scenario.robot_count)
    places = np.array([[np.interp(at_s, steps_s, poses[:, robot, axis]) for axis in (0, 1)] for robot in robots])
    moments = (frames_s + share * exposure_s for share in (SEEN_SHARE, 1 - SEEN_SHARE))
    begin, end = (ring_on[np.searchsorted(steps_s, moment, side="right") - 1] for moment in moments)
    counter = _SimulatedCounter(film.geometry._replace(floor_cm=(scenario.arena.width_cm, scenario.arena.height_cm)))
    for frame, time_s in enumerate(frames_s.tolist()):
        counter.see(time_s, places[begin[frame] | end[frame], :, frame])
    options = film.options._replace(robots=scenario.robot_count, corners_px=None)
    return analyse(f"trial {seed} of {scenario.name}", counter, options, ())


def _steps(scenario: EmbodiedScenario, seed: int, until_s: float) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return (steps,) s, (steps, robots, 2) cm, and (steps, robots) whether rings are lit, of a trial."""
    times, poses, ring_on = [], [], []
    for step in Simulation(scenario, seed):
        times.append(step.time_s)
        poses.append(step.poses[:, :2].copy())
        ring_on.append(step.ring_on & step.present)
        if step.time_s >= until_s:
            break
    return np.array(times), np.array(poses), np.array(ring_on)


def overlay(scenario: EmbodiedScenario, track: Track, robots: Robots) -> tuple[EmbodiedScenario, dict[str, Fitted]]:
    """Return a scenario with what a film tells instead of its own values, and that with its intervals.

    Raises:
        FilmError: Robots are not all alike, so that the film does not tell whose values are whose.
        ScenarioError: What the film tells is not allowed.
    """
    if len(scenario.robots) > 1:
        raise FilmError(
            f"{scenario.name}: has {len(scenario.robots)} groups of robots; allowed: one, to fit it to a film"
        )
    known = scenario.robots[0].parameters
    fitted = {
        key: value
        for key, value in fit_film(track, robots).items()
        if not key.startswith("robots.") or key.rpartition(".")[2] in known
    }
    digits = {key: 3 if key.endswith(".period_s") else 6 for key in fitted}  # periods are whole milliseconds
    settings = [f"{key}={round(value.value, digits[key])}" for key, value in fitted.items()]
    return load_scenario(scenario, [*settings, f"name={scenario.name}-fitted"]), fitted


def save_overlay(path: Path, scenario: EmbodiedScenario, fitted: dict[str, Fitted], film: str) -> None:
    """Write a scenario that was fitted, with intervals as comments; raise EpuckSimError where it cannot be written."""
    lines = [f"# Fitted to {film}, with 95 % intervals; all else is as it was."]
    lines += [f"# {key}: {each.value:.6g} ({each.low:.6g} to {each.high:.6g})" for key, each in fitted.items()]
    with atomic_write(path) as part:
        part.write_text("\n".join([*lines, write_scenario(scenario)]), encoding="utf-8")


def compare_film(
    film: Track,
    robots: Robots,
    scenario: EmbodiedScenario,
    trials: int,
    progress: Callable[[Iterable[int]], Iterable[int]],
) -> list[Beside]:
    """Return quantities of a film beside those of simulated trials.

    Args:
        film: What was found in the film.
        robots: Its robots.
        scenario: The scenario of the trials; its seed is that of the first one.
        trials: Number of trials.
        progress: Shows how far the trials are.
    """
    values = np.full((len(QUANTITIES), trials), np.nan)
    for trial in progress(range(trials)):
        try:
            tracked = track_trial(scenario, trial_seed(scenario.seed, trial), film)
        except FilmError:  # it tells nothing
            continue
        found = robots_by_motion(tracked)
        values[:, trial] = [quantity.of(tracked, found) for quantity in QUANTITIES]
    rows = zip(QUANTITIES, values, strict=True)
    return [Beside(quantity, quantity.of(film, robots), row) for quantity, row in rows]
