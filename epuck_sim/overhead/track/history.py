"""What was counted in a film, over time, and which moments of it a figure shows."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.spread import Evaluation

ACROSS = 4
"""Moments in a row of the figure."""


class History(NamedTuple):
    """What was counted in a film, and what follows from it. Times are on the film's clock."""

    times_s: FloatArray
    """(n,) of the frames."""
    counts: IntArray
    """(n,) lit rings in them."""
    evaluations: Sequence[Evaluation]
    period_s: float
    start_s: float
    """When the robots started: cycle 0."""
    threshold_s: float
    t_sync_s: float | None
    """None if the swarm was never synchronised."""

    def cycles(self, time_s: Any) -> Any:
        """Return a time, or (n,) times, in periods since the start."""
        return (time_s - self.start_s) / self.period_s

    def begins_synchrony(self, evaluation: Evaluation) -> bool:
        """Return whether it is the one at T_sync, but for rounding."""
        return self.t_sync_s is not None and abs(evaluation.time_s - self.t_sync_s) < 1e-6


class Snapshot(NamedTuple):
    """A frame of the film, and the rings found in it."""

    time_s: float
    picture: Picture
    rings_px: FloatArray
    """(rings, 3) column, row, radius."""


def choose_moments(history: History) -> list[list[tuple[float, Evaluation | None]]]:
    """Return three rows of up to `ACROSS` moments in the order of time, with the evaluation that is made then.

    An evaluation is made half a period after its mode, when that is at the midpoint.
    """
    quarters = [history.start_s + history.period_s * (quarter + 1) / ACROSS for quarter in range(ACROSS)]
    made = [(each.time_s + history.period_s / 2, each) for each in history.evaluations]
    sync = next((index for index, (_, each) in enumerate(made) if history.begins_synchrony(each)), None)
    split = max(0, len(made) - ACROSS if sync is None else sync - 1)
    return [[(now_s, None) for now_s in quarters], _spaced(made[:split]), _around(made[split:])]


def _spaced(moments: list[tuple[float, Evaluation]]) -> list[tuple[float, Evaluation | None]]:
    """Return up to `ACROSS` of them, at equal distances, the first and the last among them."""
    places = np.linspace(0, len(moments) - 1, min(ACROSS, len(moments)))
    return [moments[round(place)] for place in places]


def _around(moments: list[tuple[float, Evaluation]]) -> list[tuple[float, Evaluation | None]]:
    """Return the first of them and the last one."""
    return [*moments[: ACROSS - 1], *moments[ACROSS - 1 :][-1:]]
