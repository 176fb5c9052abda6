"""Write docs/figures/base_curve.csv and .png, T_sync against speed in the base case; `make figures` runs this script.

The base case is the dashed line of thesis Figs. 4.2 and 4.3: ten robots, 60 x 60 cm, tau = 5 s, epsilon = 0.1. Its
argument is the run folder of the sweep `thesis-speeds` of sweeps.yaml.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from epuck_sim import read_points
from epuck_sim.display.table import csv_text

FEW = 30
OUT = Path(__file__)


def write(folder: Path) -> int:
    """Write the table of a run folder, and return its number of trials at a speed."""
    points = read_points(folder)
    times = np.array([point.times for point in points])
    if not all(point.observed.all() for point in points):
        raise SystemExit("censored trials need the estimator of Appendix A")
    trials = len(times[0])
    few, mean, median = times[:, :FEW].mean(axis=1), times.mean(axis=1), np.median(times, axis=1)
    error = times.std(axis=1, ddof=1) / trials**0.5
    speeds = [point.axes["robots.0.parameters.speed_cm_s"] for point in points]
    columns = ["speed_cm_s", f"mean_of_{FEW}", f"mean_of_{trials}", "standard_error", "median"]
    rows = zip(speeds, few, mean, error, median, strict=True)
    OUT.with_suffix(".csv").write_text(csv_text(columns, ([f"{value:.4g}" for value in row] for row in rows)))
    return trials


def draw(trials: int) -> None:
    """Draw the figure from the table."""
    speed, few, mean, error, _ = np.loadtxt(OUT.with_suffix(".csv"), delimiter=",", skiprows=1, unpack=True)
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    axes.fill_between(speed, mean - 1.96 * error, mean + 1.96 * error, color="0.85")
    axes.loglog(speed, mean, "o-", color="black", label=f"mean of {trials} trials, 95 % interval")
    axes.loglog(speed, few, "x", color="tab:red", label=f"mean of the first {FEW}")
    axes.set(xlabel="V (cm/s)", ylabel="T_sync (cycles)")
    axes.set_xticks(ticks := [0.1, 1, 10], labels=map(str, ticks))
    axes.set_yticks(ticks := [20, 30, 40, 60, 80, 100], labels=map(str, ticks))
    axes.minorticks_off()
    axes.legend()
    figure.savefig(OUT.with_suffix(".png"), dpi=110)


if __name__ == "__main__":
    draw(write(Path(sys.argv[1])))
