"""Makes docs/figures/fig-4-7.csv and .png from the run folder that is its argument: `make figures` runs it.

Thesis Fig. 4.7: T_sync of ten e-pucks against speed, five trials each, measured in films from above the arena. Here
the robots are those of arenas/physical.yaml. The first five trials at each speed are filmed and tracked; the fifty in
the run folder give T_sync by the order parameter. base_curve.csv adds the robots without imperfections.
"""

import math
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from epuck_sim import Simulation
from epuck_sim.display.table import csv_text
from epuck_sim.overhead.camera import Geometry, overhead_camera
from epuck_sim.overhead.filming import VirtualCamera
from epuck_sim.overhead.flashes import RingCounter
from epuck_sim.overhead.synchrony import SynchronyDetector, is_synchronised
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.scenario.embodied import EmbodiedScenario

OUT = Path(__file__).with_name("fig-4-7.csv")
FILMED = 5  # number of trials filmed at each speed

THRESHOLD_S = 2 / 15.5  # spread at which a film shows synchrony: two frames (thesis 4.3.1)

MAX_CYCLES = 500  # number of periods after which filming gives up


def film(scenario: EmbodiedScenario, seed: int) -> float:
    """Return T_sync of a film of a trial, in periods; NaN if it is not reached within `MAX_CYCLES`."""
    simulation = Simulation(scenario, seed)
    arena = scenario.arena
    camera = VirtualCamera(scenario.overhead, arena.build(), seed)
    floor_cm = arena.width_cm, arena.height_cm
    counter = RingCounter(Geometry(overhead_camera(scenario.overhead, *floor_cm), floor_cm, "the scenario", True))
    (period_s,) = set((simulation.period_ms / 1000).tolist())
    start_s = scenario.overhead.lit_start_s
    detector = SynchronyDetector(period_s)
    for step in simulation:
        for frame in camera.observe(step.time_s, step.poses, step.ring_on):
            rings = counter.process(frame)
            evaluation = detector.update(frame.time_s, len(rings)) if frame.time_s >= start_s else None
            if evaluation is not None and is_synchronised(evaluation, THRESHOLD_S):
                return float((evaluation.time_s - start_s) / period_s)
        if step.time_s > MAX_CYCLES * period_s:
            break
    return math.nan


def measure(points: list[PointTrials]) -> None:
    """Film trials of all points, and write the table."""
    tasks = [(point.scenario, seed) for point in points for seed in point.seeds[:FILMED]]
    with ProcessPoolExecutor() as executor:
        filmed = np.array(list(executor.map(film, *zip(*tasks, strict=True)))).reshape(len(points), FILMED)
    rows = []
    for point, times in zip(points, filmed, strict=True):
        cycles = point.times[point.observed]
        error = cycles.std(ddof=1) / len(cycles) ** 0.5
        extremes = (np.nanmean(times), np.nanmin(times), np.nanmax(times))
        row = [*point.axes.values(), *extremes, int(np.isnan(times).sum()), len(cycles), cycles.mean(), error]
        rows.append([f"{value:.4g}" for value in row])
    columns = ["speed_cm_s", "film_mean", "film_min", "film_max", "film_never", "trials", "mean", "standard_error"]
    OUT.write_text(csv_text(columns, rows))


def draw() -> None:
    """Draw the table, and the base curve beside it."""
    speed, film_mean, low, high, _, _, mean, error = np.loadtxt(OUT, delimiter=",", skiprows=1, unpack=True)
    ideal = np.loadtxt(OUT.with_name("base_curve.csv"), delimiter=",", skiprows=1, unpack=True)
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.fill_between(speed, low, high, color="0.88", label=f"{FILMED} trials filmed: least and largest")
    axes.loglog(speed, film_mean, "o-", color="black", label="by the film, their mean")
    axes.errorbar(speed, mean, 1.96 * error, fmt="s-", color="tab:red", capsize=2, label="by r >= 0.95, mean of 50")
    label = "ideal robots by r >= 0.95, mean of 1,000"
    axes.errorbar(ideal[0], ideal[2], 1.96 * ideal[3], fmt="-", color="tab:blue", label=label)
    axes.set(xlabel="V (cm/s)", ylabel="T_sync (cycles)", xlim=(0.4, 15))
    axes.set_xticks(ticks := [0.5, 1, 2, 5, 10], labels=map(str, ticks))
    axes.set_yticks(ticks := [5, 10, 20, 50, 100, 200], labels=map(str, ticks))
    axes.minorticks_off()
    axes.legend(fontsize="small")
    figure.savefig(OUT.with_suffix(".png"), dpi=110)


if __name__ == "__main__":
    measure(read_points(Path(sys.argv[1])))
    draw()
