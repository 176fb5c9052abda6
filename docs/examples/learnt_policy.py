"""What a policy that was learnt does, in numpy alone: three tasks, baselines for each, and the learnt networks.

    python docs/examples/learnt_policy.py docs/figures/policy

writes policy.txt: the mean reward of trials that nobody learnt from, for random actions, for the thesis's rule and for
the networks in learnt_policy.npz. It takes half a minute. `train_policy.py` makes the networks.
"""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

from epuck_sim import Simulation
from epuck_sim.environments import Situation, vector_env
from epuck_sim.environments.rewards import REWARDS
from epuck_sim.environments.vector import SwarmVectorEnv
from epuck_sim.util.seeds import trial_seed

LEARNT = Path(__file__).with_suffix(".npz")
ROBOTS, EPISODE_S, CONTROL_STEPS = 10, 60.0, 5  # an action holds for half a second

TESTING = 4  # master seed of trials that nobody learnt from

Array = npt.NDArray[np.float32]
Policy = Callable[[Array], npt.NDArray[np.int64]]
"""Takes (agents, columns) observations; returns (agents,) numbers of motions."""


class Task(NamedTuple):
    """What robots are rewarded for, and what they command."""

    reward: str
    controller: str


TASKS = {
    "synchrony": Task("synchrony", "external_wheels"),  # rings flash as the thesis's do
    "aggregation": Task("aggregation", "external"),
    "covering": Task("coverage", "external"),
}


def swarms(task: Task, count: int, seed: int) -> SwarmVectorEnv:
    """Return an environment of a number of the thesis's swarms that have a task."""
    scenario = {"name": "learners", "robots": [{"controller": task.controller, "count": ROBOTS}]}
    given = {"reward": task.reward, "actions": "discrete", "control_steps": CONTROL_STEPS, "episode_s": EPISODE_S}
    return vector_env(scenario, count, seed=seed, **given)


def logits(weights: dict[str, Array], observations: Array) -> Array:
    """Return (agents, motions) what a network of two hidden layers says of (agents, columns) observations."""
    hidden = np.tanh(observations @ weights["first"] + weights["first_bias"])
    hidden = np.tanh(hidden @ weights["second"] + weights["second_bias"])
    return hidden @ weights["last"] + weights["last_bias"]


def learnt(name: str, random: np.random.Generator) -> Policy:
    """Return the policy that was learnt for a task; it draws motions as it did when it learnt."""
    with np.load(LEARNT) as file:
        weights = {key.removeprefix(f"{name}/"): file[key] for key in file.files if key.startswith(f"{name}/")}

    def act(observations: Array) -> npt.NDArray[np.int64]:
        scores = logits(weights, observations)
        return (scores + random.gumbel(size=scores.shape)).argmax(axis=1)

    return act


def rewards_of(task: Task, policy: Policy, trials: int) -> npt.NDArray[np.float64]:
    """Return (trials,) the mean reward of each trial in which all robots follow a policy."""
    env = swarms(task, trials, TESTING)
    observations, _ = env.reset(seed=[trial_seed(TESTING, trial) for trial in range(trials)])
    total = np.zeros(env.num_envs)
    decisions = round(EPISODE_S / 0.1 / CONTROL_STEPS)
    for _ in range(decisions):
        observations, rewards, *_ = env.step(policy(observations))
        total += rewards
    return total.reshape(trials, ROBOTS).mean(axis=1) / decisions


def rewards_of_robots(task: Task, simulation: Simulation, trials: int) -> npt.NDArray[np.float64]:
    """Return (trials,) the mean reward of each trial in which robots have their own controllers."""
    found = []
    period_ms, arena = simulation.period_ms, simulation.scenario.arena
    for trial in range(trials):
        simulation.reset(trial_seed(TESTING, trial))
        next(simulation)
        rewards = []
        for _ in range(round(EPISODE_S / 0.1 / CONTROL_STEPS)):
            step = simulation.advance(CONTROL_STEPS)
            phase, wheels, time_s = step.phase_ms / period_ms, step.wheels_cm_s, np.array(step.time_s)
            seen = Situation(time_s, step.poses, wheels, step.ring_on, phase, arena.width_cm, arena.height_cm)
            rewards.append(np.mean(REWARDS[task.reward](seen)))
        found.append(np.mean(rewards))
    return np.array(found)


def baselines(name: str, trials: int) -> Iterator[tuple[str, npt.NDArray[np.float64]]]:
    """Yield what random actions, the thesis's rule and the learnt network get in each of some trials."""
    task, random = TASKS[name], np.random.default_rng(TESTING)
    motions = int(swarms(task, 1, 0).single_action_space.n)
    yield "random", rewards_of(task, lambda observations: random.integers(motions, size=len(observations)), trials)
    yield "thesis's rule", rewards_of_robots(task, Simulation("thesis"), trials)
    yield "learnt", rewards_of(task, learnt(name, random), trials)


def table(trials: int) -> Iterator[str]:
    """Yield the lines of the table, with the 95 % intervals of means by Student's t."""
    yield f"{'task':14}{'policy':16}{'mean reward':>12}  95 % interval"
    for name in TASKS:
        for policy, rewards in baselines(name, trials):
            mean = rewards.mean()
            low, high = stats.t.interval(0.95, trials - 1, mean, stats.sem(rewards))
            yield f"{name:14}{policy:16}{mean:12.3f}  {low:.3f} to {high:.3f}"


if __name__ == "__main__":
    lines = []
    for row in table(100):
        lines.append(row)
        print(row, flush=True)
    Path(sys.argv[1]).with_suffix(".txt").write_text("\n".join(lines) + "\n")
