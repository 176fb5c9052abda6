"""Write docs/figures/base_curve.csv and .png, T_sync against speed in the base case; `make figures` runs this script.

The base case is the dashed line of thesis Figs. 4.2 and 4.3: ten robots, 60 x 60 cm, tau = 5 s, epsilon = 0.1. The
script takes about a quarter of an hour on one core.
"""

import csv
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from epuck_sim import Simulation, load_scenario, run_trial
from epuck_sim.util.seeds import trial_seed

SPEEDS_CM_S = (0.05, 0.083, 0.137, 0.227, 0.376, 0.622, 1.029, 1.704, 2.821, 4.67, 7.732, 12.8)
TRIALS = 1000
FEW = 30
MASTER_SEED = 0
OUT = Path(__file__)


def synchronisation_times(speed_cm_s: float) -> list[int]:
    """Return T_sync in cycles of each trial at a speed."""
    scenario = load_scenario("thesis", [f"robots.0.parameters.speed_cm_s={speed_cm_s}"])
    results = [run_trial(Simulation(scenario, trial_seed(MASTER_SEED, trial))) for trial in range(TRIALS)]
    if any(result.censored for result in results):
        raise SystemExit(f"{speed_cm_s} cm/s: censored trials need the estimator of Appendix A")
    return [result.cycles for result in results]


def simulate() -> None:
    """Simulate all speeds and write the table."""
    with ProcessPoolExecutor() as executor:
        times = np.array(list(executor.map(synchronisation_times, SPEEDS_CM_S)))
    few, mean, median = times[:, :FEW].mean(axis=1), times.mean(axis=1), np.median(times, axis=1)
    error = times.std(axis=1, ddof=1) / TRIALS**0.5
    with OUT.with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["speed_cm_s", f"mean_of_{FEW}", f"mean_of_{TRIALS}", "standard_error", "median"])
        for row in zip(SPEEDS_CM_S, few, mean, error, median, strict=True):
            writer.writerow([f"{value:.4g}" for value in row])


def draw() -> None:
    """Draw the figure from the table."""
    speed, few, mean, error, _ = np.loadtxt(OUT.with_suffix(".csv"), delimiter=",", skiprows=1, unpack=True)
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    axes.fill_between(speed, mean - 1.96 * error, mean + 1.96 * error, color="0.85")
    axes.loglog(speed, mean, "o-", color="black", label=f"mean of {TRIALS} trials, 95 % interval")
    axes.loglog(speed, few, "x", color="tab:red", label=f"mean of the first {FEW}")
    axes.set(xlabel="V [cm/s]", ylabel="T_sync [cycles]")
    axes.set_xticks(ticks := [0.1, 1, 10], labels=map(str, ticks))
    axes.set_yticks(ticks := [20, 30, 40, 60, 80, 100], labels=map(str, ticks))
    axes.minorticks_off()
    axes.legend()
    figure.savefig(OUT.with_suffix(".png"), dpi=110)


if __name__ == "__main__":
    simulate()
    draw()
