"""Compares a film with simulated trials of a scenario: the same quantities of both, found in the same way."""

import math
from collections.abc import Callable, Iterable
from typing import Literal, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import FilmError
from epuck_sim.overhead.film_quantities import QUANTITIES, Quantity
from epuck_sim.overhead.simulated_film import simulate_film, track_simulated
from epuck_sim.overhead.track.result import Track
from epuck_sim.overhead.track.robots import Robots, robots_by_motion
from epuck_sim.overhead.track.tagged_robots import robots_by_tags
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.util.seeds import trial_seed

UNUSUAL_PERCENT = 2.5
"""Percentage of the trials beyond which a film is unusual, at either end."""


class QuantityComparison(NamedTuple):
    """A quantity of a film, compared with that of simulated trials."""

    quantity: Quantity
    film: float
    trials: FloatArray
    """(trials,) the same quantity of trials; NaN where they do not tell."""

    @property
    def beyond(self) -> int:
        """Number of trials in which it is beyond the film's end."""
        return int(np.isinf(self.trials).sum())

    @property
    def unknown(self) -> int:
        """Number of trials in which it is not known."""
        return int(np.isnan(self.trials).sum())

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


def track_trial(
    scenario: EmbodiedScenario, seed: int, film: Track, by: Literal["motion", "tags"]
) -> tuple[Track, Robots]:
    """Return what would be found in a film of a simulated trial, and its robots.

    Args:
        scenario: The scenario; its conditions of ending do not count.
        seed: Seed of the trial.
        film: The film with which the trial is compared.
        by: What robots are told apart by, as in the film.

    Raises:
        FilmError: The film is too short, or has no flashes.
    """
    simulated = simulate_film(scenario, seed, film)
    track = track_simulated(simulated, film)
    robots = robots_by_tags(track, simulated.tag_readings(), None) if by == "tags" else robots_by_motion(track)
    return track, robots


def compare_film(
    film: Track,
    robots: Robots,
    scenario: EmbodiedScenario,
    trials: int,
    progress: Callable[[Iterable[int]], Iterable[int]],
) -> list[QuantityComparison]:
    """Compare quantities of a film with those of simulated trials.

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
            tracked, found = track_trial(scenario, trial_seed(scenario.seed, trial), film, robots.by)
        except FilmError:  # nothing is known of it
            continue
        values[:, trial] = [quantity.of(tracked, found) for quantity in QUANTITIES]
    rows = zip(QUANTITIES, values, strict=True)
    return [QuantityComparison(quantity, quantity.of(film, robots), row) for quantity, row in rows]
