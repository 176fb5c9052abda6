"""How many flashes of one robot are linked, compared with a simulation."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.overhead.flashes import Flash
from epuck_sim.overhead.identities import Identities

NEAR_CM = 2.0


class Truth:
    """Where robots are, and who is lit, at control steps."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._poses: list[FloatArray] = []
        self._lit: list[BoolArray] = []

    def add(self, time_s: float, poses: FloatArray, ring_on: BoolArray) -> None:
        self._times.append(time_s)
        self._poses.append(poses.copy())
        self._lit.append(ring_on.copy())

    def whose(self, flashes: Sequence[Flash]) -> IntArray:
        """Return (flashes,) the robots that are lit where and when flashes were found; -1 where none is."""
        times, poses, lit = np.array(self._times), np.array(self._poses)[..., :2], np.array(self._lit)
        robots = []
        for flash in flashes:
            steps = slice(*np.searchsorted(times, (flash.onset_s - 0.05, flash.end_s)))
            place = np.where(lit[steps, :, None], poses[steps], np.nan)
            seen = lit[steps].any(axis=0)
            off = np.full(len(seen), np.inf)
            off[seen] = np.linalg.norm(np.nanmean(place[:, seen], axis=0) - (flash.x_cm, flash.y_cm), axis=1)
            robots.append(int(off.argmin()) if off.min() < NEAR_CM else -1)
        return np.array(robots)


class Links(NamedTuple):
    """Counts of links from a robot's flash to its next one."""

    links: int = 0
    right: int = 0
    sure: int = 0
    sure_right: int = 0

    def __add__(self, other: Self) -> "Links":  # type: ignore[override]
        return Links(*(one + two for one, two in zip(self, other, strict=True)))

    @property
    def right_share(self) -> float:
        return self.right / max(1, self.links)

    @property
    def sure_share(self) -> float:
        return self.sure / max(1, self.links)

    @property
    def sure_right_share(self) -> float:
        return self.sure_right / max(1, self.sure)


def links_found(whose: IntArray, identities: Identities, sure: float) -> Links:
    """Return how many of the true links were found, and of those that count as sure, how many are right."""
    links = Links()
    last: tuple[dict[int, int], dict[int, int]] = {}, {}
    for flash, (true, found) in enumerate(zip(whose.tolist(), identities.robot.tolist(), strict=True)):
        truly, seemingly = last[0].get(true), last[1].get(found)
        is_right = truly is not None and truly == seemingly
        is_sure = seemingly is not None and identities.certainty[flash] >= sure
        links += Links(truly is not None, is_right, is_sure, is_sure and is_right)
        last[0][true], last[1][found] = flash, flash
    return links
