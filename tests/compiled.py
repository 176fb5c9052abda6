"""Compiles what tests share before the first of them runs: `python -m tests.compiled robots`, and the same of agents.

Compiled code is kept on disk, but its parts are not: kernels that call the same functions cost less in one process than
in several. Where tests in two processes meet a kernel at once, both compile it.
"""

import sys
import tempfile
from itertools import islice
from pathlib import Path

import numpy as np

from epuck_sim import ParticleSimulation, Simulation, load_scenario, run_sweep, run_trial, write_report
from epuck_sim.arena import make_arena
from epuck_sim.embodied.bodies.contacts import find_contact_candidates
from epuck_sim.environments import vector_env
from epuck_sim.trial.model import simulate
from tests import golden
from tests.embodied.bodies.worlds import MovedWorld
from tests.sweep.pool_here import pool_here


def robots(folder: Path) -> None:
    """Compile what records, films and measures robots, and drives them from outside, alone or in batches."""
    golden.pictures(folder)
    run_trial(simulate(load_scenario("thesis", ["stop.max_cycles=2"], measures=["component_count"]), 1))
    golden.commanded()
    Simulation("thesis", 1, interpret=True).advance(2)
    batch = vector_env({"robots": [{"count": 1, "controller": "external"}]}, 2)
    batch.reset()
    batch.step(np.zeros((2, 3)))
    world = MovedWorld(make_arena(60, 60, [], []), [[20, 20, 0], [27, 20, 0]])
    world.advance()
    find_contact_candidates(world.block)


def agents(folder: Path) -> None:
    """Compile what measures, statistics, theory and figures need, and list the fonts."""
    run_trial(simulate(load_scenario("particles", ["stop.max_cycles=2"], measures=["component_count"]), 1))
    scenario = load_scenario("particles", ["stop.max_cycles=30", "trials=6"], ["agents.speed_cm_s=1,20"])
    run_sweep(scenario, folder / "run", pool_here)
    write_report(folder / "run", folder / "page.html")


def main(kind: str) -> None:
    """Compile the kernels of one kind of golden cases, and what goes with them."""
    for name in golden.CASES[kind]:
        simulation = simulate(golden.case(kind, name), 1)
        next(islice(simulation, 3, None))
        if isinstance(simulation, ParticleSimulation) and simulation.scenario.neighbourhood.kind != "random":
            simulation.neighbour_links()
    with tempfile.TemporaryDirectory() as folder:
        {"robots": robots, "agents": agents}[kind](Path(folder))


if __name__ == "__main__":
    main(sys.argv[1])
