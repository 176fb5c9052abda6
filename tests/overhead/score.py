"""How well a tracker found the rings of a film whose truth is known: recall, precision and error."""

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from epuck_sim.arrays import FloatArray

WITHIN_CM = 1.0
"""Largest distance of a reported ring from the true one, in cm; robots are at least 7.4 cm apart."""


class Score(NamedTuple):
    """How well rings were found, in one frame or in many."""

    found: int = 0
    missed: int = 0
    """Rings that were lit for the whole exposure and are not reported."""
    false: int = 0
    """Rings reported where none was lit at any time of the exposure."""
    worst_cm: float = 0.0
    """The largest distance between a ring found and the truth."""
    squares_cm2: float = 0.0
    """Sum of the squares of these distances."""

    def __add__(self, other: Self) -> "Score":  # type: ignore[override]
        found, missed, false, _, squares_cm2 = (one + two for one, two in zip(self, other, strict=True))
        return Score(found, missed, false, max(self.worst_cm, other.worst_cm), squares_cm2)  # type: ignore[arg-type]

    @property
    def recall(self) -> float:
        return self.found / max(1, self.found + self.missed)

    @property
    def precision(self) -> float:
        return self.found / max(1, self.found + self.false)

    @property
    def rms_cm(self) -> float:
        """Root mean square of the distances."""
        return float((self.squares_cm2 / max(1, self.found)) ** 0.5)


def compare(reported_cm: FloatArray, lit_cm: FloatArray, flickering_cm: FloatArray) -> Score:
    """Return how well (n, 2) cm reported rings match those that are there.

    lit_cm: (m, 2) of those lit for the whole exposure; flickering_cm: (k, 2) of those lit for a part of it, which may
    be found or not.
    """
    there = np.vstack([lit_cm.reshape(-1, 2), flickering_cm.reshape(-1, 2)])
    if not len(reported_cm) or not len(there):
        return Score(missed=len(lit_cm), false=len(reported_cm))
    distances = np.linalg.norm(there[:, None] - reported_cm, axis=2)
    nearest = distances.min(axis=1)
    is_found = nearest <= WITHIN_CM
    matched = len(np.unique(distances.argmin(axis=1)[is_found]))
    return Score(
        found=int(is_found.sum()),
        missed=int((~is_found[: len(lit_cm)]).sum()),
        false=len(reported_cm) - matched,
        worst_cm=float(nearest[is_found].max(initial=0.0)),
        squares_cm2=float((nearest[is_found] ** 2).sum()),
    )


def score_rows(rows: Iterable[dict[str, float]], truth: Iterable[tuple[float, FloatArray, FloatArray]]) -> Score:
    """Return how well a table of rings matches the truth: times of frames, and what is lit then, see `compare`."""
    places = np.array([(row["time_s"], row["x_cm"], row["y_cm"]) for row in rows]).reshape(-1, 3)
    scores = (compare(places[np.abs(places[:, 0] - time_s) < 2e-3, 1:], *lit_cm) for time_s, *lit_cm in truth)
    return sum(scores, Score())
