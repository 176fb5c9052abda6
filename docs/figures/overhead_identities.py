"""Makes docs/figures/overhead_identities.csv: how often flashes of one robot are linked, without tags and with them.

Trials of ten robots are filmed at four speeds and tracked; links from flash to flash are compared with the simulation.
With a number as its argument it makes that many films of each kind instead of 5; the second is the width of pictures.
"""

import sys
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from epuck_sim import Simulation, load_scenario
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.display.table import csv_text
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.camera import Geometry, overhead_camera
from epuck_sim.overhead.filming import VirtualCamera
from epuck_sim.overhead.flashes import Flash, RingCounter
from epuck_sim.overhead.identities import SURE, Identities
from epuck_sim.overhead.robots import find_robots
from epuck_sim.overhead.track import Track, analyse
from epuck_sim.scenario.embodied import EmbodiedScenario

FILMS = 5
FILM_S = 120.0
SPEEDS_CM_S = (1.6, 3.2, 6.2, 12.8)
PERIOD_S = 5.0
NEAR_CM = 2.0  # distance of a flash from its robot


Truth = list[tuple[float, FloatArray, BoolArray]]  # time of each control step, where robots are, and who is lit


def robots_of(flashes: Sequence[Flash], truth: Truth) -> IntArray:
    """Return (flashes,) the robots that are lit where and when flashes were found; -1 where none is."""
    times, poses, lit = map(np.array, zip(*truth, strict=True))
    robots = []
    for flash in flashes:
        steps = slice(*np.searchsorted(times, (flash.onset_s - 0.05, flash.end_s)))
        place = np.where(lit[steps, :, None], poses[steps, :, :2], np.nan)
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


def track(speed_cm_s: float, seed: int, side_px: int) -> tuple[Track, Truth]:
    """Return what is found in a film of a trial, whose pictures are square, and the truth."""
    settings = {
        "overhead.width_px": side_px,
        "overhead.height_px": side_px,
        "robots.0.parameters.speed_cm_s": speed_cm_s,
    }
    scenario = load_scenario("thesis", [f"{key}={value}" for key, value in settings.items()])
    assert isinstance(scenario, EmbodiedScenario)
    simulation, truth = Simulation(scenario, seed), Truth()
    camera = VirtualCamera(scenario.overhead, scenario.arena.build(), seed)
    counter = RingCounter(Geometry(overhead_camera(scenario.overhead, 60, 60), (60.0, 60.0), "the scenario", True))
    for step in islice(simulation, round(FILM_S / simulation.step_s)):
        truth.append((step.time_s, step.poses.copy(), step.ring_on.copy()))
        for frame in camera.observe(step.time_s, step.poses, step.ring_on):
            counter.process(frame)
    return analyse("film", counter.counted(), TrackOptions(period_s=PERIOD_S, robots=10), ()), truth


def main(films: int, side_px: int) -> None:
    """Write the table."""
    rows = []
    for speed_cm_s in SPEEDS_CM_S:
        total = np.zeros(4, np.int64)
        for seed in range(films):
            tracked, truth = track(speed_cm_s, seed, side_px)
            total += links_found(robots_of(tracked.flashes, truth), find_robots(tracked).identities)
        links, right, sure, sure_right = total.tolist()
        shares = (right / links, sure / links, sure_right / max(1, sure))
        rows.append([speed_cm_s, films, links, *(f"{100 * share:.1f}" for share in shares)])
        print(*rows[-1], sep=", ", flush=True)
    columns = ["speed_cm_s", "films", "links", "right_percent", "sure_percent", "sure_right_percent"]
    Path(__file__).with_name("overhead_identities.csv").write_text(csv_text(columns, rows))


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    main(*(given + [FILMS, 240][len(given) :]))
