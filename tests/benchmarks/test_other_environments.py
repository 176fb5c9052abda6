"""Environments' steps beside those of VMAS's and PettingZoo's own examples. Run by `make bench`.

They are left out unless `pip install mpe2 vmas` was done. What they simulate differs: see docs/learning.md.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from epuck_sim.environments import parallel_env, vector_env

pytestmark = [pytest.mark.benchmark, pytest.mark.filterwarnings("ignore")]  # theirs are many

AGENTS = 10
SWARM = {"robots": [{"controller": "external", "count": AGENTS}]}
ENDLESS_S = float("inf")
ROUNDS = 15

Step = Callable[[], Any]


def swarm_us(step: Step, swarms: int, times: int) -> float:
    """Return the CPU time of this thread for a step of one swarm, in us."""
    began = time.thread_time()
    for _ in range(times):
        step()
    return (time.thread_time() - began) / times / swarms * 1e6


def our_step(swarms: int) -> Step:
    """Return the step of a batch of ours, with random actions."""
    env = vector_env(SWARM, swarms, seed=1, reward="aggregation", episode_s=ENDLESS_S)
    env.reset()
    actions = env.action_space.sample()
    return lambda: env.step(actions)


def swarm_step(env: Any) -> Step:
    """Return the step of a PettingZoo environment, with random actions."""
    env.reset(seed=1)
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    return lambda: env.step(actions)


def vmas_step(vmas: Any, example: str, swarms: int) -> Step:
    """Return the step of a batch of VMAS's, with random actions."""
    torch = pytest.importorskip("torch")
    torch.set_num_threads(1)
    env = vmas.make_env(example, num_envs=swarms, device="cpu", continuous_actions=True, seed=1, n_agents=AGENTS)
    env.reset()
    actions = [torch.rand(swarms, 2) * 2 - 1 for _ in range(AGENTS)]
    return lambda: env.step(actions)


def compare(benchmark: Any, ours: Step, theirs: Step, swarms: int, times: int) -> None:
    """Print how many times as long a step of theirs takes, from turns."""
    ours(), theirs()
    found: list[tuple[float, float]] = []

    def take_turns() -> None:
        found.append((swarm_us(ours, swarms, 4 * times), swarm_us(theirs, swarms, times)))

    benchmark.pedantic(take_turns, rounds=ROUNDS)
    ours_us, theirs_us = np.array(found).T
    ratio = np.median(theirs_us / ours_us)
    print(f"\n{np.median(ours_us):.0f} and {np.median(theirs_us):.0f} us, {ratio:.2f} times as long")


def test_beside_pettingzoos(benchmark) -> None:
    spread = pytest.importorskip("mpe2.simple_spread_v3")
    theirs = spread.parallel_env(N=AGENTS, max_cycles=10**9, continuous_actions=True)
    ours = parallel_env(SWARM, seed=1, reward="aggregation", episode_s=ENDLESS_S)
    compare(benchmark, swarm_step(ours), swarm_step(theirs), 1, 10)


@pytest.mark.parametrize(("swarms", "times"), [(1, 5), (256, 2), (1024, 1)])
@pytest.mark.parametrize("example", ["simple_spread", "navigation"])
def test_beside_vmass(benchmark, example: str, swarms: int, times: int) -> None:
    vmas = pytest.importorskip("vmas")
    compare(benchmark, our_step(swarms), vmas_step(vmas, example, swarms), swarms, times)
