"""The cost of the line cameras' pictures, beside sorting the robots into cells. Run by `make bench`.

States are those of a simulated swarm, taken some steps apart; rings are lit as they were then, or all at once.
"""

from functools import partial

import numpy as np
import pytest

from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray
from epuck_sim.embodied.observers import place_robots
from epuck_sim.embodied.sensors.camera import look
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.swarm import swarm_at
from epuck_sim.util.jit import jit_no_alloc
from tests.benchmarks.measuring import swarm_of, take_turns
from tests.embodied.scenes import ADDRESSES, Scene, block_of, empty_arena

SWARMS = [(10, 60), (20, 100), (100, 200), (300, 400), (1000, 700)]
"""Robots, and the side of their arena in cm."""

FIRST_STEP, LAST_STEP, APART = 100, 250, 10
"""Steps whose states are taken: from 10 s on, once a second."""

ROUNDS = 30


COLUMNS = "robots", "lit", "share lit", "us a step", "us a robot", "us to sort them into cells"


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
    simulation = Simulation(swarm_of(robots, side, "robots.0.parameters.speed_cm_s=3.0"), 1)
    poses, lit = [], []
    for _ in range(LAST_STEP):
        step = next(simulation)
        poses.append(np.array(step.poses))
        lit.append(np.array(step.ring_on))
    return np.array(poses[FIRST_STEP::APART]), np.array(lit[FIRST_STEP::APART])


@pytest.mark.parametrize(("robots", "side"), SWARMS)
def test_the_pictures_of_a_step(benchmark, show, robots: int, side: int) -> None:
    poses, as_simulated = _states(robots, side)
    block = block_of(Scene(poses[0], as_simulated[0], empty_arena(side, side))).bytes
    times = max(1, 300 // robots)
    lit = {"as simulated": as_simulated, "all": np.ones_like(as_simulated)}
    works = {rings: partial(_see_states, block, ADDRESSES, poses, on, times) for rings, on in lit.items()}
    found = take_turns(benchmark, {"sorting": lambda: _sort_states(block, poses, times), **works}, ROUNDS)
    step_us = {name: np.median(spent) / times / len(poses) for name, spent in found.items()}
    for rings, on in lit.items():
        seeing_us = step_us[rings] - step_us["sorting"]
        show(COLUMNS, robots, rings, f"{on.mean():.1%}", seeing_us, seeing_us / robots, step_us["sorting"])
