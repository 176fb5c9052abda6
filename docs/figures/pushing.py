"""Draws how far robots move a disc against how well they are in step: `pushing.py RUN_FOLDER`, of `pushing-synchrony`.

A dot is a trial; its order parameter is the mean over the cycles. The table has the mean distance of the trials in each
range of order parameters, with Student's 95 % interval.
"""

import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from epuck_sim import read_points
from epuck_sim.measures.perturbations import mean_with_interval

FRICTION, FORCE_N, WEIGHT_N = "arena.movables.0.friction", 0.5, 9.81
LIMITS = (0, 0.7, 0.9, 0.97, 1)
MARKS = ("o", "s", "^", "D")
HERE = Path(__file__).parent


def main(folder: Path) -> None:
    """Write pushing-synchrony.png and pushing-synchrony.csv beside this file."""
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot(xlabel="order parameter, mean over 10 min", ylabel="distance moved [cm/h]")
    rows = ["robots needed,order parameter from,to,trials,moved [cm/h],lower,upper"]
    trials: dict[int, list[tuple[Any, Any]]] = {}
    for moved, order in zip(read_points(folder, of="moved"), read_points(folder, of="order_parameter"), strict=True):
        needed = int(np.ceil(moved.axes[FRICTION] * WEIGHT_N / FORCE_N))
        orders = [np.mean(np.array(series, float)) for series in order.measured]
        trials.setdefault(needed, []).extend(zip(orders, moved.measured, strict=True))
    for needed, found in trials.items():
        orders, distances = np.array(found, float).T
        axes.plot(orders, distances, MARKS[needed - 1], markersize=3.5, alpha=0.6, label=f"{needed} at once")
        for low, high in pairwise(LIMITS):
            some = distances[(orders >= low) & (orders < high)]
            if len(some) > 1:
                mean, lower, upper = mean_with_interval(some.tolist())
                rows.append(f"{needed},{low},{high},{len(some)},{mean:.1f},{lower:.1f},{upper:.1f}")
    figure.legend(title="robots needed", loc="outside right upper")
    figure.savefig(HERE / "pushing-synchrony.png", dpi=150)
    (HERE / "pushing-synchrony.csv").write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
