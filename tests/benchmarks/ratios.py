"""Ratios of speed that are kept: `python -m tests.benchmarks.ratios`, which `make bench` runs.

Robots stand beside ten bare steps of pymunk with as many discs, agents beside a plain loop of numpy. As machines are
noisy, both sides of a ratio take turns within one run. Prints each beside that of the last release, adds a line to
docs/figures/speed_history.csv, and draws it.
"""

import csv
import statistics
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pymunk
from matplotlib.figure import Figure

from epuck_sim import ParticleSimulation, Simulation, __version__, load_scenario
from epuck_sim.arrays import FloatArray
from tests.benchmarks.measuring import swarm_of

HISTORY = Path(__file__).parents[2] / "docs" / "figures" / "speed_history.csv"

SWARMS = {  # robots, the side of their arena in cm, and their speed in cm/s
    "10 robots": (10, 60, 3.0),
    "10 fast robots": (10, 60, 12.8),
    "20 robots": (20, 100, 3.0),
    "100 robots": (100, 200, 3.0),
    "300 robots": (300, 400, 3.0),
    "1000 robots": (1000, 700, 3.0),
}

AGENTS = {"20 agents": 20, "100 agents": 100, "1000 agents": 1000}
"""Agents in a square metre at 1 cm/s that hear their nearest neighbour."""

BLOCK = 50  # control steps that a side takes in its turn

FIRINGS = 2000  # of the loop of numpy in its turn


def compare(ours: Callable[[], object], theirs: Callable[[], object], turns: int) -> tuple[float, float]:
    """Return the median CPU time of a turn of ours in s, and of its ratio to theirs."""
    ours()
    theirs()
    spent = []
    for _ in range(turns):
        began = time.thread_time()
        ours()
        between = time.thread_time()
        theirs()
        spent.append((between - began, time.thread_time() - between))
    return statistics.median(a for a, _ in spent), statistics.median(a / b for a, b in spent)


def bare_space(poses: list[list[float]]) -> pymunk.Space:
    """Return a space with as many discs as robots, which stand still."""
    space = pymunk.Space()
    for x, y, _ in poses:
        body = pymunk.Body(150, pymunk.moment_for_circle(150, 0, 3.7))
        body.position = x, y
        space.add(body, pymunk.Circle(body, 3.7))
    return space


def compare_robots(robots: int, side_cm: float, speed_cm_s: float) -> tuple[float, float]:
    """Return the CPU time of a control step in us, and its ratio to ten bare steps of physics."""
    simulation = Simulation(swarm_of(robots, side_cm, f"robots.0.parameters.speed_cm_s={speed_cm_s}"), 1)
    space = bare_space(simulation.last_step.poses.tolist())

    def step_bare() -> None:
        for _ in range(10 * BLOCK):
            space.step(0.01)

    spent_s, ratio = compare(lambda: simulation.advance(BLOCK), step_bare, max(8, 2000 // robots))
    return spent_s / BLOCK * 1e6, ratio


class NumpyAgents:
    """The model of agents that hear their nearest neighbour, as a plain loop over firings with numpy."""

    def __init__(self, agents: int, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.places, self.phases = self.random.random((agents, 2)) * 100, self.random.random(agents)
        self.velocities = self.draw_headings()

    def draw_headings(self) -> FloatArray:
        """Draw (agents, 2) velocities of 1 cm a period."""
        angles = self.random.random(len(self.phases)) * 2 * np.pi
        return np.column_stack([np.cos(angles), np.sin(angles)])

    def fire(self) -> None:
        """Go on to the next firing; an agent that a pulse brings to its threshold fires next."""
        who = self.phases.argmax()
        wait = max(0.0, 1 - self.phases[who])
        self.phases += wait
        self.places += self.velocities * wait
        outside = ((self.places < 0) | (self.places > 100)).any(axis=1)
        if outside.any():
            self.velocities[outside] = self.draw_headings()[outside]
            self.places.clip(0, 100, out=self.places)
        self.phases[who] = 0
        distances = ((self.places - self.places[who]) ** 2).sum(axis=1)
        distances[who] = np.inf
        self.phases[distances.argmin()] *= 1.1


def compare_agents(agents: int) -> tuple[float, float]:
    """Return the CPU time of a firing in us, and its ratio to that of a plain loop of numpy."""
    scenario = load_scenario("particles", [f"agents.count={agents}", "agents.speed_cm_s=1"])
    spent, ratios = [], []
    for seed in range(5):
        ours, theirs = ParticleSimulation(scenario, seed), NumpyAgents(agents, seed)
        ours.run(2)
        before, began = ours.firings, time.thread_time()
        ours.run(ours.cycles + max(3, 20_000 // agents))
        between = time.thread_time()
        for _ in range(FIRINGS):
            theirs.fire()
        ended = time.thread_time()
        spent.append((between - began) / (ours.firings - before))
        ratios.append(spent[-1] / (ended - between) * FIRINGS)
    return statistics.median(spent) * 1e6, statistics.median(ratios)


def read_history() -> list[dict[str, str]]:
    if not HISTORY.exists():
        return []
    with HISTORY.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_history(lines: list[dict[str, str]]) -> None:
    with HISTORY.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, ["version", "date", *SWARMS, *AGENTS], lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)


def draw(lines: list[dict[str, str]]) -> None:
    figure = Figure(figsize=(6, 3.5), layout="constrained")
    axes = figure.subplots()
    for name in (*SWARMS, *AGENTS):
        ratios = [float(line[name]) / float(lines[0][name]) for line in lines]
        axes.plot(range(len(lines)), ratios, "o--" if name in AGENTS else "o-", label=name)
    axes.set(ylabel=f"time, over that of {lines[0]['version']}", ylim=(0, None))
    axes.set_xticks(range(len(lines)), labels=[f"{line['version']}\n{line['date']}" for line in lines])
    figure.legend(loc="outside right upper", fontsize="small")
    figure.savefig(HISTORY.with_suffix(".png"), dpi=110)


def main() -> None:
    lines = read_history()
    released = next((line for line in reversed(lines) if "dev" not in line["version"]), {})
    line = {"version": __version__, "date": datetime.now(UTC).date().isoformat()}
    print("                      us   ratio to the bare loop   to the last release's")
    for name in (*SWARMS, *AGENTS):
        spent_us, ratio = compare_agents(AGENTS[name]) if name in AGENTS else compare_robots(*SWARMS[name])
        line[name] = f"{ratio:.3g}"
        beside = f"{ratio / float(released[name]):.2f}" if released else "-"
        print(f"{name:14}  {spent_us:8.3g}   {ratio:22.3g}   {beside:>21}", flush=True)
    lines.append(line)
    write_history(lines)
    draw(lines)


if __name__ == "__main__":
    main()
