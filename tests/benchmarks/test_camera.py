"""The cost of the line cameras' pictures, beside sorting the robots into cells. Run by `make bench`.

States are those of a simulated swarm, taken some steps apart; rings are lit as they were then, or all at once.
"""

import time

import numpy as np
import pytest

from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray
from epuck_sim.embodied.observers import place_robots
from epuck_sim.embodied.sensors.camera import look
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.swarm import swarm_at
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.util.jit import jit_no_alloc
from tests.embodied.scenes import ADDRESSES, Scene, block_of, empty_arena

pytestmark = pytest.mark.benchmark

SWARMS = [(10, 60), (20, 100), (100, 200), (300, 400), (1000, 700)]
"""Robots, and the side of their arena in cm."""

FIRST_STEP, LAST_STEP, APART = 100, 250, 10
"""Steps whose states are taken: from 10 s on, once a second."""

ROUNDS = 30


@pytest.fixture(scope="module")
def costs():
    """(robots, which rings are lit) -> us a step, us to sort robots into cells, share lit; printed as a table."""
    found: dict[tuple[int, str], tuple[float, float, float]] = {}
    yield found
    print("\n\nCPU time of all pictures of a step in us, beside sorting the robots into cells")
    print("robots  lit           share       step  a robot  sorting")
    for (robots, rings), (seeing, sorting, share) in found.items():
        print(f"{robots:6}  {rings:12}  {share:5.1%}  {seeing:9.1f}  {seeing / robots:7.3f}  {sorting:7.1f}")


@jit_no_alloc
def _sort_states(block: ByteArray, poses: FloatArray, times: int) -> None:
    for _ in range(times):
        for state in range(len(poses)):
            place_robots(block, poses[state])


@jit_no_alloc
def _see_states(block: ByteArray, addresses: IntArray, poses: FloatArray, lit: BoolArray, times: int) -> None:
    swarm = swarm_at(block)
    for _ in range(times):
        for state in range(len(poses)):
            place_robots(block, poses[state])
            for robot in range(len(swarm.robots)):
                swarm.robots[robot].ring_on = lit[state, robot]
            look(block, addresses, 0)


def _states(robots: int, side: int) -> tuple[FloatArray, BoolArray]:
    settings = [f"robots.0.count={robots}", f"arena.width_cm={side}", f"arena.height_cm={side}"]
    simulation = Simulation(load_scenario("thesis", [*settings, "robots.0.parameters.speed_cm_s=3.0"]), 1)
    poses, lit = [], []
    for _ in range(LAST_STEP):
        step = next(simulation)
        poses.append(np.array(step.poses))
        lit.append(np.array(step.ring_on))
    return np.array(poses[FIRST_STEP::APART]), np.array(lit[FIRST_STEP::APART])


@pytest.mark.parametrize(("robots", "side"), SWARMS)
def test_the_pictures_of_a_step(benchmark, costs, robots: int, side: int) -> None:
    poses, as_simulated = _states(robots, side)
    block = block_of(Scene(poses[0], as_simulated[0], empty_arena(side, side))).bytes
    times = max(1, 300 // robots)
    lit = {"as simulated": as_simulated, "all": np.ones_like(as_simulated)}
    spent_s: dict[str, list[float]] = {rings: [] for rings in ("sorting", *lit)}

    def in_turn() -> None:
        for rings, found in spent_s.items():
            began = time.thread_time()
            if rings == "sorting":
                _sort_states(block, poses, times)
            else:
                _see_states(block, ADDRESSES, poses, lit[rings], times)
            found.append(time.thread_time() - began)

    benchmark.pedantic(in_turn, rounds=ROUNDS, warmup_rounds=1)
    steps = times * len(poses)
    sorting, *seeing = (np.median(found[1:]) / steps * 1e6 for found in spent_s.values())
    for (rings, on), both in zip(lit.items(), seeing, strict=True):
        costs[robots, rings] = both - sorting, sorting, on.mean()
