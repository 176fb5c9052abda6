"""Numbers that films and simulated trials have, found in the same way."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from epuck_sim.overhead.track.film_fit import cycles_of, fit_film
from epuck_sim.overhead.track.flash_motion import FlashTable
from epuck_sim.overhead.track.result import Track
from epuck_sim.overhead.track.robots import Robots

NEAR_WALL_CM = 5.0
"""Distance from a wall within which a robot's middle is near it, as in the measure `near_walls`."""


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
