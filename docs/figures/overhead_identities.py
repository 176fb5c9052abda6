"""Makes docs/figures/overhead_identities.csv: how often flashes of one robot are linked, without tags and with them.

Trials of ten robots are filmed at four speeds and tracked; links from flash to flash are compared with the simulation.
With a number as its argument it makes that many films of each kind instead of 5; the second is the width of pictures.
"""

import csv
import sys
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from epuck_sim import Simulation, load_scenario
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.camera import Frame, Geometry, overhead_camera
from epuck_sim.overhead.filming import VirtualCamera
from epuck_sim.overhead.flashes import Flash, RingCounter
from epuck_sim.overhead.identities import SURE, Identities
from epuck_sim.overhead.robots import find_robots
from epuck_sim.overhead.track import Track, analyse
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import require_model

FILMS = 5
FILM_S = 120.0
SPEEDS_CM_S = (1.6, 3.2, 6.2, 12.8)
PERIOD_S = 5.0
NEAR_CM = 2.0  # distance of a flash from its robot


class Truth:
    """Where robots are, and who is lit, at control steps."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._poses: list[FloatArray] = []
        self._lit: list[BoolArray] = []

    def add(self, time_s: float, poses: FloatArray, ring_on: BoolArray) -> None:
        """Add a control step."""
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
            seen = np.asarray(lit[steps].any(axis=0))
            off = np.full(len(seen), np.inf)
            off[seen] = np.linalg.norm(np.nanmean(place[:, seen], axis=0) - (flash.x_cm, flash.y_cm), axis=1)
            robots.append(int(off.argmin()) if off.min() < NEAR_CM else -1)
        return np.array(robots)


def links_found(whose: IntArray, identities: Identities) -> IntArray:
    """Return how many true links there are, and are found; how many links seem sure, and of these are right."""
    links = np.zeros(4, np.int64)
    last: tuple[dict[int, int], dict[int, int]] = {}, {}
    for flash, (true, found) in enumerate(zip(whose.tolist(), identities.robot.tolist(), strict=True)):
        truly, seemingly = last[0].get(true), last[1].get(found)
        is_right = truly is not None and truly == seemingly
        is_sure = seemingly is not None and identities.certainty[flash] >= SURE
        links += (truly is not None, is_right, is_sure, is_sure and is_right)
        last[0][true], last[1][found] = flash, flash
    return links


def scenario_with(side_px: int, *settings: str) -> EmbodiedScenario:
    """Return the thesis's scenario with square pictures of so many pixels."""
    pixels = (f"overhead.width_px={side_px}", f"overhead.height_px={side_px}")
    return require_model(load_scenario("thesis", [*pixels, *settings]), EmbodiedScenario, "films are of robots")


def film(speed_cm_s: float, seed: int, side_px: int, truth: Truth) -> Iterator[Frame]:
    """Yield the frames of a trial, and note what is true of it."""
    scenario = scenario_with(side_px, f"robots.0.parameters.speed_cm_s={speed_cm_s}")
    simulation = Simulation(scenario, seed)
    camera = VirtualCamera(scenario.overhead, scenario.arena.build(), seed)
    for step in islice(simulation, round(FILM_S / simulation.step_s)):
        truth.add(step.time_s, step.poses, step.ring_on)
        yield from camera.observe(step.time_s, step.poses, step.ring_on)


def track(speed_cm_s: float, seed: int, side_px: int) -> tuple[Track, Truth]:
    """Return what is found in a film of a trial, and the truth."""
    truth = Truth()
    overhead = scenario_with(side_px).overhead
    counter = RingCounter(Geometry(overhead_camera(overhead, 60, 60), (60.0, 60.0), "the scenario", True))
    for frame in film(speed_cm_s, seed, side_px, truth):
        counter.process(frame)
    return analyse("film", counter.counted(), TrackOptions(period_s=PERIOD_S, robots=10), ()), truth


def main(films: int, side_px: int) -> None:
    """Write the table."""
    with Path(__file__).with_name("overhead_identities.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["speed_cm_s", "films", "links", "right_percent", "sure_percent", "sure_right_percent"])
        for speed_cm_s in SPEEDS_CM_S:
            total = np.zeros(4, np.int64)
            for seed in range(films):
                tracked, truth = track(speed_cm_s, seed, side_px)
                robots = find_robots(tracked)
                whose = truth.whose(tracked.flashes)
                total += links_found(whose, robots.identities)
            links, right, sure, sure_right = total.tolist()
            shares = (right / links, sure / links, sure_right / max(1, sure))
            row = [speed_cm_s, films, links, *(f"{100 * share:.1f}" for share in shares)]
            writer.writerow(row)
            print(*row, sep=", ", flush=True)


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    main(*(given + [FILMS, 240][len(given) :]))
