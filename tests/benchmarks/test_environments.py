"""What environments cost beside the simulation, and beside VMAS's and PettingZoo's own examples. Run by `make bench`.

The latter are left out unless `pip install mpe2 vmas` was done. What they simulate differs: see docs/learning.md.
"""

from collections.abc import Callable
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np
import pytest

from epuck_sim import Simulation, load_scenario
from epuck_sim.environments import parallel_env, vector_env
from tests.benchmarks.measuring import Work, take_turns

pytestmark = pytest.mark.filterwarnings("ignore")  # of other packages, which are many

AGENTS = 10
SWARM = {"robots": [{"controller": "external", "count": AGENTS}]}
ROUNDS = 15
HELD, DRAWN = 16, 64  # steps for which an action holds, so that no swarm is jammed for long; actions that take turns

COLUMNS = "swarms", "us a swarm's step", "over that of the simulation"
OTHERS = "example", "swarms", "us a swarm's step of ours", "of theirs", "theirs over ours"
STARTS = "us to build a swarm", "to reset it", "built over reset"


def repeat(step: Work, times: int) -> Work:

    def steps() -> None:
        for _ in range(times):
            step()

    return steps


def our_step(swarms: int, reward: str | Callable[[Any], Any] = "aggregation", held: int = 0) -> Work:
    """Return the step of a batch of ours whose episodes do not end, with random actions; others after `held` steps."""
    env = vector_env(SWARM, swarms, seed=1, reward=reward, episode_s=float("inf"))
    env.reset()
    drawn = [env.action_space.sample() for _ in range(DRAWN if held else 1)]
    actions = cycle([action for action in drawn for _ in range(max(1, held))])
    return lambda: env.step(next(actions))


@pytest.mark.parametrize("swarms", [1, 16, 256])
def test_steps_of_environments(show, swarms: int) -> None:
    random, alone, times = np.random.default_rng(0), Simulation(SWARM, 1), max(1, 64 // swarms)

    def advance_alone() -> None:
        alone.command(*random.uniform(-12.8, 12.8, (2, AGENTS)), random.random(AGENTS) < 0.5)
        alone.advance(HELD)

    ours = our_step(swarms, lambda situation: situation.time_s, HELD)
    works = {"ours": repeat(ours, times), "alone": repeat(advance_alone, 10)}
    found = take_turns(works, ROUNDS)
    step_us = found["ours"] / times / swarms
    show(COLUMNS, swarms, np.median(step_us), np.median(step_us / found["alone"] * 10 * HELD))


def test_resets(show) -> None:
    scenario = load_scenario("thesis")
    used = Simulation(scenario, 1)
    works = {"built": repeat(lambda: Simulation(scenario, 2), 10), "reset": repeat(lambda: used.reset(2), 50)}
    found = take_turns(works, ROUNDS)
    built_us, reset_us = found["built"] / 10, found["reset"] / 50
    show(STARTS, np.median(built_us), np.median(reset_us), np.median(built_us / reset_us))


def swarm_step(env: Any) -> Work:
    env.reset(seed=1)
    return partial(env.step, {agent: env.action_space(agent).sample() for agent in env.agents})


def vmas_step(vmas: Any, example: str, swarms: int) -> Work:
    """Return the step of a batch of VMAS's, with random actions."""
    torch = pytest.importorskip("torch")
    torch.set_num_threads(1)
    env = vmas.make_env(example, num_envs=swarms, device="cpu", continuous_actions=True, seed=1, n_agents=AGENTS)
    env.reset()
    return partial(env.step, [torch.rand(swarms, 2) * 2 - 1 for _ in range(AGENTS)])


def compare(show: Any, ours: Work, theirs: Work, *row: object, times: int) -> None:
    """Show how many times as long a step of theirs takes."""
    found = take_turns({"ours": repeat(ours, 4 * times), "theirs": repeat(theirs, times)}, ROUNDS)
    ours_us, theirs_us = (found[name] / row[-1] / count for name, count in (("ours", 4 * times), ("theirs", times)))
    show(OTHERS, *row, np.median(ours_us), np.median(theirs_us), np.median(theirs_us / ours_us))


def test_beside_pettingzoos(show) -> None:
    spread = pytest.importorskip("mpe2.simple_spread_v3")
    theirs = spread.parallel_env(N=AGENTS, max_cycles=10**9, continuous_actions=True)
    ours = parallel_env(SWARM, seed=1, reward="aggregation", episode_s=float("inf"))
    compare(show, swarm_step(ours), swarm_step(theirs), "PettingZoo's simple_spread", 1, times=10)


@pytest.mark.parametrize(("swarms", "times"), [(1, 5), (256, 2), (1024, 1)])
@pytest.mark.parametrize("example", ["simple_spread", "navigation"])
def test_beside_vmass(show, example: str, swarms: int, times: int) -> None:
    vmas = pytest.importorskip("vmas")
    theirs = vmas_step(vmas, example, swarms)
    compare(show, our_step(swarms), theirs, f"VMAS's {example}", swarms, times=times)
