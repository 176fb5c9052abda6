"""Judges `epuck_sim.theory` by trials of random scenarios.

`theory_study.py trials SET FILE` appends a line of JSON a scenario to FILE, and goes on where it stopped. The set `fit`
has 60 scenarios. As it turned out to have seven with an intermediate regime, too few to fix thresholds on, `more` adds
140 to it. `blind` has 200 others, which judge. The seeds stood here before a trial was run. `limits` runs further
trials of `blind` that stand, and that are fast.
"""

import json
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.model import run_trial

SETS = {"fit": (60, 1990), "more": (140, 1975), "blind": (200, 2018)}
"""Number of scenarios and seed of each set."""

SIDE_CM = 100.0
SPEEDS_CM_S = [round(0.03 * (80 / 0.03) ** (place / 11), 3) for place in range(12)]
FAST_CM_S = 370.0
"""Far beyond the fast regime, and no whole number of sides in a cycle, which takes agents of a cyclic space back."""
TRIALS, MAX_CYCLES = 12, 2000

SPACES = [(2, "bounded")] * 6 + [(2, "cyclic")] * 5 + [(3, "bounded")] * 3 + [(3, "cyclic")] * 2
SPACES += [(2, "mirrored")] * 2 + [(1, "bounded")] * 2
CURVES = ["multiplicative"] * 4 + ["additive", "mirollo_strogatz", "sawtooth", "sine"]


def draw_scenarios(name: str) -> Iterator[dict[str, Any]]:
    """Yield the scenarios of a set: space, neighbourhood, number, coupling and curve, each drawn by itself."""
    count, seed = SETS[name]
    random = np.random.default_rng(seed)
    for number in range(count):
        dimensions, boundary = SPACES[random.integers(len(SPACES))]
        agents = round(math.exp(random.uniform(math.log(5), math.log(40))))
        kind = ["nearest", "range", "cone_of_vision", "cone_of_emission"][random.choice(4, p=[0.3, 0.2, 0.25, 0.25])]
        hood: dict[str, Any] = {"kind": kind}
        links = math.exp(random.uniform(math.log(0.7), math.log(6)))
        angle, reach = random.uniform(30, 150), math.exp(random.uniform(math.log(20), math.log(150)))
        if kind == "nearest":
            hood["k"] = min(int(random.integers(1, 5)), agents - 1)
        elif kind == "range":
            unit_ball = {1: 2.0, 2: math.pi, 3: 4 / 3 * math.pi}[dimensions]
            hood["radius_cm"] = round(SIDE_CM * (links / (agents - 1) / unit_ball) ** (1 / dimensions), 1)
        else:
            hood |= {"angle_deg": round(angle), "radius_cm": round(reach, 1)}
        yield {
            "name": f"{name}-{number}",
            "model": "particles",
            "space": {"dimensions": dimensions, "side_cm": SIDE_CM, "boundary": boundary},
            "agents": {"count": agents},
            "neighbourhood": hood,
            "response": {
                "curve": CURVES[random.integers(len(CURVES))],
                "coupling": round(math.exp(random.uniform(math.log(0.03), math.log(0.3))), 3),
            },
            "stop": {"max_cycles": MAX_CYCLES},
        }


def at_speed(given: dict[str, Any], speed_cm_s: float) -> Scenario:
    """Return a scenario of a set at a speed."""
    return load_scenario({**given, "agents": {**given["agents"], "speed_cm_s": speed_cm_s}})


def run_trials(given: dict[str, Any], speeds_cm_s: Sequence[float], seeds: range) -> list[list[int | None]]:
    """Return T_sync of each trial at each speed, in cycles; None where it is censored."""
    found = []
    for speed in speeds_cm_s:
        simulation, times = ParticleSimulation(at_speed(given, speed), 0), []
        for seed in seeds:
            simulation.reset(seed)
            times.append(run_trial(simulation).t_sync_cycles)
        found.append(times)
    return found


def extend(name: str, file: Path) -> None:
    """Append the trials of a set's scenarios to a file, from the first that is not there."""
    done = len(file.read_text().splitlines()) if file.exists() else 0
    at_limits = name == "limits"
    speeds = [0.0, FAST_CM_S] if at_limits else [0.0, *SPEEDS_CM_S, FAST_CM_S]
    seeds = range(TRIALS, 3 * TRIALS) if at_limits else range(TRIALS)
    for number, given in enumerate(draw_scenarios("blind" if at_limits else name)):
        if number >= done:
            line = json.dumps({"scenario": given, "times": run_trials(given, speeds, seeds)})
            with file.open("a") as opened:
                opened.write(line + "\n")


if __name__ == "__main__":
    extend(sys.argv[2], Path(sys.argv[3]))
