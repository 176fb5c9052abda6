"""Makes docs/figures/overhead_identities.csv: how often flashes of one robot are linked, without tags and with them.

Trials of ten robots are filmed at four speeds and tracked; links from flash to flash are compared with the simulation.
With a number as its argument it makes that many films of each kind instead of 5; the second is the width of pictures.
"""

import csv
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from epuck_sim import Simulation, load_scenario
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.camera import Frame, Geometry, overhead_camera
from epuck_sim.overhead.filming import VirtualCamera
from epuck_sim.overhead.flashes import RingCounter
from epuck_sim.overhead.identities import SURE
from epuck_sim.overhead.robots import find_robots
from epuck_sim.overhead.track import Track, analyse
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import require_model
from tests.overhead.identities_score import Links, Truth, links_found

FILMS = 5
FILM_S = 120.0
SPEEDS_CM_S = (1.6, 3.2, 6.2, 12.8)
PERIOD_S = 5.0


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
            total = Links()
            for seed in range(films):
                tracked, truth = track(speed_cm_s, seed, side_px)
                robots = find_robots(tracked)
                whose = truth.whose(tracked.flashes)
                total += links_found(whose, robots.identities, SURE)
            percents = (f"{100 * share:.1f}" for share in (total.right_share, total.sure_share, total.sure_right_share))
            row = [speed_cm_s, films, total.links, *percents]
            writer.writerow(row)
            print(*row, sep=", ", flush=True)


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    main(*(given + [FILMS, 240][len(given) :]))
