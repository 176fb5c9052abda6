"""What environments cost beside the simulation itself, and resets beside new simulations. Run by `make bench`."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.environments import vector_env
from epuck_sim.overhead.render import ArenaView
from epuck_sim.scenario.loader import load_scenario

pytestmark = pytest.mark.benchmark

SWARM = {"robots": [{"controller": "external", "count": 10}]}

ROUNDS = 15


def cpu_us(work: Callable[[], Any], times: int) -> float:
    """Return the CPU time of this thread for one call, in us."""
    began = time.thread_time()
    for _ in range(times):
        work()
    return (time.thread_time() - began) / times * 1e6


@pytest.mark.parametrize("swarms", [1, 16, 256])
def test_steps_of_environments(benchmark, swarms: int) -> None:
    random = np.random.default_rng(0)
    env = vector_env(SWARM, swarms, seed=1, reward=lambda situation: situation.time_s, episode_s=float("inf"))
    env.reset()
    alone = Simulation(SWARM, 1)

    def advance_alone() -> None:
        alone.command(*random.uniform(-12.8, 12.8, (2, 10)))
        alone.advance(16)

    def measure() -> tuple[float, float]:
        actions = random.uniform(-1, 1, (env.num_envs, 3))
        return cpu_us(lambda: env.step(actions), max(1, 64 // swarms)) / swarms, cpu_us(advance_alone, 10) / 16

    measure()
    found = np.array([measure() for _ in range(ROUNDS)])
    step_us, ratio = np.median(found[:, 0]), np.median(found[:, 0] / found[:, 1])
    print(f"\n{swarms} swarms: {step_us:.1f} us a swarm's step, {ratio:.1f} times the simulation's")
    benchmark.pedantic(env.step, (env.action_space.sample(),), rounds=3)


def test_resets(benchmark) -> None:
    scenario = load_scenario("thesis")
    used = Simulation(scenario, 1)
    found = [(cpu_us(lambda: Simulation(scenario, 2), 10), cpu_us(lambda: used.reset(2), 50)) for _ in range(ROUNDS)]
    built_us, reset_us = np.median(found, axis=0)
    ratio = np.median([built / reset for built, reset in found])
    print(f"\nbuilt {built_us:.0f} us, reset {reset_us:.0f} us, {ratio:.1f} times less")
    benchmark.pedantic(used.reset, (2,), rounds=50)


@pytest.mark.parametrize("side", [128, 240, 480])
def test_pictures(benchmark, side: int) -> None:
    view, step = ArenaView(load_scenario("thesis"), side, side), next(Simulation("thesis", 1))
    view.draw(step.poses, step.ring_on)
    benchmark.pedantic(view.draw, (step.poses, step.ring_on), rounds=50)
