"""Draws docs/figures/thesis_run.png, one trial of the scenario `thesis`: `make figures` runs it."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from epuck_sim import Simulation, load_scenario
from epuck_sim.epuck import RADIUS_CM
from epuck_sim.synchrony import SynchronyWatch

SEED = 8
OUT = Path(__file__).with_suffix(".png")


def main() -> None:
    """Simulate until the swarm is synchronised, and a little longer, and draw what happened."""
    scenario = load_scenario("thesis")
    simulation = Simulation(scenario, SEED)
    watch = SynchronyWatch(simulation)
    times, rings, poses, firings = [], [], [], []
    done = None
    for step in simulation:
        cycles = watch.cycles
        watch.look(step)
        times.append(step.time_s)
        rings.append(step.ring_on.copy())
        poses.append(step.poses.copy())
        if watch.cycles > cycles:
            firings.append((step.time_s, watch.order_parameter))
        if done is None and watch.is_synchronised:
            done = step.time_s
        if done is not None and step.time_s > done + 20:
            break

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[1, 1.5])
    draw_arena(left.subplots(), scenario.arena.width_cm, np.array(poses), np.array(rings))
    raster, order = right.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
    draw_raster(raster, np.array(times), np.array(rings))
    order.plot(*zip(*firings, strict=True), "o-", color="black", markersize=3, linewidth=1)
    order.axhline(scenario.stop.order_parameter, color="tab:red", linewidth=0.8, linestyle="--")
    for axes in (raster, order):
        axes.axvline(done, color="tab:blue", linewidth=0.8)
    order.set(xlabel="simulated time [s]", ylabel="order parameter r", ylim=(0, 1.02), xlim=(0, times[-1]))
    figure.savefig(OUT, dpi=110)


def draw_arena(axes, side_cm: float, poses, rings) -> None:
    """Draw the robots as they stand at the last common flash, red where lit, with their paths of the last 10 s."""
    moment = np.flatnonzero(rings.sum(axis=1) == rings.sum(axis=1)[-100:].max())[-1]
    for robot in range(poses.shape[1]):
        path = poses[moment - 100 : moment + 1, robot]
        axes.plot(path[:, 0], path[:, 1], color="0.7", linewidth=0.8)
        x, y, heading = poses[moment, robot]
        axes.add_patch(Circle((x, y), RADIUS_CM, facecolor="tab:red" if rings[moment, robot] else "0.5"))
        axes.plot([x, x + RADIUS_CM * np.cos(heading)], [y, y + RADIUS_CM * np.sin(heading)], color="white")
    axes.set(xlim=(0, side_cm), ylim=(0, side_cm), aspect="equal", xlabel="x [cm]", ylabel="y [cm]")


def draw_raster(axes, times, rings) -> None:
    """Draw when each robot's ring was lit."""
    for robot in range(rings.shape[1]):
        edges = np.diff(np.concatenate([[0], rings[:, robot].astype(int), [0]]))
        begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        spans = [(times[begin], 0.1 * (end - begin)) for begin, end in zip(begins, ends, strict=True)]
        axes.broken_barh(spans, (robot - 0.4, 0.8), facecolor="tab:red")
    axes.set(ylabel="robot", yticks=range(rings.shape[1]))


if __name__ == "__main__":
    main()
